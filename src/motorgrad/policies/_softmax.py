"""A discrete choice among several alternatives."""

from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from motorgrad._errors import check
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._featured import InitialFeatured
from motorgrad.policies._parameters import in_structure, with_fields
from motorgrad.policies._policy import Policy
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

    def _logits(self, observation: Float[Array, " inputs"]) -> Float[Array, " actions"]:
        return jnp.sum(self.weights * observation, axis=-1)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " actions"]:
        logits = self._logits(observation)
        if self.outputs == 2:  # one exponential instead of two: the logistic of the difference is the same softmax
            second = jax.nn.sigmoid(logits[1] - logits[0])
            return jnp.stack([1 - second, second])
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

    def fisher_coordinates(
        self, observation: Float[Array, " inputs"], action: Int[Array, ""]
    ) -> Float[Array, " actions"]:
        r"""$2\sqrt\pi$, coordinates in which the distance of distributions is Euclidean."""
        return 2 * jnp.exp(0.5 * jax.nn.log_softmax(self._logits(observation)))

    def with_temperature(self, factor: float | Float[Array, ""]) -> Self:
        return with_fields(self, weights=self.weights / factor)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        log_p = jax.nn.log_softmax(self._logits(observation))
        return -jnp.sum(jnp.exp(log_p) * log_p)

    def enumerate(self) -> Int[Array, " actions"]:
        return jnp.arange(self.outputs, dtype=jnp.int32)


class InitialSoftmax(InitialFeatured):
    """A softmax policy with zero weights: all actions are equally probable."""

    units: int | None = count(None, 1, help="the number of actions to choose from, by default the task's")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        return self.behind(inputs, lambda seen: Softmax(jnp.zeros((outputs, seen))))


softmax = function_of(InitialSoftmax)
