"""The search for a zero crossing between two lengths of a step."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

BISECTED = 16  # tries by secants before a crossing is searched for by bisection


class Bracket(NamedTuple):
    """Two lengths of a step that enclose a crossing, and the levels of all crossings there."""

    before: Array
    behind: Array
    """0 where no crossing is searched for."""
    low: Array
    high: Array
    replaced: Array
    """Which end was replaced last: 1 `behind`, −1 `before`."""
    tries: Array

    def candidate(self, above: Array, watched: Array | bool, least: float) -> Array:
        """A step between the two: the earliest zero of the straight lines through the levels that are `watched`."""
        width = self.behind - self.before
        crossing = ((self.high >= 0) != above) & watched
        ratio = self.low / jnp.where(crossing, self.low - self.high, 1.0)
        ratio = jnp.min(jnp.where(crossing, ratio, 1.0))
        ratio = jnp.where((self.tries >= BISECTED) | ~jnp.isfinite(ratio), 0.5, ratio)
        inside = jnp.clip(self.before + ratio * width, self.before + least, self.behind - least)
        return jnp.where(width <= 2 * least, self.behind, inside)

    def narrowed(self, step: Array, hit: Array, levels: Array) -> "Bracket":
        """With `step` as one end: the one behind the crossing if it was `hit`. An end that stays for a second time has
        its levels halved, which is the Illinois rule.
        """
        side = jnp.where(hit, 1, -1)
        factor = jnp.where(side == self.replaced, 0.5, 1.0)
        return Bracket(
            jnp.where(hit, self.before, step),
            jnp.where(hit, step, self.behind),
            jnp.where(hit, self.low * factor, levels),
            jnp.where(hit, levels, self.high * factor),
            side,
            self.tries + 1,
        )
