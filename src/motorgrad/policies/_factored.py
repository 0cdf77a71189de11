"""A policy made of pools of units of any kinds."""

import itertools
from typing import Any, Self

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._binary import BinaryUnits, product
from motorgrad.policies._policy import trainable


class Factored(BinaryUnits):
    r"""Independent pools side by side on one observation: $\log\pi = \sum_k \log\pi_k$.

    The action is the concatenation of the pools' actions, the score that of their scores (section 4.2.1 of the thesis);
    pools of different kinds may be mixed (section 6.5.2). A `Factored` policy is itself a pool, so it nests.

    **Arguments:** `pools`, a sequence of at least one pool of binary units over observations of one length.
    """

    pools: tuple[BinaryUnits, ...] = eqx.field(converter=tuple)

    def __check_init__(self) -> None:
        check(len(self.pools) > 0, "pools", self.pools, "at least one pool of units")
        kinds = [type(pool).__name__ for pool in self.pools]
        check(all(isinstance(pool, BinaryUnits) for pool in self.pools), "pools", kinds, "pools of binary units")
        sizes = {pool.inputs for pool in self.pools}
        check(len(sizes) == 1, "pools", sorted(sizes), "over observations of one length")

    @property
    def inputs(self) -> int:
        return self.pools[0].inputs

    @property
    def outputs(self) -> int:
        return sum(pool.outputs for pool in self.pools)

    @property
    def uniforms(self) -> int:
        return sum(pool.uniforms for pool in self.pools)

    @property
    def independent(self) -> bool:
        return all(pool.independent for pool in self.pools)

    @property
    def separate(self) -> bool:
        return all(pool.separate for pool in self.pools)

    def _parts(self, action: Float[Array, " units"]) -> list[Float[Array, " _"]]:
        ends = itertools.accumulate((pool.outputs for pool in self.pools), initial=0)
        return [action[start:end] for start, end in itertools.pairwise(ends)]

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jnp.concatenate([pool.prob(observation) for pool in self.pools])

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " units"]) -> Float[Array, " units"]:
        parts = zip(self.pools, self._parts(uniforms), strict=True)
        return jnp.concatenate([pool.sample(observation, part) for pool, part in parts])

    def mode(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jnp.concatenate([pool.mode(observation) for pool in self.pools])

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        parts = zip(self.pools, self._parts(action), strict=True)
        return jnp.concatenate([pool.log_probs(observation, part) for pool, part in parts])

    def log_prob(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, ""]:
        parts = zip(self.pools, self._parts(action), strict=True)
        return sum((pool.log_prob(observation, part) for pool, part in parts), start=jnp.zeros(()))

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        parts = zip(self.pools, self._parts(action), strict=True)
        scores = tuple(pool.score(observation, part) for pool, part in parts)
        return eqx.tree_at(lambda policy: policy.pools, trainable(self), scores)

    def blocks(self, gradient: Any) -> tuple[Float[Array, "units parameters"], ...]:
        """The pools' blocks, in the order of the pools."""
        parts = zip(self.pools, gradient.pools, strict=True)
        return tuple(block for pool, part in parts for block in pool.blocks(part))

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        rest, gradients = iter(blocks), []
        for pool in self.pools:
            count = len(pool.blocks(trainable(pool)))
            gradients.append(pool.from_blocks(tuple(itertools.islice(rest, count))))
        return eqx.tree_at(lambda policy: policy.pools, trainable(self), tuple(gradients))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """The pools' Fisher matrices: between independent units the Fisher matrix is zero."""
        parts = zip(self.pools, self._parts(action), strict=True)
        return tuple(matrix for pool, part in parts for matrix in pool.fisher(observation, part))

    def limited(self) -> Self:
        return eqx.tree_at(lambda policy: policy.pools, self, tuple(pool.limited() for pool in self.pools))

    def allowed(self, step: Any) -> Any:
        parts = zip(self.pools, step.pools, strict=True)
        return eqx.tree_at(lambda policy: policy.pools, step, tuple(pool.allowed(part) for pool, part in parts))

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return sum((pool.entropy(observation) for pool in self.pools), start=jnp.zeros(()))

    def enumerate(self) -> Float[Array, "actions units"]:
        """Every joint action: those of the last pool change fastest."""
        return product([pool.enumerate() for pool in self.pools])
