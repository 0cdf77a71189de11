"""Pools of independent binary units: the contract, sigmoid units, hyperplanes and motoneurons."""

import abc
from collections.abc import Sequence
from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import xlog1py, xlogy
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._featured import InitialFeatured
from motorgrad.policies._parameters import (
    in_structure,
    outer,
    outer_sum,
    per_unit,
    shared_outer_sum,
    with_fields,
)
from motorgrad.policies._policy import Units, has_rows
from motorgrad.policies._products import weighted
from motorgrad.policies._starting import Initial, InitialPolicy, check_interval, function_of
from motorgrad.schema import kind_of, static


class BinaryUnits(Units):
    r"""A pool of $N$ units that fire independently with probabilities $p_i(y)$.

    An action is a vector of $N$ zeros and ones, in the floating type of the parameters. Its log-probability is the sum
    over the units, and its score the concatenation of the units' scores (section 4.2.1 of the thesis).

    A subclass defines `inputs`, `outputs`, `prob` and `score`.
    """

    @property
    def independent(self) -> bool:
        """Whether the units fire independently of each other, given the observation."""
        return True

    @property
    def separate(self) -> bool:
        """Whether each unit has parameters of its own that no other unit uses."""
        return has_rows(self)

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " units"]) -> Float[Array, " units"]:
        p = self.prob(observation)
        return (uniforms < p).astype(p.dtype)

    def mode(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """1 for each unit that fires with probability above one half."""
        p = self.prob(observation)
        return (p > 0.5).astype(p.dtype)

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        p = self.prob(observation)
        return jnp.where(action > 0, jnp.log(p), jnp.log1p(-p))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        r"""Exact: $p\,s_1s_1' + (1 - p)\,s_0s_0'$ for the scores of firing $s_1$ and of silence $s_0$.

        As their mean is 0, this is $p(1 - p)(s_1 - s_0)(s_1 - s_0)'$. Units that share parameters use the sample $ss'$.
        """
        if not has_rows(self):
            return abilities.sampled_fisher(self, observation, action)
        return (outer(self._fisher_rows(observation)),)

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        own = type(self).fisher is BinaryUnits.fisher and has_rows(self)
        if not own:
            return abilities.fisher_sum_one_by_one(self, observations, actions, weights)
        rows = jax.vmap(self._fisher_rows)(observations)
        return (outer_sum(jnp.sqrt(weights)[:, None, None] * rows),)

    def fisher_coordinates(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> Float[Array, " coordinates"]:
        r"""Probabilities of independent units, $p/\sqrt{p(1 - p)}$, whose denominators are held constant."""
        if not self.independent:
            return self.log_prob(observation, action)[None]
        p = self.prob(observation)
        variance = p * (1 - p)
        return p * jax.lax.stop_gradient(
            jnp.where(variance > 0, jax.lax.rsqrt(jnp.where(variance > 0, variance, 1)), 0)
        )

    def _fisher_rows(self, observation: Float[Array, " inputs"]) -> Float[Array, "units parameters"]:
        """The rows whose outer products are the Fisher matrices."""
        p = self.prob(observation)
        (fire,), (silent,) = (self.blocks(self.score(observation, jnp.full_like(p, a))) for a in (1.0, 0.0))
        return jnp.sqrt(p * (1 - p))[:, None] * (fire - silent)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return entropy_of(self.prob(observation))

    def enumerate(self) -> Float[Array, "actions units"]:
        """All $2^N$ firing patterns; the bit of the last unit changes fastest."""
        codes = np.arange(2**self.outputs)[:, None] >> np.arange(self.outputs - 1, -1, -1)
        return jnp.asarray(codes & 1, jnp.result_type(float))


class SigmoidUnits(BinaryUnits):
    r"""Units that fire with probability $\sigma(\phi_i(y))$, where $\phi$ is a potential.

    The score is $\nabla \log \pi = (A - p)\,\nabla\phi$ for the action $A \in \{0, 1\}$ (appendix A.1 of the thesis).

    A subclass defines `inputs`, `outputs`, `potential` and `potential_gradient`.
    """

    @abc.abstractmethod
    def potential(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        r"""$\phi_i(y)$."""

    @abc.abstractmethod
    def potential_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        r"""$\partial\phi_i/\partial\theta$ for every trainable field, by field name. Units lead."""

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jax.nn.sigmoid(self.potential(observation))

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        # log σ of the signed potential stays finite and exact in the far tails, where log p does not.
        return jax.nn.log_sigmoid((2 * action - 1) * self.potential(observation))

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        surprise = action - self.prob(observation)
        gradient = self.potential_gradient(observation)
        return in_structure(self, **{name: per_unit(surprise, slope) * slope for name, slope in gradient.items()})

    def fisher_coordinates(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> Float[Array, " units"]:
        r"""$\sqrt{p(1 - p)}\,\phi$, whose factors are held constant."""
        potential = self.potential(observation)
        spread = jnp.exp(0.5 * (jax.nn.log_sigmoid(potential) + jax.nn.log_sigmoid(-potential)))
        return jax.lax.stop_gradient(spread) * potential

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return _logistic_entropy(self.potential(observation))


class Hyperplanes(SigmoidUnits):
    r"""Units that fire on one side of a soft linear boundary, with probability $p_i = \sigma(w_i \cdot y + b_i)$.

    Score: $\partial_w = (A - p)\,y$ and $\partial_b = A - p$ (equation 5.1 of the thesis).

    **Arguments:** `weights` of shape `(units, inputs)` and `bias` of shape `(units,)`.
    """

    weights: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    bias: Float[Array, " units"] = eqx.field(converter=jnp.asarray)

    def __check_init__(self) -> None:
        check(self.weights.ndim == 2, "weights", self.weights.shape, "of shape (units, inputs)")
        check(self.bias.shape == self.weights.shape[:1], "bias", self.bias.shape, f"of shape {self.weights.shape[:1]}")

    @property
    def inputs(self) -> int:
        return self.weights.shape[1]

    @property
    def outputs(self) -> int:
        return self.weights.shape[0]

    def potential(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return weighted(self.weights, observation) + self.bias

    def potential_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        return {"weights": jnp.broadcast_to(observation, self.weights.shape), "bias": jnp.ones_like(self.bias)}

    @property
    def _usual(self) -> bool:
        """Whether scores and Fisher matrices are those of this class: what is computed of many decisions at once."""
        kind = type(self)
        own = kind.score, kind.fisher, kind.potential_gradient
        return own == (SigmoidUnits.score, BinaryUnits.fisher, Hyperplanes.potential_gradient)

    def score_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, "decisions sums"]
    ) -> Self:
        if not self._usual:
            return abilities.score_sum_one_by_one(self, observations, actions, weights)
        credited = weights.T[:, :, None] * (actions - jax.nn.sigmoid(self.potential(observations)))
        slopes = jnp.einsum("ktu,ti->kui", credited, observations)
        return in_structure(self, weights=slopes, bias=credited.sum(1))

    def entropy_sum(self, observations: Float[Array, "decisions inputs"]) -> Float[Array, ""]:
        return _logistic_entropy(self.potential(observations))

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        if not self._usual:
            return super().fisher_sum(observations, actions, weights)
        p = jax.nn.sigmoid(self.potential(observations))
        shared = jnp.concatenate([observations, jnp.ones_like(observations[:, :1])], axis=1)
        return (shared_outer_sum(weights[:, None] * p * (1 - p), shared),)

    def with_temperature(self, factor: float | Float[Array, ""]) -> Self:
        return with_fields(self, weights=self.weights / factor, bias=self.bias / factor)


class Motoneurons(SigmoidUnits):
    r"""Motoneurons with a threshold and a gain on one common input, $p_i = \sigma(k_i (y - y^*_i))$.

    Score: $\partial_{y^*} = -(A - p)\,k$ and $\partial_k = (A - p)(y - y^*)$ (section 4.2.2 of the thesis).

    **Arguments:** `threshold` $y^*$ and `gain` $k$, both of shape `(units,)`. A unit of negative gain fires below its
    threshold.
    """

    threshold: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    gain: Float[Array, " units"] = eqx.field(converter=jnp.asarray)

    def __check_init__(self) -> None:
        check(self.threshold.ndim == 1, "threshold", self.threshold.shape, "of shape (units,)")
        check(self.gain.shape == self.threshold.shape, "gain", self.gain.shape, f"of shape {self.threshold.shape}")

    @property
    def inputs(self) -> int:
        return 1

    @property
    def outputs(self) -> int:
        return self.threshold.shape[0]

    def potential(self, observation: Float[Array, " 1"]) -> Float[Array, " units"]:
        return self.gain * (observation[0] - self.threshold)

    def potential_gradient(self, observation: Float[Array, " 1"]) -> dict[str, Array]:
        return {"threshold": -self.gain, "gain": observation[0] - self.threshold}

    def with_temperature(self, factor: float | Float[Array, ""]) -> Self:
        return with_fields(self, gain=self.gain / factor)


class InitialHyperplanes(InitialFeatured):
    """Hyperplanes with zero weights: every unit fires with probability one half, the maximum of entropy."""

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        return self.behind(inputs, lambda seen: zero_hyperplanes(seen, outputs))


hyperplanes = function_of(InitialHyperplanes)


def zero_hyperplanes(inputs: int, outputs: int) -> Hyperplanes:
    """Hyperplanes with zero weights."""
    return Hyperplanes(np.zeros((outputs, inputs)), np.zeros(outputs))


class InitialMotoneurons(InitialPolicy):
    """Motoneurons of gain 0 with thresholds drawn from U[`low`, `high`] (section 4.3.1 of the thesis)."""

    low: float = static(0.0, help="the lower end of the range of the thresholds")
    high: float = static(1.0, help="its upper end")

    def validate(self) -> None:
        super().validate()
        check_interval(self.low, self.high)

    def outputs(self, task: SizedTask | int) -> int:
        """The number of units. **Raises** `ValueError`, naming the policy, unless there is exactly one input."""
        inputs, outputs = sizes(task, self.units)
        if inputs != 1 and not isinstance(task, int):
            named = f"task {getattr(task, 'name', type(task).__name__)!r} has {inputs} observed numbers"
            raise ValueError(f"policy = {kind_of(self)!r}: {named}, a motoneuron has a single input")
        check(inputs == 1, "inputs", inputs, "1: a motoneuron has a single input")
        return outputs

    def thresholds(self, key: jax.Array, units: int) -> Float[Array, " units"]:
        """The thresholds of a seed."""
        return jax.random.uniform(key, (units,), minval=self.low, maxval=self.high)

    def start(self, task: SizedTask | int) -> Initial:
        units = self.outputs(task)
        return lambda key: Motoneurons(self.thresholds(key, units), jnp.zeros(units))


motoneurons = function_of(InitialMotoneurons)


def _logistic_entropy(potential: Float[Array, "*decisions units"]) -> Float[Array, ""]:
    r"""The sum of the entropies of all units that fire with probability $\sigma(\phi)$, in nats."""
    return jnp.sum(jax.nn.softplus(potential) - potential * jax.nn.sigmoid(potential))


def entropy_of(p: Float[Array, " units"]) -> Float[Array, ""]:
    """Entropy in nats of units that fire independently with probabilities `p`."""
    unsure = (p > 0) & (p < 1)
    p = jnp.where(unsure, p, 0.5)  # at 0 and 1 the derivative of the formula is NaN; it has to be 0
    return -jnp.sum(jnp.where(unsure, xlogy(p, p) + xlog1py(1 - p, -p), 0))


def product(lists: Sequence[Float[Array | np.ndarray, "actions units"]]) -> Float[Array, "actions units"]:
    """The Cartesian product of lists of actions, concatenated; the last list changes fastest."""
    places = np.indices([len(each) for each in lists]).reshape(len(lists), -1)
    return jnp.concatenate([each[place] for each, place in zip(lists, places, strict=True)], axis=1)
