"""What stops a run: a number that is not finite, or a limit of the solver that is reached; with its block and time."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, PyTree

from timlab.compiler import (
    CROSSINGS,
    LOOP,
    LOST,
    MAX_CROSSINGS_PER_TICK,
    MAX_STEPS_PER_TICK,
    SHORT,
    SIGNAL,
    STEPS,
    Plan,
)
from timlab.diagram import Problem

GO_ON = 'on_fault="warn" goes on without it'
ADVICE = {
    STEPS: f"{MAX_STEPS_PER_TICK:,} steps of the solver do not reach the end of the tick: it is too fast for this "
    'solver. Use solver="rodas5p", a shorter tick or larger tolerances',
    SHORT: "the shortest steps that tell times apart are too long: it is too fast for this solver, or grows without "
    'bound. Use solver="rodas5p", precision="double" or a shorter tick',
    CROSSINGS: f"{MAX_CROSSINGS_PER_TICK:,} zero crossings are not enough for the tick. Use a shorter tick, or "
    "hysteresis",
    LOOP: "Newton's method finds no solution of the algebraic loop through it. Put a lag or a delay into the loop",
    LOST: "limit what drives it",
    SIGNAL: "keep its inputs where it is defined",
}
"""By kind of fault: what was reached, and what to do."""


class RunFault(ArithmeticError):
    """A run cannot go on: a number is not finite, or a limit of the solver was reached.

    `problem` names the block and, where it is an output, the port; `kind` is `"not finite"` or `"limit"`; `tick`,
    `time` (s) and `seed` say where it is. `record` has what the sinks recorded before it. The run is at the tick before
    which everything was sound.
    """

    def __init__(self, problem: Problem, kind: int, tick: int, time: float, seed: int):
        super().__init__(f"{problem}; {GO_ON}")
        self.problem, self.tick, self.time, self.seed = problem, tick, time, seed
        self.kind = "not finite" if kind in (LOST, SIGNAL) else "limit"
        self.record: Any = None


def limit_reached(plan: Plan, kind: int, block: int, tick: int, within: float, seed: int, several: bool) -> RunFault:
    """The fault of a limit of the solver at a block."""
    time = tick * plan.tick + within
    where = f"at {time:.9g} s (tick {tick}){_in_seed(seed, several)}"
    return RunFault(Problem(plan.blocks[block].path, None, f"{where}: {ADVICE[kind]}"), kind, tick, time, seed)


def worst(
    kind: int,
    owners: tuple[np.ndarray, np.ndarray],
    state: PyTree[np.ndarray],
    slopes: PyTree[np.ndarray],
    levels: Array,
) -> int:
    """The block at which a limit of the solver was reached: that whose crossing is closest to zero, or whose state
    changes fastest for its size.
    """
    if kind == CROSSINGS:
        return int(owners[1][np.argmin(np.abs(levels))])
    sizes, rates = (np.concatenate([np.ravel(x) for x in jax.tree.leaves(tree)]) for tree in (state, slopes))
    speeds = np.abs(rates) / (np.abs(sizes) + np.finfo(rates.dtype).tiny)
    return int(owners[0][np.argmax(np.where(np.isfinite(rates + sizes), np.minimum(speeds, 1e30), np.inf))])


Signals = Mapping[str, np.ndarray]


def not_finite(
    plan: Plan,
    signals: Signals,
    states: Mapping[int, tuple[Any, Any]],
    tick: int,
    within: float,
    seed: int,
    several: bool,
    lines: Callable[[], list[str]] | None = None,
) -> RunFault | None:
    """The fault at the block that turned finite inputs into a number that is not finite; `None` where there is none, as
    where a number from outside of the diagram is not finite.

    **Arguments:** of one seed, the signals at the time by address; by block, its states before and after; a function
    that returns what else is known about states that are lost.
    """
    found = _began(plan, signals, states)
    if found is None:
        return None
    i, port, kind = found
    if kind == LOOP:
        return limit_reached(plan, LOOP, i, tick, within, seed, several)
    placed = plan.blocks[i]
    time = tick * plan.tick + within
    wrong = states[i][1] if port is None else signals[f"{placed.path}.{port}"]
    leaves = [leaf for leaf in map(np.asarray, jax.tree.leaves(wrong)) if leaf.dtype.kind == "f"]
    what = "NaN" if any(np.isnan(leaf).any() for leaf in leaves) else "infinite"
    given = [f"{name} = {_short(value)}" for name, value in _given(plan, i, signals)]
    cause = f"its input {' and '.join(given)}" if given else "it has no inputs"
    subject = "" if port else "its state "
    where = f"at tick {tick} ({time:.9g} s){_in_seed(seed, several)}"
    more = lines() if lines and port is None else []
    advice = "; ".join(more) or ADVICE[kind]
    message = f"{subject}becomes {what} {where}. It begins here: {cause}. {advice[0].upper()}{advice[1:]}"
    return RunFault(Problem(placed.path, port, message), kind, tick, time, seed)


def _in_seed(seed: int, several: bool) -> str:
    return f" in seed {seed}" if several else ""


def _began(plan: Plan, signals: Signals, states: Mapping[int, tuple[Any, Any]]) -> tuple[int, str | None, int] | None:
    """The first block whose inputs are finite and whose output, or else whose state, is not; its port, and the kind."""
    bad = {
        (i, port)
        for i in plan.order
        for port in plan.blocks[i].block.outputs
        if not finite(signals.get(f"{plan.blocks[i].path}.{port}", 0.0))
    }
    for i in plan.order:
        for port in plan.blocks[i].block.outputs:
            if (i, port) in bad and not any((s.block, s.port) in bad for s in plan.blocks[i].sources.values()):
                kept = states.get(i)
                return (i, None, LOST) if kept and not finite(kept[1]) else (i, port, SIGNAL)
    torn = [i for i in plan.order if i in plan.torn and any(block == i for block, _ in bad)]
    if torn:
        return torn[0], None, LOOP
    wrong = [i for i, (_, after) in states.items() if not finite(after)]
    sound = [i for i in wrong if not any((s.block, s.port) in bad for s in plan.blocks[i].sources.values())]
    # of several that took the step together, the one that was largest before it
    worst = max(sound or wrong, key=lambda i: _largest(states[i][0]), default=None)
    return None if worst is None else (worst, None, LOST)


def _given(plan: Plan, i: int, signals: Signals) -> Iterator[tuple[str, np.ndarray]]:
    """The values at the connected inputs of a block."""
    for name, source in plan.blocks[i].sources.items():
        value = signals.get(f"{plan.blocks[source.block].path}.{source.port}")
        if value is not None:
            yield name, np.asarray(value)


def finite(tree: PyTree[np.ndarray]) -> bool:
    """Whether all numbers of a tree are finite."""
    return all(np.isfinite(leaf).all() for leaf in map(np.asarray, jax.tree.leaves(tree)) if leaf.dtype.kind == "f")


def _largest(tree: PyTree[np.ndarray]) -> float:
    return max((float(np.max(np.abs(leaf), initial=0.0)) for leaf in jax.tree.leaves(tree)), default=0.0)


def _short(value: np.ndarray) -> str:
    if value.ndim == 0:
        return f"{value:.4g}"
    flat = value.ravel()
    return f"[{', '.join(f'{each:.4g}' for each in flat[:4])}{', …' if len(flat) > 4 else ''}]"
