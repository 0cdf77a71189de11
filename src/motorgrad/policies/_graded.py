"""Units of graded activation: a positive function of the input, and noise (stochastic real-valued units)."""

import abc
import math
from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._policy import Policy, fixed, in_structure, outer, unit_rows

LEAST = 2.0**-24  # a number from U[0, 1) that is 0 stands for less than the least step of single precision


class GradedUnits(Policy):
    r"""A pool of $N$ units with activations $a_i = m_i(y) + s_i\,\varepsilon_i$, with independent noise
    $\varepsilon_i \sim \mathcal N(0, 1)$ (section 6.2.3 of the thesis; Williams, 1992; Gullapalli, 1990).

    The deviation is $s = s_{\min} + e^\lambda$: the `floor` keeps the score, which has $1/s$, from growing without
    bound as a unit becomes sure. With $z = (a - m)/s$ the score is $(z/s)\,\nabla m$ and
    $\partial_\lambda = (z^2 - 1)\,e^\lambda/s$. A step size of 0 for `log_deviation` keeps the noise as it is.

    An action is a vector of $N$ real numbers, as drawn: also below 0 and above 1. What that means is a matter of the
    task, and the score is of what was drawn.
    """

    log_deviation: eqx.AbstractVar[Float[Array, " units"]]
    floor: eqx.AbstractVar[Float[Array, ""]]

    @abc.abstractmethod
    def mean(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """$m_i(y)$."""

    @abc.abstractmethod
    def mean_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        r"""$\partial m_i/\partial\theta$ of every trainable field but `log_deviation`, by the field's name; units
        lead."""

    @property
    def actions(self) -> str:
        return "graded"

    @property
    def outputs(self) -> int:
        return self.log_deviation.shape[0]

    @property
    def deviation(self) -> Float[Array, " units"]:
        """$s_i$, the standard deviation of the noise."""
        return self.floor + jnp.exp(self.log_deviation)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """The mean activations, which play the part of a binary unit's probability of firing."""
        return self.mean(observation)

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " units"]) -> Float[Array, " units"]:
        noise = jax.scipy.special.ndtri(jnp.maximum(uniforms, LEAST))
        return self.mean(observation) + self.deviation * noise.astype(self.log_deviation.dtype)

    def mode(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return self.mean(observation)

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        """Logarithm of each unit's density."""
        s = self.deviation
        return -0.5 * ((action - self.mean(observation)) / s) ** 2 - jnp.log(s) - 0.5 * math.log(2 * math.pi)

    def log_prob(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, ""]:
        """Logarithm of the density."""
        return jnp.sum(self.log_probs(observation, action))

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        s = self.deviation
        z = (action - self.mean(observation)) / s
        parts = {name: _times(z / s, slope) for name, slope in self.mean_gradient(observation).items()}
        return in_structure(self, **parts, log_deviation=(z * z - 1) * self._slope())

    def _slope(self) -> Float[Array, " units"]:
        r"""$\partial \log s/\partial\lambda = e^\lambda/s$."""
        return jnp.exp(self.log_deviation) / self.deviation

    def blocks(self, gradient: Any) -> tuple[Float[Array, "units parameters"], ...]:
        """A row for each unit, where every trainable array leads with the units; else one row of what they share."""
        return (unit_rows(self, gradient),)

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        r"""Exact, $\nabla m \nabla m'/s^2$ and $2\,(e^\lambda/s)^2$: mean and deviation do not mix, as $\mathbb E z^3$
        is 0.

        Where several units share parameters it is the sample $ss'$.
        """
        none = jnp.zeros_like(self.log_deviation)
        slopes = {name: _times(1 / self.deviation, v) for name, v in self.mean_gradient(observation).items()}
        (level,) = self.blocks(in_structure(self, **slopes, log_deviation=none))
        others = {name: jnp.zeros_like(v) for name, v in slopes.items()}
        (spread,) = self.blocks(in_structure(self, **others, log_deviation=math.sqrt(2) * self._slope()))
        if level.shape[0] != self.outputs:
            return super().fisher(observation, action)
        return (outer(level) + outer(spread),)

    @property
    def entropies(self) -> Float[Array, " units"]:
        """The differential entropy of each unit, in nats."""
        return jnp.log(self.deviation) + 0.5 * math.log(2 * math.pi * math.e)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """The differential entropy, in nats; below 0 where there is little noise. It is the same at all inputs."""
        return jnp.sum(self.entropies)

    def enumerate(self) -> Array:
        raise ValueError(f"{type(self).__name__}: has infinitely many actions: real numbers")


class GradedMotoneurons(GradedUnits):
    r"""A pool of motoneurons on one common input whose firing rate follows it, $m_i = \sigma(k_i (y - y^*_i))$.

    Slopes: $\partial_{y^*} m = -k\,m(1 - m)$ and $\partial_k m = (y - y^*)\,m(1 - m)$; the rest is in `GradedUnits`.

    **Arguments:** `threshold` $y^*$, `gain` $k$ and `log_deviation` $\lambda$, all of shape `(units,)`; `floor`
    $s_{\min}$, the least deviation, above 0 and not learnt.
    """

    threshold: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    gain: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    log_deviation: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    floor: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.02)

    def __check_init__(self) -> None:
        check(self.threshold.ndim == 1, "threshold", self.threshold.shape, "of shape (units,)")
        for name in ("gain", "log_deviation"):
            shape = getattr(self, name).shape
            check(shape == self.threshold.shape, name, shape, f"of shape {self.threshold.shape}")
        check_floor(self.floor)

    @property
    def inputs(self) -> int:
        return 1

    def mean(self, observation: Float[Array, " 1"]) -> Float[Array, " units"]:
        return jax.nn.sigmoid(self.gain * (observation[0] - self.threshold))

    def mean_gradient(self, observation: Float[Array, " 1"]) -> dict[str, Array]:
        away = observation[0] - self.threshold
        potential = self.gain * away
        rise = jax.nn.sigmoid(potential) * jax.nn.sigmoid(-potential)
        return {"threshold": -self.gain * rise, "gain": away * rise}


def check_floor(floor: Array) -> None:
    """Refuse a least deviation that is none."""
    check(floor.shape == (), "floor", floor.shape, "one number")
    if not isinstance(floor, Tracer):  # while tracing there is no value to look at
        value = float(np.asarray(floor))
        check(0 < value < math.inf, "floor", value, "positive and finite")


def _times(units: Float[Array, " units"], values: Array) -> Array:
    """A number for each unit times an array that leads with the units."""
    return units.reshape(units.shape + (1,) * (values.ndim - 1)) * values
