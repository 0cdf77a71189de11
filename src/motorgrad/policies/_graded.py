"""Stochastic real-valued units: a mean that depends on the input, plus Gaussian noise."""

import abc
import math
from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad._random import MIN_UNIFORM
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._autoregressive import InitialLasting
from motorgrad.policies._binary import InitialMotoneurons
from motorgrad.policies._featured import InitialFeatured
from motorgrad.policies._parameters import (
    fixed,
    in_structure,
    outer,
    outer_sum,
    per_unit,
    shared_outer_sum,
    trainable,
    with_fields,
)
from motorgrad.policies._policy import Units, check_shapes, has_rows
from motorgrad.policies._products import weighted
from motorgrad.policies._starting import POSITIVE, Initial, InitialPolicy, function_of
from motorgrad.schema import static


class Noisy:
    r"""What policies have in common that act with noise of the standard deviation $s = s_{\min} + e^\lambda$."""

    log_deviation: Float[Array, " units"]
    floor: Float[Array, ""]

    @property
    def actions(self) -> str:
        return "continuous"

    @property
    def deviation(self) -> Float[Array, " units"]:
        """$s_i$, the standard deviation of the noise."""
        return self.floor + jnp.exp(self.log_deviation)

    def _log_deviation_slope(self) -> Float[Array, " units"]:
        r"""$\partial \log s/\partial\lambda = e^\lambda/s$."""
        return jnp.exp(self.log_deviation) / self.deviation


class GradedUnits(Noisy, Units):
    r"""A pool of $N$ units with activations $a_i = m_i(y) + s_i\,\varepsilon_i$, where $\varepsilon_i \sim \mathcal
    N(0, 1)$ is independent noise (section 6.2.3 of the thesis; Williams, 1992; Gullapalli, 1990).

    The standard deviation is $s = s_{\min} + e^\lambda$: the `floor` $s_{\min}$ bounds the score, which contains
    $1/s$, as a unit becomes certain. With $z = (a - m)/s$ the score is $(z/s)\,\nabla m$ and
    $\partial_\lambda = (z^2 - 1)\,e^\lambda/s$. To hold the noise constant, give `log_deviation` a step size of 0.

    An action is a vector of $N$ real numbers, exactly as drawn, also below 0 and above 1. The task decides what such
    activations do.

    A subclass defines `inputs`, `mean` and `mean_gradient`.
    """

    log_deviation: eqx.AbstractVar[Float[Array, " units"]]
    floor: eqx.AbstractVar[Float[Array, ""]]

    @abc.abstractmethod
    def mean(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """$m_i(y)$."""

    @abc.abstractmethod
    def mean_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        r"""$\partial m_i/\partial\theta$ for every trainable field except `log_deviation`, by field name. Units
        lead."""

    @property
    def outputs(self) -> int:
        return self.log_deviation.shape[0]

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """The mean activations, the counterpart of a binary unit's firing probability."""
        return self.mean(observation)

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " units"]) -> Float[Array, " units"]:
        return self.mean(observation) + self.deviation * normal_of(uniforms).astype(self.log_deviation.dtype)

    def mode(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return self.mean(observation)

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        """Log-density of each unit's activation."""
        s = self.deviation
        return -0.5 * ((action - self.mean(observation)) / s) ** 2 - jnp.log(s) - 0.5 * math.log(2 * math.pi)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        location, spread = self._slopes(observation, action)
        gradient = self.mean_gradient(observation)
        parts = {name: per_unit(location, slope) * slope for name, slope in gradient.items()}
        return in_structure(self, **parts, log_deviation=spread * self._log_deviation_slope())

    def _slopes(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, " units"], Float[Array, " units"]]:
        r"""The derivatives of each unit's log-density by $m$ and by $\log s$."""
        z = (action - self.mean(observation)) / self.deviation
        return z / self.deviation, z * z - 1

    def _information(self, observation: Float[Array, " inputs"]) -> tuple[Array, Array, Array]:
        r"""The Fisher information of each unit's $m$ and $\log s$, as the factor of its Cholesky decomposition: its
        entries $mm$, $sm$ and $ss$."""
        none = jnp.zeros_like(self.log_deviation)
        return 1 / self.deviation, none, jnp.full_like(none, math.sqrt(2))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        r"""Exact: $\nabla m \nabla m'/s^2$ for the mean and $2\,(e^\lambda/s)^2$ for $\lambda$.

        Normal units have no cross term, as $\mathbb E z^3 = 0$. Units that share parameters use the sample $ss'$.
        """
        if not has_rows(self):
            return abilities.sampled_fisher(self, observation, action)
        location, cross, spread = self._information(observation)
        return (outer(self._mean_row(observation, location, cross)) + outer(self._noise_row(spread)),)

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        own = type(self).fisher is GradedUnits.fisher and has_rows(self)
        if not own:
            return abilities.fisher_sum_one_by_one(self, observations, actions, weights)
        location, cross, spread = jax.vmap(self._information)(observations)
        root = jnp.sqrt(weights)[:, None]
        mean = jax.vmap(self._mean_row)(observations, root * location, root * cross)
        # The other row has a single entry, at the same place in all decisions: the squares add up.
        noise = self._noise_row(jnp.sqrt(jnp.sum(jnp.square(root * spread), axis=0)))
        return (outer_sum(mean) + outer(noise),)

    def fisher_coordinates(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> Float[Array, " coordinates"]:
        r"""Means and logarithms of deviations, by the factor of their Fisher information, which is held constant."""
        location, cross, spread = jax.lax.stop_gradient(self._information(observation))
        noise = jnp.log(self.deviation)
        return jnp.concatenate([location * self.mean(observation) + cross * noise, spread * noise])

    def _mean_row(
        self, observation: Float[Array, " inputs"], location: Array, cross: Array
    ) -> Float[Array, "units parameters"]:
        r"""The first of the two rows of each unit whose outer products add up to its Fisher matrix: of $m$, and of
        $\log s$ as far as they go together."""
        slopes = self.mean_gradient(observation)
        parts = {name: per_unit(location, slope) * slope for name, slope in slopes.items()}
        (row,) = self.blocks(in_structure(self, **parts, log_deviation=cross * self._log_deviation_slope()))
        return row

    def _noise_row(self, spread: Array) -> Float[Array, "units parameters"]:
        r"""The second: what remains of $\log s$."""
        parameters = trainable(self)
        zeros = jax.tree.map(jnp.zeros_like, parameters)
        (row,) = self.blocks(with_fields(zeros, log_deviation=spread * self._log_deviation_slope()))
        return row

    def with_temperature(self, factor: float | Float[Array, ""]) -> Self:
        return with_fields(self, log_deviation=self.log_deviation + jnp.log(factor))

    def entropies(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """Differential entropy of each unit, in nats."""
        return jnp.log(self.deviation) + 0.5 * math.log(2 * math.pi * math.e)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """Differential entropy in nats, negative for little noise; of normal units the same at all inputs."""
        return jnp.sum(self.entropies(observation))


class GradedMotoneurons(GradedUnits):
    r"""Motoneurons whose mean firing rate follows one common input, $m_i = \sigma(k_i (y - y^*_i))$.

    Gradient of the mean: $\partial_{y^*} m = -k\,m(1 - m)$ and $\partial_k m = (y - y^*)\,m(1 - m)$. For the score and
    the noise, see `GradedUnits`.

    **Arguments:** `threshold` $y^*$, `gain` $k$ and `log_deviation` $\lambda$, all of shape `(units,)`; `floor`
    $s_{\min}$, the lower bound of the standard deviation, positive and not trainable.
    """

    threshold: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    gain: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    log_deviation: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    floor: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.02)

    def __check_init__(self) -> None:
        check(self.threshold.ndim == 1, "threshold", self.threshold.shape, "of shape (units,)")
        check_shapes(self, self.threshold.shape, "gain", "log_deviation")
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


class GradedHyperplanes(GradedUnits):
    r"""Units with a mean linear in the inputs, $m_i = w_i \cdot y + b_i$ (the Gaussian unit of Williams, 1992).

    Gradient of the mean: $\partial_{w_i} m_i = y$ and $\partial_{b_i} m_i = 1$. For the score and the noise, see
    `GradedUnits`.

    **Arguments:** `weights` $w$ of shape `(units, inputs)`; `bias` $b$ and `log_deviation` $\lambda$, both `(units,)`;
    `floor` $s_{\min}$, the lower bound of the standard deviation, positive and not trainable.
    """

    weights: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    bias: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    log_deviation: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    floor: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.02)

    def __check_init__(self) -> None:
        check(self.weights.ndim == 2, "weights", self.weights.shape, "of shape (units, inputs)")
        check_shapes(self, self.weights.shape[:1], "bias", "log_deviation")
        check_floor(self.floor)

    @property
    def inputs(self) -> int:
        return self.weights.shape[1]

    @property
    def normal(self) -> bool:
        """Whether an activation is a function of one normal number."""
        return True

    def number_before(self, action: Float[Array, " units"]) -> Float[Array, " units"]:
        """The normal numbers that became these activations."""
        return action

    def mean(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return weighted(self.weights, observation) + self.bias

    def mean_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        return {"weights": jnp.broadcast_to(observation, self.weights.shape), "bias": jnp.ones_like(self.bias)}

    @property
    def _usual(self) -> bool:
        """Whether scores and Fisher matrices are those of this class: what is computed of many decisions at once."""
        kind = type(self)
        own = kind.score, kind.fisher, kind.mean_gradient
        return own == (GradedUnits.score, GradedUnits.fisher, GradedHyperplanes.mean_gradient)

    def score_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, "decisions sums"]
    ) -> Self:
        if not self._usual:
            return abilities.score_sum_one_by_one(self, observations, actions, weights)
        location, spread = self._slopes(observations, actions)
        credited = weights.T[:, :, None] * location
        noise = jnp.broadcast_to(spread, location.shape) * self._log_deviation_slope()
        slopes = jnp.einsum("ktu,ti->kui", credited, observations)
        return in_structure(self, weights=slopes, bias=credited.sum(1), log_deviation=weights.T @ noise)

    def entropy_sum(self, observations: Float[Array, "decisions inputs"]) -> Float[Array, ""]:
        entropies = self.entropies(observations)
        return jnp.sum(jnp.broadcast_to(entropies, (len(observations), self.outputs)))

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        if not self._usual:
            return super().fisher_sum(observations, actions, weights)
        # All units share the row (y, 1) of their means, and have numbers of their own at the noise, which comes last.
        shape = len(observations), self.outputs
        location, cross, spread = (jnp.broadcast_to(each, shape) for each in self._information(observations))
        shared = jnp.concatenate([observations, jnp.ones_like(observations[:, :1])], axis=1)
        noise = self._log_deviation_slope()
        weighted = weights[:, None] * location
        of_means = shared_outer_sum(weighted * location, shared)
        both = ((weighted * cross).T @ shared) * noise[:, None]
        of_noise = (weights @ (cross * cross + spread * spread)) * noise * noise
        top = jnp.concatenate([of_means, both[:, :, None]], axis=2)
        last = jnp.concatenate([both, of_noise[:, None]], axis=1)
        return (jnp.concatenate([top, last[:, None, :]], axis=1),)


class StartsNoisy:
    """What initial policies of units have in common whose noise starts with a standard deviation that learning keeps
    above a floor."""

    deviation: float
    floor: float

    def validate(self) -> None:
        super().validate()  # type: ignore[misc]
        check(self.floor < self.deviation, "floor, deviation", (self.floor, self.deviation), "floor < deviation")

    def noise(self, units: int) -> tuple[Float[Array, " units"], Float[Array, ""]]:
        r"""The parameters $\lambda$ of units, and $s_{\min}$."""
        log_deviation = jnp.full(units, math.log(self.deviation - self.floor))
        return log_deviation, jnp.asarray(self.floor, log_deviation.dtype)


class InitialGradedMotoneurons(StartsNoisy, InitialMotoneurons):
    """Graded motoneurons of gain 0 (mean activation one half) with thresholds drawn from U[`low`, `high`]."""

    deviation: float = static(0.3, allowed=POSITIVE, help="the standard deviation of the noise at the start")
    floor: float = static(0.02, allowed=POSITIVE, help="the least standard deviation that learning may reach")

    def start(self, task: SizedTask | int) -> Initial:
        units = self.outputs(task)
        noise = self.noise(units)
        return lambda key: GradedMotoneurons(self.thresholds(key, units), jnp.zeros(units), *noise)


graded_motoneurons = function_of(InitialGradedMotoneurons)


class InitialGraded(StartsNoisy, InitialPolicy):
    """Graded units that act alike for every observation."""

    level: float = static(0.0, help="the mean activation at the start, for every observation")
    deviation: float = static(0.3, allowed=POSITIVE, help="the standard deviation of the noise at the start")
    floor: float = static(0.02, allowed=POSITIVE, help="the least standard deviation that learning may reach")


class InitialGradedHyperplanes(InitialLasting, InitialFeatured, InitialGraded):
    """Graded hyperplanes with zero weights: their mean is `level` for every observation."""

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        return self.lasting(self.behind(inputs, lambda seen: level_units(seen, outputs, self.level, self)))


graded_hyperplanes = function_of(InitialGradedHyperplanes)


def level_units(inputs: int, outputs: int, level: float, settings: StartsNoisy) -> GradedHyperplanes:
    """Graded hyperplanes with zero weights."""
    return GradedHyperplanes(jnp.zeros((outputs, inputs)), jnp.full(outputs, level), *settings.noise(outputs))


def normal_of(uniforms: Array) -> Array:
    """Standard normal numbers, as a function of numbers from U[0, 1)."""
    return jax.scipy.special.ndtri(jnp.maximum(uniforms, MIN_UNIFORM))


def check_floor(floor: Array) -> None:
    """Refuse a lower bound of standard deviations that is not one positive, finite number."""
    check(floor.shape == (), "floor", floor.shape, "one number")
    if not isinstance(floor, Tracer):  # a tracer has no value to check
        value = float(np.asarray(floor))
        check(0 < value < math.inf, "floor", value, "positive and finite")
