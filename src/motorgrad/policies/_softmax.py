"""A discrete choice among several alternatives."""

from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._featured import InitialFeatured
from motorgrad.policies._parameters import in_structure, shared_outer_sum, with_fields
from motorgrad.policies._policy import Policy
from motorgrad.policies._products import weighted
from motorgrad.policies._starting import Initial, function_of
from motorgrad.schema import count


class Softmax(Policy):
    r"""One of $K$ actions with probability $\pi_k \propto \exp(\theta_k \cdot y)$ (Baxter & Bartlett, 2001, eq. 25).

    An action is an integer scalar in 0 … K − 1, drawn with a single number from U[0, 1) by inversion of the cumulative
    distribution. Score: $\partial_{\theta_k} = (\mathbb 1[a = k] - \pi_k)\,y$.

    **Arguments:** `weights` $\theta$ of shape `(actions, inputs)`.
    """

    weights: Float[Array, "actions inputs"] = eqx.field(converter=jnp.asarray)

    def __check_init__(self) -> None:
        check(self.weights.ndim == 2, "weights", self.weights.shape, "of shape (actions, inputs)")

    @property
    def inputs(self) -> int:
        return self.weights.shape[1]

    @property
    def outputs(self) -> int:
        return self.weights.shape[0]

    @property
    def uniforms(self) -> int:
        return 1

    def _logits(self, observation: Float[Array, "*decisions inputs"]) -> Float[Array, "*decisions actions"]:
        return weighted(self.weights, observation)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " actions"]:
        return self._probs(self._logits(observation))

    def _probs(self, logits: Float[Array, "*decisions actions"]) -> Float[Array, "*decisions actions"]:
        if self.outputs == 2:  # one exponential instead of two: the logistic of the difference is the same softmax
            second = jax.nn.sigmoid(logits[..., 1] - logits[..., 0])
            return jnp.stack([1 - second, second], axis=-1)
        return jax.nn.softmax(logits)

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " 1"]) -> Int[Array, ""]:
        # Without the last entry: rounding may leave the cumulative sum below 1, and no comparison is needed there.
        cumulative = jnp.cumsum(self.prob(observation))[:-1]
        return jnp.sum(uniforms[0] >= cumulative, dtype=jnp.int32)

    def mode(self, observation: Float[Array, " inputs"]) -> Int[Array, ""]:
        return jnp.argmax(self._logits(observation)).astype(jnp.int32)

    def log_prob(self, observation: Float[Array, " inputs"], action: Int[Array, ""]) -> Float[Array, ""]:
        return jax.nn.log_softmax(self._logits(observation))[action]

    def score(self, observation: Float[Array, " inputs"], action: Int[Array, ""]) -> Self:
        chosen = (jnp.arange(self.outputs) == action).astype(self.weights.dtype)
        return in_structure(self, weights=(chosen - self.prob(observation))[:, None] * observation)

    def fisher(
        self, observation: Float[Array, " inputs"], action: Int[Array, ""]
    ) -> tuple[Float[Array, "one parameters parameters"], ...]:
        r"""Exact: $(\operatorname{diag}\pi - \pi\pi')\otimes yy'$, in the order of `weights`. It is singular."""
        p = self.prob(observation)
        among = jnp.diag(p) - p[:, None] * p
        return (jnp.kron(among, observation[:, None] * observation)[None],)

    def score_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, "decisions sums"]
    ) -> Self:
        if type(self).score is not Softmax.score:
            return abilities.score_sum_one_by_one(self, observations, actions, weights)
        chosen = (actions[:, None] == jnp.arange(self.outputs)).astype(self.weights.dtype)
        credited = weights.T[:, :, None] * (chosen - self._probs(self._logits(observations)))
        return in_structure(self, weights=jnp.einsum("ktu,ti->kui", credited, observations))

    def entropy_sum(self, observations: Float[Array, "decisions inputs"]) -> Float[Array, ""]:
        return _entropy(self._logits(observations))

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "one parameters parameters"], ...]:
        if type(self).fisher is not Softmax.fisher:
            return abilities.fisher_sum_one_by_one(self, observations, actions, weights)
        p = self._probs(self._logits(observations))
        among = p[:, :, None] * (jnp.eye(self.outputs, dtype=p.dtype) - p[:, None, :])
        pairs = shared_outer_sum(weights[:, None] * among.reshape(len(p), -1), observations)
        blocks = pairs.reshape(self.outputs, self.outputs, self.inputs, self.inputs)
        return (jnp.swapaxes(blocks, 1, 2).reshape(1, self.weights.size, self.weights.size),)

    def fisher_coordinates(
        self, observation: Float[Array, " inputs"], action: Int[Array, ""]
    ) -> Float[Array, " actions"]:
        r"""$2\sqrt\pi$, coordinates in which the distance of distributions is Euclidean."""
        return 2 * jnp.exp(0.5 * jax.nn.log_softmax(self._logits(observation)))

    def with_temperature(self, factor: float | Float[Array, ""]) -> Self:
        return with_fields(self, weights=self.weights / factor)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return _entropy(self._logits(observation))

    def enumerate(self) -> Int[Array, " actions"]:
        return jnp.arange(self.outputs, dtype=jnp.int32)


def _entropy(logits: Float[Array, "*decisions actions"]) -> Float[Array, ""]:
    """The sum of the entropies of all decisions, in nats."""
    log_p = jax.nn.log_softmax(logits)
    return -jnp.sum(jnp.exp(log_p) * log_p)


class InitialSoftmax(InitialFeatured):
    """A softmax policy with zero weights: all actions are equally probable."""

    units: int | None = count(None, 1, help="the number of actions to choose from, by default the task's")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        return self.behind(inputs, lambda seen: Softmax(jnp.zeros((outputs, seen))))


softmax = function_of(InitialSoftmax)
