"""Crossings without end: what happens where a crossing is reached again and again, in ever shorter times.

There are three kinds of them:

- A block that is reset there comes to *rest* (Zeno's paradox: a bouncing ball): its state is held where the resets lead
  to. It is free again as soon as a step without holding it leaves the condition that resets it.
- A block with two modes *slides*: it is held between them by the share of each that keeps the crossing at zero, which
  is Filippov's solution (1988). The share is constant in a step and found by secants, so that the crossing is at zero
  at the step's end.
- Any other crossing *chatters*: it is looked at again only after a while, up to a hundredth of the tick, and the run
  tells.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

MANY = 3  # intervals in a row that are nearly zero, before a crossing counts as one without end
MORE = 32  # the same, of a crossing that may be what another block is reset by
NEAR = 1e-6  # of a tick: what counts as nearly zero
PIECES = 16  # steps of a tick, at least, while something is held
BEGUN = 1e-4  # of a tick: the first step in which something is held, long enough for the change to be seen
DWELL = 1 / 100  # of a tick: how long a chattering crossing is not looked at, at most
FIRST = 1e-3  # of what is nearly zero: how long it is not looked at for the first time
MAX_SHARES_TRIED = 4  # in one step
TRIED = 0.25  # how far the first two shares differ that a secant goes through


class Holds(NamedTuple):
    """What is held, for each crossing."""

    shares: Array
    """The share of the present mode, from 0 to 1; −1 where the block is free."""
    last: Array
    """When it was last reached, from the side from which it may be held, in seconds since the tick."""
    turned: Array
    """When it last turned, to either side."""
    quick: Array
    """How many intervals in a row were nearly zero."""
    until: Array
    """When a chattering crossing is looked at again, in seconds since the tick; −1 where it does not chatter."""
    dwells: Array
    """How long it was not looked at the last time, in seconds."""
    gains: Array
    """How fast the crossing changes with the share, per second; 0 while unknown."""
    before: Array
    """The share that was tried before."""
    missed: Array
    """Where that led at the end of the step."""
    tried: Array
    """How many shares were tried in this step."""
    probing: Array
    """Whether the next step only tries whether what rests would leave."""

    @property
    def held(self) -> Array:
        """Which blocks are held."""
        return self.shares >= 0

    def chatter(self, length: float) -> Array:
        """1 + the number of a crossing that chatters, for longer than roundings do; 0 where there is none."""
        chatters = self.dwells >= DWELL * length
        return jnp.where(jnp.any(chatters), jnp.argmax(chatters) + 1, 0).astype(jnp.int32)

    def watched(self, within: Array, least: float) -> Array:
        """Which crossings are looked at."""
        return ~self.held & (self.until <= within + least)

    def longest(self, within: Array, length: float, least: float) -> Array:
        """How long a step may be."""
        waits = self.until > within + least
        free = jnp.where(jnp.any(self.held), length / PIECES, length)
        return jnp.minimum(free, jnp.min(jnp.where(waits, self.until - within, length), initial=length))

    def reached(
        self,
        turned: Array,
        entered: Array,
        unseen: Array,
        within: Array,
        length: float,
        near: float,
        slides: np.ndarray,
        rests: np.ndarray,
    ) -> tuple["Holds", Array]:
        """After crossings have `turned`. **Returns** which of them begin to be held, too.

        **Arguments:** `entered`: those that turned to the side to which they may be held; `unseen`: of them, those that
        would be reached again after a time too short to be seen.
        """
        close = within - self.last <= near
        quick = jnp.where(entered, jnp.where(close, self.quick + 1, 0), self.quick)
        many = jnp.where(within - self.last <= near / 4, 1, MANY)  # the next interval may be too short to be seen
        enters = entered & slides & ((quick >= many) | unseen)
        chatters = turned & ~slides & ((quick >= MORE) | (self.until >= 0))
        zero = jnp.zeros_like(self.shares)
        # at first as short as roundings last, at which a crossing may turn to and fro too
        dwells = jnp.clip(4 * self.dwells, near * FIRST, DWELL * length)
        after = self._replace(
            shares=jnp.where(enters, jnp.where(rests, 0.0, 0.5), self.shares).astype(zero.dtype),
            last=jnp.where(entered, within, self.last),
            turned=jnp.where(turned, within, self.turned),
            quick=jnp.where(enters, 0, quick),
            until=jnp.where(chatters, within + dwells, self.until).astype(zero.dtype),
            dwells=jnp.where(chatters, dwells, self.dwells).astype(zero.dtype),
            gains=jnp.where(enters, 0.0, self.gains).astype(zero.dtype),
            probing=self.probing | jnp.any(enters & rests),
            tried=jnp.where(jnp.any(enters), 0, self.tried),
        )
        return after, enters

    def corrected(
        self, begins: Array, levels: Array, step: Array, rests: np.ndarray, tolerance: float
    ) -> tuple["Holds", Array, Array]:
        """After a step that `begins` at some levels and ends at others. **Returns** also whether it must be made again,
        and which blocks slide no more because they turn to the other mode.
        """
        sliding = self.held & ~rests
        known = (self.gains != 0) | (self.tried > 0)
        secant = (levels - self.missed) / ((self.shares - self.before) * step)
        fresh = (self.tried > 0) & (jnp.abs(self.shares - self.before) > 1e-3)
        gains = jnp.where(sliding & fresh, secant, self.gains)
        stays = self.shares - (levels - begins) / (gains * step)  # the share with which the levels do not change
        zeroed = jnp.clip(self.shares - levels / (gains * step), 0, 1)
        wanted = jnp.where(known, zeroed, self.shares + jnp.where(self.shares > 0.5, -TRIED, TRIED))
        change = jnp.abs(wanted - self.shares)
        lost = self.tried >= MAX_SHARES_TRIED
        leaves = sliding & known & ~((stays >= 0) & (stays <= 1) & ~(lost & (change > TRIED)))
        again = sliding & (~known | leaves | ((change > tolerance) & ~lost))
        repeated = jnp.any(again)
        after = self._replace(
            shares=jnp.where(leaves, -1.0, jnp.where(again, wanted, self.shares)).astype(self.shares.dtype),
            gains=gains.astype(self.gains.dtype),
            before=jnp.where(sliding, self.shares, self.before),
            missed=jnp.where(sliding, levels, self.missed),
            tried=jnp.where(repeated & ~jnp.any(leaves), self.tried + 1, 0),
        )
        return after, repeated, leaves & (stays < 0)


def free(shares: Array) -> Holds:
    """What is held at a tick: these shares."""
    none = jnp.zeros(shares.shape, jnp.int32)
    real = jnp.zeros_like(shares)
    away = jnp.full_like(shares, -1)
    last = jnp.full_like(shares, -jnp.inf)
    return Holds(shares, last, last, none, away, real, real, real, real, jnp.zeros((), jnp.int32), jnp.any(shares >= 0))


def led_to(first: Array, second: Array, third: Array) -> Array:
    """Where a sequence with these first elements ends if its differences shrink by a factor (Aitken, 1926)."""
    bend = third - 2 * second + first
    end = jnp.where(bend == 0, second, first - (second - first) ** 2 / jnp.where(bend == 0, 1.0, bend))
    # exactly 0 rather than a rounding: what moves by a rounding does not rest
    return jnp.where(jnp.abs(end) <= 16 * jnp.finfo(end.dtype).eps * jnp.abs(second - first), 0.0, end)
