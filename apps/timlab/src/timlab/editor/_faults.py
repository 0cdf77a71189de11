"""What is wrong with the numbers of a branch: what stopped its run, and what the run warned of."""

from typing import Any

from timlab.diagram import Problem
from timlab.engine import Run, RunFault


class Faults:
    """The fault at which a branch stopped, until it gets past it, and what its run warned of."""

    def __init__(self) -> None:
        self._stopped: Problem | None = None
        self._warnings: list[Problem] = []

    @property
    def list(self) -> "list[dict[str, Any]]":
        """Everything found, as problems."""
        return [problem._asdict() for problem in [*([self._stopped] if self._stopped else []), *self._warnings]]

    def stop(self, fault: RunFault) -> None:
        """Keep what stopped the run."""
        self._stopped = fault.problem

    def observe(self, run: Run) -> "list[Problem]":
        """Look after ticks that were made. **Returns** what the run newly warned of."""
        self._stopped = None
        new = [problem for problem in run.warnings if problem not in self._warnings]
        self._warnings += new
        return new
