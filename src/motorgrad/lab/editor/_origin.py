"""Find where NaN and infinity began: the block that turned finite inputs into a number that is not finite."""

from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from motorgrad.lab.compiler import Plan
from motorgrad.lab.diagram import Placed, Problem
from motorgrad.lab.engine import Interpreter, Run, State, Timeline

LATER = 2  # ticks in which a number that is not finite is looked for, from the last tick that is known to be sound


def origin(timeline: Timeline, diagram: Any, first: int, seen: int | None) -> Problem | None:
    """The block at which the numbers stopped being finite, with the tick and its inputs.

    The state is restored to the last sound tick, and the tick after it is made again block by block for the first
    seed that is affected.

    **Arguments:** the timeline, which is not changed; the diagram that it runs; the `first` tick that may be wrong;
    the tick at which a recorded signal was `seen` not to be finite, `None` if only a state is.

    **Returns** `None` where no such block is found, as where a wire brought NaN from outside of the diagram.
    """
    probe, last = timeline.fork(), timeline.tick
    sound = _last_sound(probe, first, last if seen is None else seen)
    probe.seek(sound)
    before = probe.run.state
    probe.seek(min(last, sound + 1 if seen is None or seen < last else last))
    row = _affected(probe.run)
    for seed in [row] if row is not None else range(len(probe.run.seeds)):
        interpreter = Interpreter(diagram, int(probe.run.seeds[seed]))
        interpreter.restore(_of_seed(before, seed))
        for _ in range(LATER):
            tick, held = interpreter.tick, interpreter.state
            interpreter.advance(1)
            found = _began(interpreter, held)
            if found is not None:
                return _described(found, interpreter, tick, seed, len(probe.run.seeds))
    return None


def _last_sound(probe: Timeline, first: int, wrong: int) -> int:
    """The last tick up to `wrong` before which all states are finite, by bisection from `first` on."""
    probe.seek(wrong)
    if not probe.run.not_finite():
        return wrong
    low, high = first, wrong
    while high - low > 1:
        middle = (low + high) // 2
        probe.seek(middle)
        low, high = (low, middle) if probe.run.not_finite() else (middle, high)
    return low


def _affected(run: Run) -> int | None:
    """The first row with a state that is not finite."""
    rows = [row for own in run.state["blocks"].values() for leaf in jax.tree.leaves(own) for row in _wrong_rows(leaf)]
    return min(rows, default=None)


def _wrong_rows(leaf: np.ndarray) -> list[int]:
    if leaf.dtype.kind != "f":
        return []
    return np.flatnonzero(~np.isfinite(leaf).reshape(len(leaf), -1).all(axis=1)).tolist()


def _of_seed(state: State, seed: int) -> State:
    """The state of one seed; all seeds share the parameters."""
    parts = {part: jax.tree.map(lambda x: x[seed : seed + 1], state[part]) for part in ("blocks", "hosts", "last")}
    return {**state, **parts}


Found = tuple[Placed, str | None, bool]
"""A block, the output that is not finite, `None` for its state, and whether that is NaN."""


def _began(interpreter: Interpreter, before: State) -> Found | None:
    """The first block of the last tick whose inputs are finite and whose output, or else whose state, is not."""
    plan, signals = interpreter.plan, interpreter.signals
    for i in plan.order:
        for port in plan.blocks[i].block.outputs:
            value = signals.get(f"{plan.blocks[i].path}.{port}")
            if value is not None and not _finite(value) and _sound_inputs(plan, plan.blocks[i], signals):
                return plan.blocks[i], port, bool(np.isnan(value).any())
    after = interpreter.state["blocks"]
    wrong = [p for p in plan.blocks if p.identity in after and not _finite(after[p.identity])]
    wrong = [placed for placed in wrong if _sound_inputs(plan, placed, signals)]
    # of several that took the step together, the one that was largest before it
    placed = max(wrong, key=lambda p: _largest(before["blocks"].get(p.identity)), default=None)
    return None if placed is None else (placed, None, _has_nan(after[placed.identity]))


def _described(found: Found, interpreter: Interpreter, tick: int, seed: int, seeds: int) -> Problem:
    placed, port, nan = found
    plan, signals = interpreter.plan, interpreter.signals
    what = "NaN" if nan else "infinite"
    which = f" in seed {int(interpreter.seed)}" if seeds > 1 else ""
    given = [f"{name} = {_short(value)}" for name, value in _given(plan, placed, signals)]
    cause = f"its input {' and '.join(given)}" if given else "it has no inputs"
    subject = "" if port else "its state "
    return Problem(
        placed.path,
        port,
        f"{subject}becomes {what} at tick {tick} ({tick * plan.tick:.6g} s){which}. It begins here: {cause}",
    )


def _given(plan: Plan, placed: Placed, signals: dict[str, np.ndarray]) -> Iterator[tuple[str, np.ndarray]]:
    """The values at the connected inputs of a block."""
    for name, source in placed.sources.items():
        value = signals.get(f"{plan.blocks[source.block].path}.{source.port}")
        if value is not None:
            yield name, value


def _sound_inputs(plan: Plan, placed: Placed, signals: dict[str, np.ndarray]) -> bool:
    return all(_finite(value) for _, value in _given(plan, placed, signals))


def _finite(tree: Any) -> bool:
    return all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(tree))


def _has_nan(tree: Any) -> bool:
    return any(np.isnan(leaf).any() for leaf in jax.tree.leaves(tree))


def _largest(tree: Any) -> float:
    return max((float(np.max(np.abs(leaf), initial=0.0)) for leaf in jax.tree.leaves(tree)), default=0.0)


def _short(value: np.ndarray) -> str:
    if value.ndim == 0:
        return f"{value:.4g}"
    flat = value.ravel()
    return f"[{', '.join(f'{each:.4g}' for each in flat[:4])}{', …' if len(flat) > 4 else ''}]"
