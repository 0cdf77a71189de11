r"""Sums over the decisions of a batch, which many policies find by products of matrices."""

from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad.policies._parameters import Parametric, parts_of

if TYPE_CHECKING:
    from motorgrad.policies._policy import Policy


@runtime_checkable
class BatchSums(Protocol):
    """A policy that adds up scores and entropies of many decisions at a time, which is quicker."""

    def score_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, "decisions sums"]
    ) -> Any:
        r"""$\sum_t w_{tk} s_t$, in the structure of `trainable(self)`, with a leading axis of the sums $k$."""
        ...

    def entropy_sum(self, observations: Float[Array, "decisions inputs"]) -> Float[Array, ""]:
        """The sum of the entropies at many observations, in nats."""
        ...


def sums_batches(policy: Parametric) -> bool:
    """Whether a policy, and all policies that it is made of, add up many decisions at a time."""
    return isinstance(policy, BatchSums) and all(map(sums_batches, parts_of(policy)))


def score_sum(
    policy: "Policy",
    observations: Float[Array, "decisions inputs"],
    actions: Array,
    weights: Float[Array, "decisions sums"],
) -> PyTree[Array]:
    r"""$\sum_t w_{tk} s_t$, weighted sums of the scores of many decisions, in the structure of `trainable(policy)` with
    a leading axis of the sums: as the policy adds them, else `score_sum_one_by_one`."""
    if isinstance(policy, BatchSums):
        return policy.score_sum(observations, actions, weights)
    return score_sum_one_by_one(policy, observations, actions, weights)


def score_sum_one_by_one(
    policy: "Policy",
    observations: Float[Array, "decisions inputs"],
    actions: Array,
    weights: Float[Array, "decisions sums"],
) -> PyTree[Array]:
    """The weighted sums of the scores of many decisions, one decision after the other, for any policy."""

    def add(total: PyTree, decision: tuple[Array, ...]) -> tuple[PyTree, None]:
        observation, action, weight = decision
        score = policy.score(observation, action)
        spread = [weight.reshape(-1, *(1,) * leaf.ndim) * leaf for leaf in jax.tree.leaves(score)]
        return [jnp.add(sum_, more).astype(sum_.dtype) for sum_, more in zip(total, spread, strict=True)], None

    shapes, structure = jax.tree.flatten(jax.eval_shape(policy.score, observations[0], actions[0]))
    zeros = [jnp.zeros((weights.shape[1], *shape.shape), shape.dtype) for shape in shapes]
    return jax.tree.unflatten(structure, jax.lax.scan(add, zeros, (observations, actions, weights))[0])


def entropy_sum(policy: "Policy", observations: Float[Array, "decisions inputs"]) -> Float[Array, ""]:
    """The sum of a policy's entropies at many observations, in nats."""
    if isinstance(policy, BatchSums):
        return policy.entropy_sum(observations)
    return jnp.sum(jax.lax.map(policy.entropy, observations))
