r"""The Fisher matrix of any policy: as blocks, one for each unit with parameters of its own, and as coordinates."""

from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from motorgrad.policies._parameters import Parametric, from_rows, outer, rows, trainable
from motorgrad.policies.abilities._delegation import ActsByAnother

if TYPE_CHECKING:
    from motorgrad.policies._policy import Policy

P = TypeVar("P", bound=Parametric)


@runtime_checkable
class UnitBlocks(Protocol):
    """A policy with units that have parameters of their own."""

    def blocks(self, gradient: Any) -> tuple[Float[Array, "units parameters"], ...]:
        """Flatten a gradient to matrices that have one row for each unit with parameters of its own.

        A pool of binary units whose trainable arrays all have a leading axis of units returns one row per unit. A
        policy made of several pools returns one matrix per pool.
        """
        ...

    def from_blocks(self, blocks: tuple[Float[Array | np.ndarray, "units parameters"], ...]) -> Any:
        """The inverse of `blocks`: a gradient with the structure of `trainable(self)`."""
        ...


@runtime_checkable
class FisherMatrices(Protocol):
    """A policy that knows more of its Fisher matrix than a sample."""

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        r"""The Fisher matrix $\mathbb E[ss']$ of each row $s$ of `blocks`, at one observation.

        Binary units and softmax compute the expectation over the unit's own action exactly.
        """
        ...


@runtime_checkable
class FisherSum(Protocol):
    """A policy that adds up its Fisher matrices at several decisions at a time, which is quicker."""

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        r"""$\sum_t w_t\,F_t$, the sum of the matrices of `fisher` at many decisions, with weights of at least 0."""
        ...


@runtime_checkable
class FisherCoordinates(Protocol):
    """A policy with numbers whose derivatives make up its Fisher matrix."""

    def fisher_coordinates(self, observation: Float[Array, " inputs"], action: Array) -> Float[Array, " coordinates"]:
        r"""Numbers $c(\theta)$ whose derivatives $J = \partial c/\partial\theta$ make up the Fisher matrix at one
        observation, $F = \mathbb E[J'J]$. What only scales is held constant."""
        ...


def blocks(policy: Any, gradient: PyTree) -> tuple[Float[Array, "units parameters"], ...]:
    """Flatten a gradient to matrices that have one row for each unit with parameters of its own; to a single row, for
    a policy that does not know better."""
    return policy.blocks(gradient) if isinstance(policy, UnitBlocks) else (rows(gradient, 1),)


def from_blocks(policy: P, blocks: tuple[Float[Array | np.ndarray, "units parameters"], ...]) -> P:
    """The inverse of `blocks`: a gradient with the structure of `trainable(policy)`."""
    if isinstance(policy, UnitBlocks):
        return policy.from_blocks(blocks)
    return from_rows(trainable(policy), blocks[0])


def fisher(
    policy: "Policy", observation: Float[Array, " inputs"], action: Array
) -> tuple[Float[Array, "units parameters parameters"], ...]:
    r"""The Fisher matrix $\mathbb E[ss']$ of each row $s$ of `blocks`, at one observation: as far as the policy knows
    it, else `sampled_fisher`."""
    if isinstance(policy, FisherMatrices):
        return policy.fisher(observation, action)
    return sampled_fisher(policy, observation, action)


def sampled_fisher(
    policy: "Policy", observation: Float[Array, " inputs"], action: Array
) -> tuple[Float[Array, "units parameters parameters"], ...]:
    r"""The sample $ss'$ of the Fisher matrices for the drawn `action`, an unbiased estimate for any policy."""
    return tuple(outer(block) for block in blocks(policy, policy.score(observation, action)))


def fisher_sum(
    policy: "Policy",
    observations: Float[Array, "decisions inputs"],
    actions: Array,
    weights: Float[Array, " decisions"],
) -> tuple[Float[Array, "units parameters parameters"], ...]:
    r"""$\sum_t w_t\,F_t$, the sum of the matrices of `fisher` at many decisions, with weights of at least 0: as the
    policy adds them, else `fisher_sum_one_by_one`."""
    if isinstance(policy, FisherSum):
        return policy.fisher_sum(observations, actions, weights)
    return fisher_sum_one_by_one(policy, observations, actions, weights)


def fisher_sum_one_by_one(
    policy: "Policy",
    observations: Float[Array, "decisions inputs"],
    actions: Array,
    weights: Float[Array, " decisions"],
) -> tuple[Float[Array, "units parameters parameters"], ...]:
    """The sum of the Fisher matrices at many decisions, one decision after the other, for any policy."""

    def add(total: tuple[Array, ...], decision: tuple[Array, ...]) -> tuple[tuple[Array, ...], None]:
        observation, action, weight = decision
        matrices = fisher(policy, observation, action)
        return tuple(sum_ + weight * matrix for sum_, matrix in zip(total, matrices, strict=True)), None

    matrices = jax.eval_shape(lambda *decision: fisher(policy, *decision), observations[0], actions[0])
    zeros = tuple(jnp.zeros(matrix.shape, matrix.dtype) for matrix in matrices)
    return jax.lax.scan(add, zeros, (observations, actions, weights))[0]


def fisher_coordinates(
    policy: "Policy", observation: Float[Array, " inputs"], action: Array
) -> Float[Array, " coordinates"]:
    r"""Numbers $c(\theta)$ whose derivatives $J = \partial c/\partial\theta$ make up the Fisher matrix at one
    observation, $F = \mathbb E[J'J]$.

    So $Fv$ takes two products with derivatives, by automatic differentiation, and no matrix (Pearlmutter, 1994). Units
    that know their Fisher matrix give coordinates that do not depend on the drawn `action`. For any other policy it is
    the log-probability: $J'J$ is the sample $ss'$, an unbiased estimate.
    """
    if isinstance(policy, FisherCoordinates):
        return policy.fisher_coordinates(observation, action)
    if isinstance(policy, ActsByAnother):
        return fisher_coordinates(policy.acting(observation), policy.seen(observation), action)
    return policy.log_prob(observation, action)[None]
