"""Policies that also choose what they see next (active learning)."""

from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._binary import BinaryUnits
from motorgrad.policies._policy import Policy, fixed, trainable


class Querying(Policy):
    r"""A policy of one input that also asks which input it shall see next: the more often, the less it is sure there
    (section 4.4.1 of the thesis).

    The last number of an action is the query. The interval from `low` to `high` is cut in cells; a cell is drawn in
    proportion to the entropy $\mathcal H$ of `policy` at its middle, and the query uniformly within it. A share
    `explore` of the queries is uniform over the interval instead, so that none of it is forgotten.

    The query depends on the parameters, but counts as chosen by the task: it is no part of the log-probability, the
    score and the entropy, which are those of `policy`. Learning then maximises the reward at the inputs that are asked
    for.

    **Arguments:** `policy`, a pool of binary units with one input; `low` and `high`; `explore`, from 0 to 1; `cells`,
    how many, from 1 to 10,000.
    """

    policy: BinaryUnits
    low: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.0)
    high: Float[Array, ""] = fixed(converter=jnp.asarray, default=1.0)
    explore: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.1)
    cells: int = eqx.field(static=True, default=32)

    def __check_init__(self) -> None:
        check(isinstance(self.policy, BinaryUnits), "policy", type(self.policy).__name__, "a pool of binary units")
        check(self.policy.inputs == 1, "policy.inputs", self.policy.inputs, "1")
        check(1 <= self.cells <= 10_000, "cells", self.cells, "from 1 to 10,000")
        if not any(isinstance(value, Tracer) for value in (self.low, self.high, self.explore)):
            low, high, share = (float(np.asarray(value)) for value in (self.low, self.high, self.explore))
            check(low < high, "low, high", (low, high), "an interval, low < high")
            check(0 <= share <= 1, "explore", share, "in [0, 1]")

    @property
    def actions(self) -> str:
        return "querying"

    @property
    def inputs(self) -> int:
        return self.policy.inputs

    @property
    def outputs(self) -> int:
        return self.policy.outputs + 1

    @property
    def uniforms(self) -> int:
        return self.policy.uniforms + 1

    def chances(self) -> Float[Array, " cells"]:
        """The probability of each cell of being asked for."""
        middle = (jnp.arange(self.cells) + 0.5) / self.cells
        entropy = jax.vmap(self.policy.entropy)((self.low + (self.high - self.low) * middle)[:, None])
        total = jnp.sum(entropy)
        certain = total <= 0  # everywhere: nothing is more worth asking for than anything else
        share = jnp.where(certain, 1 / self.cells, entropy / jnp.where(certain, 1, total))
        return self.explore / self.cells + (1 - self.explore) * share

    def query(self, uniform: Float[Array, ""]) -> Float[Array, ""]:
        """The input that is asked for, as a function of a number from U[0, 1)."""
        ends = jnp.cumsum(self.chances())
        target = uniform * ends[-1]
        cell = jnp.minimum(jnp.sum(target >= ends), self.cells - 1)
        start = jnp.where(cell > 0, ends[cell - 1], 0)
        inside = (target - start) / jnp.maximum(ends[cell] - start, jnp.finfo(ends.dtype).tiny)
        return self.low + (self.high - self.low) * (cell + jnp.clip(inside, 0, 1)) / self.cells

    def prob(self, observation: Float[Array, " 1"]) -> Float[Array, " units"]:
        """Each unit's probability of firing; nothing for the query."""
        return self.policy.prob(observation)

    def sample(self, observation: Float[Array, " 1"], uniforms: Float[Array, " units+1"]) -> Float[Array, " units+1"]:
        return self._with(self.policy.sample(observation, uniforms[:-1]), self.query(uniforms[-1]))

    def mode(self, observation: Float[Array, " 1"]) -> Float[Array, " units+1"]:
        """The most probable action, and the middle of the cell that is most often asked for."""
        middle = (jnp.argmax(self.chances()) + 0.5) / self.cells
        return self._with(self.policy.mode(observation), self.low + (self.high - self.low) * middle)

    @staticmethod
    def _with(action: Float[Array, " units"], query: Float[Array, ""]) -> Float[Array, " units+1"]:
        return jnp.append(action, query.astype(action.dtype))

    def log_prob(self, observation: Float[Array, " 1"], action: Float[Array, " units+1"]) -> Float[Array, ""]:
        return self.policy.log_prob(observation, action[:-1])

    def score(self, observation: Float[Array, " 1"], action: Float[Array, " units+1"]) -> Self:
        inner = self.policy.score(observation, action[:-1])
        return eqx.tree_at(lambda each: each.policy, trainable(self), inner)

    def blocks(self, gradient: Self) -> tuple[Float[Array, "units parameters"], ...]:
        return self.policy.blocks(gradient.policy)

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        return eqx.tree_at(lambda each: each.policy, trainable(self), self.policy.from_blocks(blocks))

    def fisher(
        self, observation: Float[Array, " 1"], action: Float[Array, " units+1"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        return self.policy.fisher(observation, action[:-1])

    def allowed(self, step: Any) -> Any:
        return eqx.tree_at(lambda each: each.policy, step, self.policy.allowed(step.policy))

    def limited(self) -> Self:
        return eqx.tree_at(lambda each: each.policy, self, self.policy.limited())

    def entropy(self, observation: Float[Array, " 1"]) -> Float[Array, ""]:
        return self.policy.entropy(observation)

    def enumerate(self) -> Array:
        raise ValueError("Querying: has infinitely many actions: the query is a real number; enumerate its policy's")
