"""Batches of decisions that are used several times."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt32

from motorgrad._branching import Flag, Scalar, where
from motorgrad.learning._gradients import empty_rows
from motorgrad.policies import Policy


class Batch(NamedTuple):
    r"""The decisions of a batch, of which the first `waiting` are filled in.

    `error` is the part of each advantage that the actions before share, `newest` the part of its own action alone, both
    in units of (scaled) reward; after an `end` another episode began. `key` draws the order in which the decisions are
    used.
    """

    observations: Float[Array, "batch inputs"]
    actions: Array
    error: Float[Array, " batch"]
    newest: Float[Array, " batch"]
    end: Bool[Array, " batch"]
    waiting: Int[Array, ""]
    key: UInt32[Array, " words"]

    @classmethod
    def empty(cls, policy: Policy, size: int, key: jax.Array) -> "Batch":
        """A batch of this size without decisions."""
        seen, done = empty_rows(policy, size)
        numbers = jnp.zeros(size, seen.dtype)
        words = jax.random.key_data(key)
        return cls(seen, done, numbers, numbers, jnp.zeros(size, bool), jnp.zeros((), jnp.int32), words)

    def add(self, seen: Array, action: Array, error: Array, newest: Array | int, dropped: Flag = False) -> "Batch":
        """The batch with one more decision; what is to be `dropped` is written, too, and overwritten by the next."""

        def put(rows: Array, row: Array | bool | int) -> Array:
            # There is room: an update has emptied what was full.
            return rows.at[self.waiting].set(jnp.asarray(row, rows.dtype))

        return self._replace(
            observations=put(self.observations, seen),
            actions=put(self.actions, action),
            error=put(self.error, error),
            newest=put(self.newest, newest),
            end=put(self.end, False),
            waiting=where(dropped, self.waiting, self.waiting + 1),
        )

    def restart(self) -> "Batch":
        """The batch where an episode ends with the newest decision."""
        newest = jnp.arange(len(self.end)) == self.waiting - 1
        return self._replace(end=self.end | newest)

    def emptied(self) -> "Batch":
        """The batch after it was used."""
        key = jax.random.key_data(jax.random.fold_in(jax.random.wrap_key_data(self.key), 1))
        return self._replace(waiting=jnp.zeros_like(self.waiting), key=key)

    def advantages(self, decay: Scalar, standardise: bool) -> Float[Array, " batch"]:
        r"""The advantage of every decision, $A_t = \delta_t + \beta A_{t+1}$ with the `decay` $\beta$. To `standardise`
        them gives them the mean 0 and the deviation 1; equal ones become 0."""

        def back(later: Array, decision: tuple[Array, Array]) -> tuple[Array, Array]:
            error, end = decision
            total = (error + jnp.where(end, 0, decay * later)).astype(error.dtype)
            return total, total

        nothing = jnp.zeros((), self.error.dtype)
        found = jax.lax.scan(back, nothing, (self.error, self.end), reverse=True)[1] + self.newest
        if not standardise:
            return found
        spread = jnp.std(found)
        # of equal numbers, deviations and their spread are rounding, and would be standardised to 1
        flat = (jnp.max(found) == jnp.min(found)) | (spread == 0)
        return jnp.where(flat, 0, (found - jnp.mean(found)) / jnp.where(flat, 1, spread))

    def order(self, epochs: int, minibatches: int) -> Int[Array, "steps size"]:
        """The places of the decisions in the batch, shuffled for each epoch, those of one step in each row."""
        keys = jax.random.split(jax.random.wrap_key_data(self.key), epochs)
        drawn = jax.vmap(lambda key: jax.random.permutation(key, len(self.end)))(keys)
        return drawn.reshape(epochs * minibatches, -1)
