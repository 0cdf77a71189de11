"""Integration over a tick by steps of adapted length, with zero crossings located."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from timlab.compiler._bracket import Bracket
from timlab.compiler._faults import CROSSINGS, LOST, NONE, SHORT, STEPS
from timlab.compiler._integrate import MAX_STEP_PIECES
from timlab.compiler._methods import Method
from timlab.compiler._sliding import BEGUN, NEAR, free, led_to
from timlab.diagram import Seconds

MAX_STEPS_PER_TICK = 200_000  # failed ones and searches for crossings included
MAX_CROSSINGS_PER_TICK = 10_000
FEW = 32  # crossings per tick, after which those without end are looked for
MAX_SHORT_STEPS = 8  # in a row that are the shortest possible and not exact enough
UNSEEN = 8.0  # 2 where what leaves a level just ends at zero, times what the level may be misjudged by
NEVER = np.uint32(0xFFFFFFFF)  # no tick has this number
SAFETY = 0.9  # share of the step that the error allows
MIN_STEP_FACTOR = 0.2  # from step to step
MAX_STEP_FACTOR = 5.0  # from step to step


Crossed = Callable[[Array, Array], tuple[PyTree[Array], PyTree[Array]]]
"""Of the sides of all crossings, and which of them turned: the state and the modes after that."""
Flight = tuple[PyTree[Array], PyTree[Array], Array, Array, Array, Array]
"""The state, the modes, the sides and the time where crossings turned; when they had turned before; and which of them
would be reached again unseen."""


class System(Protocol):
    """A diagram within a tick. Times are in seconds since the tick."""

    def evaluate(
        self, state: PyTree[Array], modes: PyTree[Array], above: Array, shares: Array, within: Array, start: Array
    ) -> tuple[PyTree[Array], Array, Crossed]:
        """The slope of the continuous `state`; the levels of all zero crossings; and a function of which of them turned
        that returns the state and the modes after it. `shares` as in `Holds`.
        """
        ...

    slides: np.ndarray
    """Which crossings may be held, see `_sliding`."""
    rests: np.ndarray
    """Which of those are of blocks that then rest."""
    falls: np.ndarray
    """Which of those are held where they are reached from above."""

    rolled: bool
    """Whether the stages of a step are a loop, too. That is slower, but what is compiled is smaller."""
    tick: Array
    """Its number, the same for all seeds."""
    margin: Array
    """A jump this close to the end of the tick is left to the next one."""

    def next_jump(self, within: Array) -> Seconds:
        """The first time after `within` at which a source jumps; infinite if there is none."""
        ...


class Position(NamedTuple):
    """A place within a tick."""

    within: Array
    """Seconds since the tick."""
    pace: Array
    """The length of the next step, in seconds; 0 before the first."""
    state: PyTree[Array]
    modes: PyTree[Array]
    """States that change at crossings only."""
    above: Array
    """Which crossings count as not negative."""
    bracket: Bracket
    counts: tuple[Array, Array, Array, Array]
    """Attempted steps, crossings, jumps, and steps in a row that were too short."""
    holds: Any
    """`Holds`; empty before there are many crossings in the tick."""
    fault: Array
    """Why the tick could not be computed; the state is then that at the time `stuck`, in seconds since the tick."""
    stuck: Array


def begin(pace: Array, state: PyTree[Array], modes: PyTree[Array], above: Array, within: Seconds = 0.0) -> Position:
    """The position at a tick; `within` is its length where nothing moves any more."""
    zero = jnp.zeros_like(pace)
    none = jnp.zeros((), jnp.int32)
    levels = jnp.zeros(above.shape, pace.dtype)
    bracket = Bracket(zero, zero, levels, levels, none, none)
    return Position(zero + within, pace, state, modes, above, bracket, (none, none, none, none), (), none, zero)


class Attempt(NamedTuple):
    """One step that was tried, and what is known where it begins."""

    shares: Array
    levels: Array
    """Of the crossings where the step begins."""
    watched: Array | bool
    """Which crossings are looked at."""
    step: Array
    pace: Array
    """How long the step would be if nothing limited it."""
    left: Array
    """How long it may be: to `limit`, which is the next jump, if that is `inside` the tick, or the end of the tick."""
    limit: Array
    inside: Array
    searching: Array
    """Whether a crossing is searched for."""
    probing: Array
    """Whether the step only tries whether what rests would leave."""
    lost: Array
    """Whether the state or its slope is not finite, so that no step, however short, has a finite end."""
    gone: Array
    """The same, unless the state was lost before the tick: that is no new fault."""
    slope: PyTree[Array]
    new: PyTree[Array]
    """The state at the end of the step, if it is accepted."""
    final: PyTree[Array]
    """The slope there."""
    there: Array
    """The levels there."""
    size: Array
    """Of the error, as a share of the one that is tolerated."""


class Judgement(NamedTuple):
    """What follows from an attempt."""

    fine: Array
    """Whether it is exact enough."""
    forced: Array
    """Whether it is the shortest possible, and not exact enough."""
    hit: Array
    """Whether crossings turn in it."""
    lifted: Array
    """Which crossings no longer hold what rests."""
    factor: Array
    """By how much the next step is longer."""


class Change(NamedTuple):
    """What crossings change where an attempt begins."""

    state: PyTree[Array]
    modes: PyTree[Array]
    above: Array
    turned: Array
    """Whether any has turned."""
    again: Array
    """Whether the step has to be made again with other shares."""
    bracket: Bracket
    holds: Any


def advanced(
    system: System,
    method: Method,
    tolerances: tuple[float, float],
    position: Position,
    shares: Array,
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
    stepper = _Stepper(system, method, tolerances, shares, length, loop)
    if position.above.size == 0:
        return loop(lambda at: at.within < length, lambda at: stepper.turn(at, False), position)

    def has_few(at: Position) -> Array:
        return (at.within < length) & (at.counts[1] < FEW) & ~jnp.any(shares >= 0)

    # two loops: as long as nothing is held, rounds are shorter; where something may rest, every crossing is looked at
    if not system.rests.any():
        position = loop(has_few, lambda at: stepper.turn(at, False), position)
    position = position._replace(holds=free(shares))
    return loop(lambda at: at.within < length, lambda at: stepper.turn(at, True), position)


class _Stepper:
    """The rounds of the loop over a tick. With `many`, there are so many crossings that some may be held."""

    def __init__(
        self,
        system: System,
        method: Method,
        tolerances: tuple[float, float],
        shares: Array,
        length: float,
        loop: Callable[..., Any],
    ):
        self.system, self.method, self.shares, self.length, self.loop = system, method, shares, length, loop
        self.real = shares.dtype
        rounding = float(jnp.finfo(self.real).eps)
        self.relative = max(tolerances[0], 20 * rounding)
        self.absolute = tolerances[1]
        self.least = 8 * rounding * length
        self.near = max(NEAR * length, 1024 * self.least)
        self.sliding = 16 * rounding

    def turn(self, at: Position, many: bool) -> Position:
        """The position after one round."""
        attempt, crossed = self.attempted(at, many)
        judgement = self.judged(at, attempt, many)
        step, searching, probing = attempt.step, attempt.searching, attempt.probing
        fine, hit = judgement.fine, judgement.hit
        done = jnp.where(searching, hit, fine) & (~hit | (step - at.bracket.before <= 2 * self.least)) & ~probing
        longer = jnp.maximum(step * judgement.factor, jnp.where(step < attempt.pace, attempt.pace, 0.0))
        pace = jnp.where(fine, longer, step * judgement.factor)
        pace = jnp.where(searching | (hit & fine) | probing, attempt.pace, pace).astype(self.real)
        turned = jnp.asarray(False)
        after, modes, above, bracket, holds = at.state, at.modes, at.above, at.bracket, at.holds
        if at.above.size > 0:
            # crossings that have turned are applied first, without a step
            change = self.changed(at, attempt, judgement, crossed, many)
            after, modes, above, turned, again, bracket, holds = change
            done &= ~turned & ~again
            opened = ~turned & ~done & ~again & ~probing & (searching | (fine & hit))
            bracket = bracket._replace(behind=jnp.where(opened, bracket.behind, 0.0))
            pace = jnp.where(turned, 0.0, jnp.where(again, step, pace))  # begin anew: the next crossing may be close

        # what keeps the tick from being computed: the state stays where it is
        steps, events, jumps, shorts = at.counts
        shorts = jnp.where(judgement.forced & done, shorts + 1, jnp.where(done, 0, shorts))
        fault = jnp.int32(NONE)
        for kind, found in (
            (SHORT, shorts >= MAX_SHORT_STEPS),
            (STEPS, steps >= MAX_STEPS_PER_TICK),
            (CROSSINGS, events >= MAX_CROSSINGS_PER_TICK),
            (LOST, attempt.gone),
        ):
            fault = jnp.where(found, kind, fault)
        faulty = fault != NONE
        state = _chosen(done & ~faulty, attempt.new, after)
        ends = done & (step == attempt.left)
        within = jnp.where(ends, attempt.limit, jnp.where(done, at.within + step, at.within))
        within = jnp.where(faulty, self.length, within)
        counts = (steps + 1, events + ((done & hit) | turned), jumps + (ends & attempt.inside), shorts)
        stuck = jnp.where(faulty, at.within, at.stuck)
        return Position(within, pace, state, modes, above, bracket, counts, holds, fault, stuck)

    def attempted(self, at: Position, many: bool) -> tuple[Attempt, Crossed]:
        """A step, and the function of `System.evaluate` where it begins."""
        system, length, least, holds = self.system, self.length, self.least, at.holds
        start = at.within
        searched = at.above.size > 0
        probing = jnp.asarray(False)
        shares = holds.shares if many else self.shares
        if many and system.rests.any():
            probing = holds.probing
            shares = jnp.where(probing & system.rests, -1.0, shares).astype(self.real)
        slope, levels, crossed = system.evaluate(at.state, at.modes, at.above, shares, start, start)
        slope, levels = self.once((slope, levels))
        watched = holds.watched(start, least) if many else True

        jump = system.next_jump(start)
        inside = (jump > start) & (jump < length - system.margin) & (at.counts[2] < MAX_STEP_PIECES - 1)
        limit = jnp.where(inside, jump, length).astype(self.real)
        scale = self.scaled(at.state)
        position = _norm(at.state, scale)
        speed = _norm(slope, scale)
        lost = ~jnp.isfinite(position + speed)
        pace = jnp.where(at.pace > 0, at.pace, _first_pace(position, speed, length))
        if searched and many:
            least_held = jnp.where(jnp.any(holds.held) & (at.pace <= 0), BEGUN * length, 0.0)
            pace = jnp.minimum(jnp.maximum(pace, least_held), holds.longest(start, length, least))
        left = limit - start
        step = jnp.where((pace >= 0.95 * left) | lost, left, pace)
        searching = at.bracket.behind > 0
        if searched:
            step = jnp.where(searching, at.bracket.candidate(at.above, watched, least), step)

        def evaluate(there: PyTree[Array], within: Array) -> tuple[PyTree[Array], Array]:
            return system.evaluate(there, at.modes, at.above, shares, within, start)[:2]

        step, left, limit = self.once((step, left, limit))
        made = self.method.attempt(evaluate, at.state, start, step, slope, system.rolled)
        new, error, final, there = self.once(made)
        size = self.once(_norm(error, self.scaled(at.state, new)))
        gone = lost & ((start > 0) | jnp.isfinite(position))
        known = (shares, levels, watched, step, pace, left, limit, inside, searching, probing, lost, gone)
        return Attempt(*known, slope, new, final, there, size), crossed

    def judged(self, at: Position, attempt: Attempt, many: bool) -> Judgement:
        """Whether an attempt is exact enough, and what it crosses."""
        system, holds, step, size, lost = self.system, at.holds, attempt.step, attempt.size, attempt.lost
        watched, probing, there = attempt.watched, attempt.probing, attempt.there
        factor = jnp.clip(SAFETY * size ** (-1 / self.method.order), MIN_STEP_FACTOR, MAX_STEP_FACTOR)
        factor = jnp.where(jnp.isnan(size), MIN_STEP_FACTOR, factor)
        forced = ~(size <= 1) & (step <= self.least) & ~attempt.searching
        fine = (size <= 1) | (step <= self.least) | lost
        hit = jnp.asarray(False)
        lifted = jnp.zeros_like(at.above)
        rests = many and bool(system.rests.any())
        if at.above.size > 0:
            hit = jnp.any(((there >= 0) != at.above) & watched) & ~lost
        if at.above.size > 0 and (rests or not self.method.stiff):
            # halfway, by the cubic polynomial through both ends: a step must not jump over two crossings
            ends = (at.state, attempt.new, attempt.slope, attempt.final)
            place = jax.tree.map(lambda a, b, k, m: (a + b + step * (k - m) / 4) / 2, *ends)
            when = at.within + step / 2
            sides = at.above
            start = at.within
            if rests:
                # where it is tried whether something rests: at the end, with the sides that the crossings have there
                place, when = _chosen(probing, (attempt.new, at.within + step), (place, when))
                sides = jnp.where(probing & watched, there >= 0, at.above)
                start = jnp.where(probing, when, start)
            found = system.evaluate(place, at.modes, sides, attempt.shares, when, start)[1] >= 0
            if rests:
                lifted = (found != at.above) & system.rests & holds.held & probing
            if not self.method.stiff:
                twice = jnp.any((found != at.above) & watched) & ~hit & ~attempt.searching & ~probing
                twice &= (step > self.least) & ~lost
                factor = jnp.where(fine & twice, 0.5, factor)
                fine &= ~twice
        fine, hit = self.once((fine, hit))
        return Judgement(fine, forced, hit, lifted, factor)

    def changed(self, at: Position, attempt: Attempt, judgement: Judgement, crossed: Crossed, many: bool) -> Change:
        """What crossings change: those that have turned where the attempt begins, and those that are held."""
        system, holds, step, start = self.system, at.holds, attempt.step, at.within
        rests = many and bool(system.rests.any())
        slides = many and bool(system.slides.any())
        levels, there, fine = attempt.levels, attempt.there, judgement.fine
        sides = levels >= 0
        which = (sides != at.above) & attempt.watched
        turned = jnp.any(which)
        above = jnp.where(which, sides, at.above)
        again = jnp.asarray(False)
        toggled = jnp.zeros_like(above)
        if slides:
            slid, again, toggled = holds.corrected(levels, there, step, system.rests, self.sliding)
            counts = fine & ~turned & ~attempt.searching & ~attempt.probing & ~attempt.lost
            holds = _chosen(counts, slid, holds)
            again = again & counts
            toggled = toggled & counts
            probing = jnp.where(turned, holds.probing, ~attempt.probing & jnp.any(holds.held & system.rests))
            shares = jnp.where(judgement.lifted & ~turned, -1.0, holds.shares).astype(self.real)
            holds = holds._replace(tried=jnp.where(fine, holds.tried, 0), probing=probing, shares=shares)
        changed = which | toggled
        after, modes = _chosen(jnp.any(changed), crossed(above | toggled, changed), (at.state, at.modes))
        if slides:  # what slides no more is before its threshold: where that was misjudged, it turns again
            above &= ~(at.holds.held & ~holds.held & ~system.rests)
        enters = which
        if many:
            entered = which & (sides != system.falls)
            unseen = jnp.zeros_like(above)
            if rests:
                resets = entered & system.rests
                flight = (after, modes, above, start, holds.turned, unseen)
                unseen = resets & self.only_if(jnp.any(resets), self.returned, flight)[-1]
            lasts = (start, self.length, self.near)
            holds, enters = holds.reached(which, entered, unseen, *lasts, system.slides, system.rests)
        if rests:

            def rested(second: PyTree[Array]) -> PyTree[Array]:
                """The state to which resets lead that are repeated without end, after the first of them."""
                third = system.evaluate(second, at.modes, above, at.holds.shares, start, start)[2]
                return jax.tree.map(led_to, at.state, second, third(above, changed)[0])

            after = self.only_if(jnp.any(enters & system.rests), rested, after)
        zero = jnp.zeros_like(step)
        none = jnp.zeros_like(at.counts[0])
        fresh = Bracket(zero, step, levels, there, none, none)
        bracket = _chosen(attempt.searching, at.bracket.narrowed(step, judgement.hit, there), fresh)
        return Change(after, modes, above, turned, again, bracket, holds)

    def returned(self, flight: Flight) -> Flight:
        """Whether what was reached now is left so slowly, and reached again so soon, that it could not be seen: it
        would end within the rounding of the level at which it begins. So it is with a ball that keeps little speed.
        """
        system = self.system
        state, modes, above, start, turned, _ = flight

        def seen(state: PyTree[Array], within: Array) -> tuple[Array, PyTree[Array]]:
            slope, levels, _ = system.evaluate(state, modes, above, jnp.full_like(self.shares, -1), within, within)
            return levels, slope

        def rates(state: PyTree[Array], within: Array) -> tuple[Array, tuple[Array, PyTree[Array]]]:
            slope = seen(state, within)[1]
            levels, rate, _ = jax.jvp(seen, (state, within), (slope, jnp.ones_like(within)), has_aux=True)
            return rate, (levels, slope)

        slope = seen(state, start)[1]
        rate, bend, (levels, _) = jax.jvp(rates, (state, start), (slope, jnp.ones_like(start)), has_aux=True)
        sign = jnp.where(above, 1.0, -1.0)  # of levels on the side that was reached
        levels = sign * levels
        rate = sign * rate
        bend = sign * bend
        reached = (turned == start) & ~system.rests & (levels >= 0)
        unseen = reached & (rate <= 0) & (bend >= 0) & (rate**2 <= UNSEEN * levels * bend)
        return state, modes, above, start, turned, jnp.full_like(above, jnp.any(unseen))

    def scaled(self, *states: PyTree[Array]) -> PyTree[Array]:
        """The error that is tolerated for states of this size."""
        sizes = jax.tree.map(lambda *parts: functools.reduce(jnp.maximum, map(jnp.abs, parts)), *states)
        return jax.tree.map(lambda size: self.absolute + self.relative * size, sizes)

    def once(self, tree: PyTree[Array]) -> PyTree[Array]:
        """Compute once. XLA may compute a value again wherever it is used, with other roundings, and so decide one way
        for the state and another way for the time; what enters a branch is computed before it.
        """
        if self.loop is not jax.lax.while_loop:
            return tree
        zeros = lambda tree: jax.tree.map(jnp.zeros_like, tree)  # noqa: E731
        return jax.lax.cond(self.system.tick < NEVER, lambda tree: tree, zeros, tree)

    def only_if(
        self, condition: Array, function: Callable[[PyTree[Array]], PyTree[Array]], tree: PyTree[Array]
    ) -> PyTree[Array]:
        """The function of a tree where the condition holds, else the tree: for many seeds, computed only if needed."""
        return self.loop(lambda at: at[0], lambda at: (jnp.zeros((), bool), function(at[1])), (condition, tree))[1]


def _norm(tree: PyTree[Array], scale: PyTree[Array]) -> Array:
    parts = [(x / s) ** 2 for x, s in zip(jax.tree.leaves(tree), jax.tree.leaves(scale), strict=True)]
    return jnp.sqrt(sum(jnp.sum(part) for part in parts) / sum(part.size for part in parts))


def _first_pace(position: Array, speed: Array, length: float) -> Array:
    """The first step, in seconds (Hairer, Nørsett & Wanner, 1993, II.4): the state changes by about a hundredth."""
    still = (position < 1e-5) | (speed < 1e-5)
    return jnp.minimum(jnp.where(still, 1e-3 * length, 0.01 * position / jnp.where(still, 1.0, speed)), length)


def _chosen(condition: Array, new: PyTree[Array], old: PyTree[Array]) -> PyTree[Array]:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b).astype(b.dtype), new, old)
