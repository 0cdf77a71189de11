"""Integration over a tick by steps of adapted length, with zero crossings located."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.lab.compiler._integrate import MOST_PIECES
from motorgrad.lab.compiler._methods import Method

MOST_STEPS = 200_000  # per tick, failed ones and searches for crossings included
MOST_EVENTS = 1_000  # per tick; further crossings are not located
NEVER = np.uint32(0xFFFFFFFF)  # no tick has this number
BISECTED = 16  # tries by secants before a crossing is searched for by bisection
SAFETY, SMALLEST, LARGEST = 0.9, 0.2, 5.0  # of the factor from step to step


class System(Protocol):
    """A diagram within a tick. Times are in seconds since the tick."""

    def evaluate(self, state: Any, modes: Any, above: Any, within: Any, start: Any) -> tuple[Any, Any, Any]:
        """The slope of the continuous `state`; the levels of all zero crossings; and a function of which of them turned
        that returns the state and the modes after it.
        """
        ...

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

    def candidate(self, above: Any, least: float) -> Any:
        """A step between the two: the earliest zero of the straight lines through the levels."""
        width = self.behind - self.before
        crossing = (self.high >= 0) != above
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
    counts: tuple[Any, Any, Any]
    """Attempted steps, crossings and jumps."""


def begin(pace: Any, state: Any, modes: Any, above: Any) -> Position:
    """The position at a tick."""
    zero, none, levels = jnp.zeros_like(pace), jnp.zeros((), jnp.int32), jnp.zeros(above.shape, pace.dtype)
    bracket = Bracket(zero, zero, levels, levels, none, none)
    return Position(zero, pace, state, modes, above, bracket, (none, none, none))


def advanced(
    system: System,
    method: Method,
    tolerances: tuple[float, float],
    position: Position,
    length: float,
    loop: Callable[..., Any] = jax.lax.while_loop,
) -> Position:
    """The position at the end of a tick of `length` seconds.

    Every round of the loop either applies crossings that have turned, or attempts one step. A step over a crossing is
    repeated at other lengths until two of them enclose the crossing to rounding; that bracket is closed by the
    Illinois variant of the secant rule. So a crossing is as exact as the steps, and needs no interpolation.

    **Arguments:** `tolerances`: relative and absolute. `loop`: `jax.lax.while_loop`, or the same in Python.
    """
    real = position.pace.dtype
    rounding = float(jnp.finfo(real).eps)
    relative, absolute = max(tolerances[0], 20 * rounding), tolerances[1]
    least = 8 * rounding * length

    def norm(tree: Any, scale: Any) -> Any:
        parts = [(x / s) ** 2 for x, s in zip(jax.tree.leaves(tree), jax.tree.leaves(scale), strict=True)]
        return jnp.sqrt(sum(jnp.sum(part) for part in parts) / sum(part.size for part in parts))

    def once(tree: Any) -> Any:
        """Compute once. XLA may compute a value again wherever it is used, with other roundings, and so decide one way
        for the state and another way for the time; what enters a branch is computed before it.
        """
        if loop is not jax.lax.while_loop:
            return tree
        nothing = lambda tree: jax.tree.map(jnp.zeros_like, tree)  # noqa: E731
        return jax.lax.cond(system.tick < NEVER, lambda tree: tree, nothing, tree)

    def turn(at: Position) -> Position:
        s, searched = at.within, at.above.size > 0
        slope, levels, crossed = system.evaluate(at.state, at.modes, at.above, s, s)
        slope, levels = once((slope, levels))
        steps, events, jumps = at.counts

        # the step
        jump = system.next_jump(s)
        inside = (jump > s) & (jump < length - system.margin) & (jumps < MOST_PIECES - 1)
        limit = jnp.where(inside, jump, length).astype(real)
        scale = jax.tree.map(lambda x: absolute + relative * jnp.abs(x), at.state)
        position, speed = norm(at.state, scale), norm(slope, scale)
        lost = ~jnp.isfinite(position + speed)  # no step, however short, has a finite end
        pace = jnp.where(at.pace > 0, at.pace, _first_pace(position, speed, length))
        left = limit - s
        step = jnp.where((pace >= 0.95 * left) | lost, left, pace)
        searching = at.bracket.behind > 0
        if searched:
            step = jnp.where(searching, at.bracket.candidate(at.above, least), step)
        evaluate = lambda there, within: system.evaluate(there, at.modes, at.above, within, s)[:2]  # noqa: E731
        step, left, limit = once((step, left, limit))
        new, error, final, there = once(method.attempt(evaluate, at.state, s, step, slope))

        # its length
        larger = jax.tree.map(lambda a, b: absolute + relative * jnp.maximum(jnp.abs(a), jnp.abs(b)), at.state, new)
        size = norm(error, larger)
        size = once(size)
        factor = jnp.clip(SAFETY * size ** (-1 / method.order), SMALLEST, LARGEST)
        factor = jnp.where(jnp.isnan(size), SMALLEST, factor)
        fine = (size <= 1) | (step <= least) | lost
        hit = jnp.any((there >= 0) != at.above) & (events < MOST_EVENTS) & ~lost if searched else jnp.asarray(False)
        if searched and not method.stiff:
            # halfway, by the cubic polynomial through both ends: a step must not jump over two crossings
            middle = jax.tree.map(lambda a, b, k, m: (a + b + step * (k - m) / 4) / 2, at.state, new, slope, final)
            twice = jnp.any((evaluate(middle, s + step / 2)[1] >= 0) != at.above) & ~hit & ~searching & (step > least)
            factor = jnp.where(fine & twice & ~lost, 0.5, factor)
            fine &= ~twice | lost
        fine, hit = once((fine, hit))
        done = jnp.where(searching, hit, fine) & (~hit | (step - at.bracket.before <= 2 * least))
        next = jnp.where(fine, jnp.maximum(step * factor, jnp.where(step < pace, pace, 0.0)), step * factor)
        next = jnp.where(searching | (hit & fine), pace, next).astype(real)

        # crossings that have turned are applied first, without a step
        after, modes, above, turned = at.state, at.modes, at.above, jnp.asarray(False)
        bracket = at.bracket
        if searched:
            sides = levels >= 0
            turned = jnp.any(sides != at.above) & (events < 2 * MOST_EVENTS)
            after, modes = _chosen(turned, crossed(sides, sides != at.above), (at.state, at.modes))
            above = jnp.where(turned, sides, at.above)
            done &= ~turned
            opened = ~turned & ~done & (searching | (fine & hit))
            zero, none = jnp.zeros_like(step), jnp.zeros_like(steps)
            fresh = Bracket(zero, step, levels, there, none, none)
            bracket = _chosen(searching, at.bracket.narrowed(step, hit, there), fresh)
            bracket = bracket._replace(behind=jnp.where(opened, bracket.behind, 0.0))
            next = jnp.where(turned, 0.0, next)  # begin anew: the next crossing may be close
        state = _chosen(done, new, after)
        ends = done & (step == left)
        within = jnp.where(ends, limit, jnp.where(done, s + step, s))
        spent = steps >= MOST_STEPS
        state = jax.tree.map(lambda x: jnp.where(spent, jnp.nan, x), state)
        counts = (steps + 1, events + ((done & hit) | turned), jumps + (ends & inside))
        return Position(jnp.where(spent, length, within), next, state, modes, above, bracket, counts)

    return loop(lambda at: at.within < length, turn, position)


def _first_pace(position: Any, speed: Any, length: float) -> Any:
    """The first step, in seconds (Hairer, Nørsett & Wanner, 1993, II.4): the state changes by about a hundredth."""
    still = (position < 1e-5) | (speed < 1e-5)
    return jnp.minimum(jnp.where(still, 1e-3 * length, 0.01 * position / jnp.where(still, 1.0, speed)), length)


def _chosen(condition: Any, new: Any, old: Any) -> Any:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b).astype(b.dtype), new, old)
