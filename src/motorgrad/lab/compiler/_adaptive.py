"""Integration over a tick by steps of adapted length, with zero crossings located."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.lab.compiler._faults import CROSSINGS, LOST, NONE, SHORT, STEPS
from motorgrad.lab.compiler._integrate import MOST_PIECES
from motorgrad.lab.compiler._methods import Method
from motorgrad.lab.compiler._sliding import BEGUN, NEAR, free, led_to

MOST_STEPS = 200_000  # per tick, failed ones and searches for crossings included
MOST_EVENTS = 10_000  # crossings per tick
FEW = 32  # crossings per tick, after which those without end are looked for
MOST_SHORT = 8  # steps in a row that are the shortest possible and not exact enough
NEVER = np.uint32(0xFFFFFFFF)  # no tick has this number
BISECTED = 16  # tries by secants before a crossing is searched for by bisection
SAFETY = 0.9  # share of the step that the error allows
SMALLEST = 0.2  # factor from step to step
LARGEST = 5.0  # factor from step to step


class System(Protocol):
    """A diagram within a tick. Times are in seconds since the tick."""

    def evaluate(
        self, state: Any, modes: Any, above: Any, shares: Any, within: Any, start: Any
    ) -> tuple[Any, Any, Any]:
        """The slope of the continuous `state`; the levels of all zero crossings; and a function of which of them turned
        that returns the state and the modes after it. `shares` as in `Holds`.
        """
        ...

    slides: np.ndarray
    """Which crossings may be held, see `_sliding`."""
    rests: np.ndarray
    """Which of those are of blocks that then rest."""

    rolled: bool
    """Whether the stages of a step are a loop, too. That is slower, but what is compiled is smaller."""
    tick: Any
    """Its number, the same for all seeds."""
    margin: Any
    """A jump this close to the end of the tick is left to the next one."""

    def next_jump(self, within: Any) -> Any:
        """The first time after `within` at which a source jumps; infinite if there is none."""


class Bracket(NamedTuple):
    """Two lengths of a step that enclose a crossing, and the levels of all crossings there."""

    before: Any
    behind: Any
    """0 where no crossing is searched for."""
    low: Any
    high: Any
    replaced: Any
    """Which end was replaced last: 1 `behind`, −1 `before`."""
    tries: Any

    def candidate(self, above: Any, watched: Any, least: float) -> Any:
        """A step between the two: the earliest zero of the straight lines through the levels that are `watched`."""
        width = self.behind - self.before
        crossing = ((self.high >= 0) != above) & watched
        ratio = self.low / jnp.where(crossing, self.low - self.high, 1.0)
        ratio = jnp.min(jnp.where(crossing, ratio, 1.0))
        ratio = jnp.where((self.tries >= BISECTED) | ~jnp.isfinite(ratio), 0.5, ratio)
        inside = jnp.clip(self.before + ratio * width, self.before + least, self.behind - least)
        return jnp.where(width <= 2 * least, self.behind, inside)

    def narrowed(self, step: Any, hit: Any, levels: Any) -> "Bracket":
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


class Position(NamedTuple):
    """A place within a tick."""

    within: Any
    """Seconds since the tick."""
    pace: Any
    """The length of the next step, in seconds; 0 before the first."""
    state: Any
    modes: Any
    """States that change at crossings only."""
    above: Any
    """Which crossings count as not negative."""
    bracket: Bracket
    counts: tuple[Any, Any, Any, Any]
    """Attempted steps, crossings, jumps, and steps in a row that were too short."""
    holds: Any
    """`Holds`; empty before there are many crossings in the tick."""
    fault: Any
    """Why the tick could not be computed; the state is then that at the time `stuck`, in seconds since the tick."""
    stuck: Any


def begin(pace: Any, state: Any, modes: Any, above: Any, within: Any = 0.0) -> Position:
    """The position at a tick; `within` is its length where nothing moves any more."""
    zero, none, levels = jnp.zeros_like(pace), jnp.zeros((), jnp.int32), jnp.zeros(above.shape, pace.dtype)
    bracket = Bracket(zero, zero, levels, levels, none, none)
    return Position(zero + within, pace, state, modes, above, bracket, (none, none, none, none), (), none, zero)


def advanced(
    system: System,
    method: Method,
    tolerances: tuple[float, float],
    position: Position,
    shares: Any,
    length: float,
    loop: Callable[..., Any] = jax.lax.while_loop,
) -> Position:
    """The position at the end of a tick of `length` seconds.

    Every round of the loop either applies crossings that have turned, or attempts one step. A step over a crossing is
    repeated at other lengths until two of them enclose the crossing to rounding; that bracket is closed by the
    Illinois variant of the secant rule. So a crossing is as exact as the steps, and needs no interpolation.

    **Arguments:** `tolerances`: relative and absolute. `shares`: of what is held at the tick, see `Holds`. `loop`:
    `jax.lax.while_loop`, or the same in Python.
    """
    real = position.pace.dtype
    rounding = float(jnp.finfo(real).eps)
    relative, absolute = max(tolerances[0], 20 * rounding), tolerances[1]
    least = 8 * rounding * length
    begins = shares
    near, sliding = max(NEAR * length, 1024 * least), 16 * rounding

    def norm(tree: Any, scale: Any) -> Any:
        parts = [(x / s) ** 2 for x, s in zip(jax.tree.leaves(tree), jax.tree.leaves(scale), strict=True)]
        return jnp.sqrt(sum(jnp.sum(part) for part in parts) / sum(part.size for part in parts))

    def once(tree: Any) -> Any:
        """Compute once. XLA may compute a value again wherever it is used, with other roundings, and so decide one way
        for the state and another way for the time; what enters a branch is computed before it.
        """
        if loop is not jax.lax.while_loop:
            return tree
        return jax.lax.cond(
            system.tick < NEVER, lambda tree: tree, lambda tree: jax.tree.map(jnp.zeros_like, tree), tree
        )

    def only_if(condition: Any, function: Callable[[Any], Any], tree: Any) -> Any:
        """The function of a tree where the condition holds, else the tree: for many seeds, computed only if needed."""
        return loop(lambda at: at[0], lambda at: (jnp.zeros((), bool), function(at[1])), (condition, tree))[1]

    def turn(at: Position, many: bool) -> Position:
        s, searched, holds = at.within, at.above.size > 0, at.holds
        rests, slides = many and bool(system.rests.any()), many and bool(system.slides.any())
        probing = holds.probing if rests else jnp.asarray(False)
        shares = holds.shares if many else begins
        shares = jnp.where(probing & system.rests, -1.0, shares).astype(real) if rests else shares
        slope, levels, crossed = system.evaluate(at.state, at.modes, at.above, shares, s, s)
        slope, levels = once((slope, levels))
        steps, events, jumps, shorts = at.counts
        watched = holds.watched(s, least) if many else True

        # the step
        jump = system.next_jump(s)
        inside = (jump > s) & (jump < length - system.margin) & (jumps < MOST_PIECES - 1)
        limit = jnp.where(inside, jump, length).astype(real)
        scale = jax.tree.map(lambda x: absolute + relative * jnp.abs(x), at.state)
        position, speed = norm(at.state, scale), norm(slope, scale)
        lost = ~jnp.isfinite(position + speed)  # no step, however short, has a finite end
        pace = jnp.where(at.pace > 0, at.pace, _first_pace(position, speed, length))
        if searched and many:
            least_held = jnp.where(jnp.any(holds.held) & (at.pace <= 0), BEGUN * length, 0.0)
            pace = jnp.minimum(jnp.maximum(pace, least_held), holds.longest(s, length, least))
        left = limit - s
        step = jnp.where((pace >= 0.95 * left) | lost, left, pace)
        searching = at.bracket.behind > 0
        if searched:
            step = jnp.where(searching, at.bracket.candidate(at.above, watched, least), step)

        def evaluate(there: Any, within: Any) -> Any:
            return system.evaluate(there, at.modes, at.above, shares, within, s)[:2]

        step, left, limit = once((step, left, limit))
        new, error, final, there = once(method.attempt(evaluate, at.state, s, step, slope, system.rolled))

        # its length
        larger = jax.tree.map(lambda a, b: absolute + relative * jnp.maximum(jnp.abs(a), jnp.abs(b)), at.state, new)
        size = norm(error, larger)
        size = once(size)
        factor = jnp.clip(SAFETY * size ** (-1 / method.order), SMALLEST, LARGEST)
        factor = jnp.where(jnp.isnan(size), SMALLEST, factor)
        forced = ~(size <= 1) & (step <= least) & ~searching
        fine = (size <= 1) | (step <= least) | lost
        hit = jnp.any(((there >= 0) != at.above) & watched) & ~lost if searched else jnp.asarray(False)
        lifted = jnp.zeros_like(at.above)
        if searched and (rests or not method.stiff):
            # halfway, by the cubic polynomial through both ends: a step must not jump over two crossings
            middle = jax.tree.map(lambda a, b, k, m: (a + b + step * (k - m) / 4) / 2, at.state, new, slope, final)
            place, when, sides, start = middle, s + step / 2, at.above, s
            if rests:
                # where it is tried whether something rests: at the end, with the sides that the crossings have there
                place, when = _chosen(probing, (new, s + step), (place, when))
                sides, start = jnp.where(probing & watched, there >= 0, at.above), jnp.where(probing, when, s)
            found = system.evaluate(place, at.modes, sides, shares, when, start)[1] >= 0
            if rests:
                lifted = (found != at.above) & system.rests & holds.held & probing
            twice = jnp.any((found != at.above) & watched) & ~hit & ~searching & ~probing & (step > least)
            twice &= not method.stiff
            factor = jnp.where(fine & twice & ~lost, 0.5, factor)
            fine &= ~twice | lost
        fine, hit = once((fine, hit))
        done = jnp.where(searching, hit, fine) & (~hit | (step - at.bracket.before <= 2 * least)) & ~probing
        next = jnp.where(fine, jnp.maximum(step * factor, jnp.where(step < pace, pace, 0.0)), step * factor)
        next = jnp.where(searching | (hit & fine) | probing, pace, next).astype(real)

        # crossings that have turned are applied first, without a step
        after, modes, above, turned = at.state, at.modes, at.above, jnp.asarray(False)
        bracket = at.bracket
        which = jnp.zeros_like(above)
        if searched:
            sides = levels >= 0
            which = (sides != at.above) & watched
            turned = jnp.any(which)
            above = jnp.where(which, sides, at.above)
            again, toggled = jnp.asarray(False), jnp.zeros_like(above)
            if slides:
                slid, again, toggled = holds.corrected(levels, there, step, system.rests, sliding)
                counts = fine & ~turned & ~searching & ~probing & ~lost
                holds, again, toggled = _chosen(counts, slid, holds), again & counts, toggled & counts
                holds = holds._replace(tried=jnp.where(fine, holds.tried, 0))
                holds = holds._replace(
                    probing=jnp.where(turned, holds.probing, ~probing & jnp.any(holds.held & system.rests))
                )
                holds = holds._replace(shares=jnp.where(lifted & ~turned, -1.0, holds.shares).astype(real))
            changed = which | toggled
            after, modes = _chosen(jnp.any(changed), crossed(above | toggled, changed), (at.state, at.modes))
            enters = which
            if many:
                rising = which & sides
                holds, enters = holds.reached(which, rising, s, length, near, system.slides, system.rests)
            if rests:
                after = only_if(jnp.any(enters & system.rests), lambda tree: rested(at, above, changed, s, tree), after)
            done &= ~turned & ~again
            opened = ~turned & ~done & ~again & ~probing & (searching | (fine & hit))
            zero, none = jnp.zeros_like(step), jnp.zeros_like(steps)
            fresh = Bracket(zero, step, levels, there, none, none)
            bracket = _chosen(searching, at.bracket.narrowed(step, hit, there), fresh)
            bracket = bracket._replace(behind=jnp.where(opened, bracket.behind, 0.0))
            next = jnp.where(turned, 0.0, jnp.where(again, step, next))  # begin anew: the next crossing may be close

        # what keeps the tick from being computed: the state stays where it is
        shorts = jnp.where(forced & done, shorts + 1, jnp.where(done, 0, shorts))
        gone = lost & ((s > 0) | jnp.isfinite(position))  # a state that was lost before is no new fault
        kinds = (
            (LOST, gone),
            (CROSSINGS, events >= MOST_EVENTS),
            (STEPS, steps >= MOST_STEPS),
            (SHORT, shorts >= MOST_SHORT),
        )
        kind = jnp.int32(NONE)
        for number, found in reversed(kinds):
            kind = jnp.where(found, number, kind)
        faulty = kind != NONE
        state = _chosen(done & ~faulty, new, after)
        ends = done & (step == left)
        within = jnp.where(ends, limit, jnp.where(done, s + step, s))
        within = jnp.where(faulty, length, within)

        counts = (steps + 1, events + ((done & hit) | turned), jumps + (ends & inside), shorts)
        return Position(within, next, state, modes, above, bracket, counts, holds, kind, jnp.where(faulty, s, at.stuck))

    def rested(at: Position, above: Any, changed: Any, s: Any, second: Any) -> Any:
        """The state to which resets lead that are repeated without end, after the first of them."""
        crossed = system.evaluate(second, at.modes, above, at.holds.shares, s, s)[2]
        return jax.tree.map(led_to, at.state, second, crossed(above, changed)[0])

    if position.above.size == 0:
        return loop(lambda at: at.within < length, lambda at: turn(at, False), position)

    def has_few(at: Position) -> Any:
        return (at.within < length) & (at.counts[1] < FEW) & ~jnp.any(shares >= 0)

    position = loop(has_few, lambda at: turn(at, False), position)._replace(holds=free(shares))
    return loop(lambda at: at.within < length, lambda at: turn(at, True), position)


def _first_pace(position: Any, speed: Any, length: float) -> Any:
    """The first step, in seconds (Hairer, Nørsett & Wanner, 1993, II.4): the state changes by about a hundredth."""
    still = (position < 1e-5) | (speed < 1e-5)
    return jnp.minimum(jnp.where(still, 1e-3 * length, 0.01 * position / jnp.where(still, 1.0, speed)), length)


def _chosen(condition: Any, new: Any, old: Any) -> Any:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b).astype(b.dtype), new, old)
