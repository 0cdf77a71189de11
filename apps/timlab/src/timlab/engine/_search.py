"""Find the block and the time at which a compiled run ceased to be sound."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from timlab.compiler import LOST, NONE, Carry, Continuous, Loop, Values
from timlab.diagram import Problem
from timlab.engine._compiled import Compiled
from timlab.engine._fault import RunFault, finite, limit_reached, not_finite, worst
from timlab.engine._state import states_of


def first_unsound(run: Compiled, loop: Loop, before: Carry, first: int, ticks: int) -> tuple[int, Carry, Carry]:
    """Which of these ticks was the first that was not sound, by bisection; and the states before and after it."""
    values, seeds = run.values, run.seeds
    there = before
    low = 0
    high = ticks
    while high - low > 1:
        middle = (low + high) // 2
        after, seen, whole = loop.advance(values, there, seeds, first + low, middle - low)
        if not run.sound(after, seen, whole):
            high = middle
        else:
            low, there = middle, after
    return first + low, there, loop.advance(values, there, seeds, first + low, 1)[0]


def fault_at(run: Compiled, tick: int, before: Carry, after: Carry) -> RunFault | None:
    """The fault of a tick that is not sound, given the states before and after it."""
    several = len(run.seeds) > 1
    kinds = np.asarray(after.fault["kind"]) if after.fault else np.zeros(len(run.seeds), int)
    rows = np.flatnonzero(kinds != NONE)
    chosen = rows[:1] if len(rows) else range(len(run.seeds))
    for row in chosen:
        kind = int(kinds[row])
        seed = int(run.seeds[row])
        within = float(after.fault["within"][row]) if kind else 0.0
        owner = _owner(run, after, tick, int(row)) if kind else 0
        if kind not in (NONE, LOST):
            return limit_reached(run.plan, kind, owner, tick, within, seed, several)
        ends = states_of(run.stacks, after, int(row))
        begins = states_of(run.stacks, before, int(row))
        signals = _signals(run, after if kind else before, tick, within, int(row))
        if not (finite(signals) and finite(ends)) or kind:
            states = {i: (begins[i], ends[i]) for i in ends}
            found = not_finite(run.plan, signals, states, tick, within, seed, several, run.unstable_steps)
            if found is None and kind:
                return limit_reached(run.plan, LOST, owner, tick, within, seed, several)
            if found is not None:
                return found
    return None


def chattering(run: Compiled, carry: Carry) -> list[tuple[str, int]]:
    """The blocks whose crossings chattered, and the ticks in which they began."""
    numbers = np.asarray(carry.fault["chatter"]) if "chatter" in carry.fault else np.zeros(0, int)
    found = {}
    for row in np.flatnonzero(numbers):
        owner = int(_system(run, carry, int(row)).owners[1][numbers[row] - 1])
        found.setdefault(run.plan.blocks[owner].path, int(carry.fault["since"][row]))
    return list(found.items())


def not_finite_since(run: Compiled, first: int, carry: Carry) -> RunFault:
    """The fault of a state that is too large to be kept, so that ticks cannot be made again."""
    paths = run.not_finite()
    rows = [row for row in range(len(run.seeds)) if not finite(states_of(run.stacks, carry, row))]
    seed = int(run.seeds[rows[0] if rows else 0])
    time = run.tick * run.plan.tick
    said = f"its state is NaN or infinite after tick {run.tick - 1} and was not after tick {first - 1} ({time:.9g} s)"
    return RunFault(Problem(paths[0] if paths else "", None, said), LOST, run.tick - 1, time, seed)


def _signals(run: Compiled, carry: Carry, tick: int, within: float, row: int) -> dict[str, np.ndarray]:
    step, values, own = run.functions_of(carry, row)
    hosts = {k: {name: value[row] for name, value in given.items()} for k, given in run.last_of_hosts.items()}

    def signals(
        values: Values, own: Carry, tick: Array, seed: Array, within: Array, hosts: Mapping[int, Mapping[str, Array]]
    ) -> list[dict[str, Array]]:
        return step.signals(values, own, tick, seed, within, hosts)

    there = jax.jit(signals)(values, own, np.uint32(tick), run.seeds[row], within, hosts)
    places = run.stacks.places
    return {
        f"{placed.path}.{port}": np.asarray(there[places[i][0]][port][places[i][1]])
        for i, placed in enumerate(run.plan.blocks)
        for port in placed.block.outputs
    }


def _system(run: Compiled, carry: Carry, row: int) -> Continuous:
    step, values, own = run.functions_of(carry, row)
    return Continuous(step, values, own, jnp.uint32(0), {}, [])


def _owner(run: Compiled, carry: Carry, tick: int, row: int) -> int:
    """The block at which a limit of the solver was reached: that whose crossing is closest, or whose state changes
    fastest for its size.
    """
    step, values, own = run.functions_of(carry, row)
    within = carry.fault["within"][row]
    slopes, levels = jax.jit(step.changes)(values, own, np.uint32(tick), run.seeds[row], within)
    state = {k: own.states[k] for k in step.movers}
    return worst(int(carry.fault["kind"][row]), _system(run, carry, row).owners, state, slopes, levels)
