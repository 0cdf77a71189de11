"""Find which signals and states of a run are NaN or infinite, and since when."""

from typing import Any

import numpy as np

from motorgrad.lab.diagram import Diagram, Problem, Record, sampled
from motorgrad.lab.editor._origin import origin
from motorgrad.lab.engine import Run, Timeline


class Faults:
    """The recorded signals and the states of one branch that were found not to be finite, each named once."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str | None], Problem] = {}

    @property
    def list(self) -> "list[dict[str, Any]]":
        """Everything found, as problems."""
        return [problem._asdict() for problem in self._found.values()]

    def look(self, record: Record, timeline: Any, diagram: Diagram) -> "list[Problem]":
        """Look through a record and the state at its end. The first time that something is found, look for where it
        began too. **Returns** what is new, the origin first.
        """
        signals, states = _signals(record), _states(timeline.run)
        new = [problem for problem in [*(each for _, each in signals), *states] if problem[:2] not in self._found]
        if new and not self._found and isinstance(timeline, Timeline):
            seen = signals[0][0] if signals else None
            began = _origin(timeline, diagram, record.first, seen)
            new = [began, *(each for each in new if each[:2] != began[:2])] if began else new
            new[0] = new[0]._replace(message=". ".join([new[0].message, *timeline.run.unstable]))
        self._found |= {(problem.path, problem.port): problem for problem in new}
        return new


def _origin(timeline: Timeline, diagram: Diagram, first: int, seen: int | None) -> Problem | None:
    try:
        return origin(timeline, diagram, first, seen)
    except Exception:  # a block's own code may raise anything: what was found is told all the same
        return None


def _signals(record: Record) -> list[tuple[int, Problem]]:
    """The signals that are not finite, with the tick at which each began, earliest first."""
    found = []
    for address, signal in record.signals.items():
        wrong = np.any(~np.isfinite(signal), axis=tuple(range(2, signal.ndim)))
        if not wrong.any():
            continue
        place = int(wrong.any(axis=0).argmax())
        tick = int(sampled(record.first, record.ticks, record.every[address])[place])
        seeds, numbers = np.flatnonzero(wrong[:, place]), signal[:, place]
        what = "NaN" if np.isnan(numbers).any() else "infinite"
        some = f" in {len(seeds)} of {len(signal)} seeds" if len(signal) > 1 else ""
        path, _, port = address.rpartition(".")
        found.append((tick, Problem(path, port, f"is {what} at tick {tick} ({tick * record.tick:.6g} s){some}")))
    return sorted(found, key=lambda each: each[0])


def _states(run: Run) -> list[Problem]:
    tick = f"tick {run.tick} ({run.tick * run.plan.tick:.6g} s)"
    return [Problem(path, None, f"its state is NaN or infinite at {tick}") for path in run.not_finite()]
