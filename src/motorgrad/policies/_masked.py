"""A pool of fixed size of which only some units are there."""

from typing import Any, Self, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from motorgrad._errors import check
from motorgrad.policies._binary import BinaryUnits
from motorgrad.policies._policy import fixed, has_rows, trainable

T = TypeVar("T")


class Masked(BinaryUnits):
    r"""A pool some of whose units are switched off, by a mask that is data.

    A unit that is off never fires, its score and Fisher matrix are zero, and no ascent rule moves its parameters, by
    decay neither. The others are as without it. The arrays keep their shapes, so units may be switched on and off
    within one compiled loop, differently for each seed (section 6.4.3 of the thesis). For pools that grow between
    trainings, at no cost for units that are not there yet, see `grow`.

    An action in which a unit fires that is off has the probability 0, and `enumerate` lists it all the same.

    **Arguments:** `pool`, of independent units each of which has parameters of its own; `active`, `(units,)`, true for
    the units that are there, by default all.
    """

    pool: BinaryUnits
    active: Bool[Array, " units"] = fixed(default=None)

    def __init__(self, pool: BinaryUnits, active: Any = None):
        check(isinstance(pool, BinaryUnits), "pool", type(pool).__name__, "a pool of binary units")
        own = pool.independent and has_rows(pool)
        check(own, "pool", type(pool).__name__, "a pool of independent units with parameters of their own")
        active = jnp.ones(pool.outputs, bool) if active is None else jnp.asarray(active)
        check(active.dtype == bool, "active", active.dtype.name, "true or false for each unit")
        check(active.shape == (pool.outputs,), "active", active.shape, f"of shape {(pool.outputs,)}")
        self.pool, self.active = pool, active

    @property
    def inputs(self) -> int:
        return self.pool.inputs

    @property
    def outputs(self) -> int:
        return self.pool.outputs

    def _only(self, tree: T) -> T:
        """What belongs to units that are there; zero for the others."""
        return jax.tree.map(lambda x: jnp.where(self.active.reshape(-1, *(1,) * (x.ndim - 1)), x, 0), tree)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return self._only(self.pool.prob(observation))

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        impossible = jnp.where(action > 0, -jnp.inf, 0)
        return jnp.where(self.active, self.pool.log_probs(observation, action), impossible)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        inner = self._only(self.pool.score(observation, action))
        return eqx.tree_at(lambda each: each.pool, trainable(self), inner)

    def blocks(self, gradient: Any) -> tuple[Float[Array, "units parameters"], ...]:
        return self.pool.blocks(gradient.pool)

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        return eqx.tree_at(lambda each: each.pool, trainable(self), self.pool.from_blocks(blocks))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """The pool's, and zero for the units that are not there."""
        return self._only(self.pool.fisher(observation, action))

    def allowed(self, step: Any) -> Any:
        return eqx.tree_at(lambda each: each.pool, step, self._only(self.pool.allowed(step.pool)))

    def limited(self) -> Self:
        return eqx.tree_at(lambda each: each.pool, self, self.pool.limited())
