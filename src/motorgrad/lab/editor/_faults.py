"""What is NaN or infinite in a run, and since when."""

from typing import Any

import numpy as np

from motorgrad.lab.diagram import Problem, Record, sampled
from motorgrad.lab.engine import Run


class Faults:
    """The recorded signals and the states of one branch that were found not to be finite, each named once."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str | None], Problem] = {}

    @property
    def list(self) -> "list[dict[str, Any]]":
        """All that was found, as problems."""
        return [problem._asdict() for problem in self._found.values()]

    def look(self, record: Record, run: Run) -> "list[Problem]":
        """Look through a record and the state at its end. **Returns** what is new."""
        new = [problem for problem in [*_signals(record), *_states(run)] if problem[:2] not in self._found]
        self._found |= {(problem.path, problem.port): problem for problem in new}
        return new


def _signals(record: Record) -> list[Problem]:
    """The signals that are not finite, the earliest first."""
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
    return [problem for _, problem in sorted(found, key=lambda each: each[0])]


def _states(run: Run) -> list[Problem]:
    tick = f"tick {run.tick} ({run.tick * run.plan.tick:.6g} s)"
    return [Problem(path, None, f"its state is NaN or infinite at {tick}") for path in run.not_finite()]
