"""A branch of a run: its origin, its timeline, and its recorded signals; and the log that reproduces it.

A log has its `seeds`, the `tick` at which it ends, a `digest` of the state there, and `parts`: a `diagram` each, as
text, that ran `from` one tick `until` another, with the `changes` of parameters in between.
"""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from motorgrad._errors import check
from timlab.diagram import Problem, Record
from timlab.editor._program import Program, Values, digest
from timlab.editor._traces import Traces
from timlab.engine import MAX_TICKS, Change, Run, RunFault, Timeline

LOG_FORMAT = "motorgrad log"


def checked_log(log: Mapping[str, Any]) -> dict[str, Any]:
    """A validated log. **Raises** `ValueError` that says what is wrong with it."""
    check(isinstance(log, dict) and log.get("format") == LOG_FORMAT, "format", log.get("format"), f"{LOG_FORMAT!r}")
    check(log.get("version") == 1, "version", log.get("version"), "1, which this release reads")
    seeds = log.get("seeds")
    parts = log.get("parts")
    tick: Any = log.get("tick")
    check(isinstance(seeds, list) and seeds, "seeds", seeds, "a list of integers")
    check(isinstance(tick, int) and 0 <= tick <= MAX_TICKS, "tick", tick, "an integer from 0")
    check(isinstance(parts, list) and parts, "parts", parts, "a list of at least one part")
    now = 0
    for part in parts or ():
        check(isinstance(part, dict) and isinstance(part.get("diagram"), str), "part", part, "with a diagram")
        check(part.get("from") == now, "from", part.get("from"), f"{now}, where the previous part ends")
        last: Any = part.get("until")
        check(isinstance(last, int) and now <= last <= tick, "until", last, f"an integer from {now} to {tick}")
        check(isinstance(part.get("changes"), list), "changes", part.get("changes"), "a list")
        for change in part["changes"]:
            known = isinstance(change, dict) and set(change) == {"tick", "address", "value"}
            at: Any = change["tick"] if known else None
            check(isinstance(at, int) and now <= at <= last, "change", change, "in order, with tick, address and value")
            now = at
        now = last
    check(now == tick, "tick", tick, f"{now}, where the last part ends")
    return {"digest": None, **log}


EVERY = 16  # initial number of ticks between snapshots
COST = 1e-3  # seconds; slower snapshots are taken farther apart
KEPT = 128  # snapshots of a branch; beyond that, every second one is dropped
MAX_SNAPSHOTS_BYTES = 256 * 2**20  # of a branch
Part = dict[str, Any]


class ForwardOnly:
    """A timeline of a run that cannot go back."""

    def __init__(self, run: Run):
        self.run = run
        self.log: tuple[Change, ...] = ()
        self.snapshots = (run.tick,)

    @property
    def tick(self) -> int:
        return self.run.tick

    @property
    def end(self) -> int:
        return self.run.tick

    def __setitem__(self, address: str, value: object) -> None:
        self.run[address] = value
        self.log = (*self.log, Change(self.tick, address, value))

    def advance(self, ticks: int) -> Record:
        return self.run.advance(ticks)


class Branch:
    """One branch of a run. It begins at the current tick of its timeline.

    **Arguments:** its name; the program; the parent branch; whether the diagram was edited in between; its timeline.
    """

    def __init__(self, name: str, program: Program, parent: "Branch | None", edited: bool, timeline: Timeline):
        self.name, self.program, self.parent, self.edited = name, program, parent, edited
        self.timeline = timeline
        self.start = timeline.tick
        self.past: list[Part] = [] if parent is None else parent.past
        """The parts of the log before this diagram."""
        if parent is not None and edited:
            self.past = parent.parts()
        self._inherited = len(timeline.log)
        self.traces = Traces(program.diagram, program.seeds)
        self.warned: list[Problem] = []
        """What its run warned of."""
        self._stopped: Problem | None = None
        """The fault at which it stopped, until it gets past it."""
        self._paths = {placed.path for placed in self.run.plan.blocks}

    @property
    def run(self) -> Run:
        run = self.timeline.run
        assert isinstance(run, Run)
        return run

    @property
    def faults(self) -> list[dict[str, Any]]:
        """What is wrong with its numbers, as problems: what stopped it, and what its run warned of."""
        return [problem._asdict() for problem in [*([self._stopped] if self._stopped else []), *self.warned]]

    def advance(self, ticks: int) -> Record | None:
        """Run a number of ticks, repeating the known ones. **Returns** what new ones recorded, if there are any.

        **Raises** `RunFault` as `Run.advance` does.
        """
        timeline = self.timeline
        stop = timeline.tick + ticks
        if timeline.tick < timeline.end:
            timeline.advance(min(stop, timeline.end) - timeline.tick)
        if timeline.tick == stop:
            return None
        try:
            record = timeline.advance(stop - timeline.tick)
        except RunFault as fault:
            self._stopped = fault.problem
            raise
        self._stopped = None
        self.warned += [problem for problem in self.run.warnings if problem not in self.warned]
        return record

    def set_parameters(self, values: Values) -> None:
        """Set parameters from the current tick on. Blocks that do not run, such as connected inlets, are skipped."""
        for address, value in values.items():
            if address.partition(".")[0] in self._paths:
                self.timeline[address] = value

    def overrides(self, values: Values) -> Values:
        """The parameters that differ from these values in single precision."""
        there = {address: self.run[address] for address in values if address.partition(".")[0] in self._paths}
        return {a: value for a, value in there.items() if np.any(np.float32(value) != np.float32(values[a]))}

    def switch_program(self, program: Program) -> None:
        """Continue with another compilation of the same diagram."""
        program.run.restore(self.run.state)
        self.run.close()
        self.program, self.timeline.run = program, program.run

    def parts(self) -> list[Part]:
        """The diagrams that led to the current state, each with the changes made to it."""
        changes = [change._asdict() for change in self.timeline.log if change.tick <= self.timeline.tick]
        first = self.past[-1]["until"] if self.past else 0
        own = {"from": first, "until": self.timeline.tick, "diagram": self.program.text, "changes": changes}
        return [*self.past, own]

    def log(self) -> dict[str, Any]:
        """Everything that determines the state, as plain data, and a digest of the state."""
        own = {"format": LOG_FORMAT, "version": 1, "seeds": list(self.program.seeds), "parts": self.parts()}
        state = None if self.program.fixed else digest(self.run.state)
        return own | {"tick": self.timeline.tick, "digest": state}

    def summary(self) -> dict[str, Any]:
        """What clients show of the branch."""
        return {
            "name": self.name,
            "parent": None if self.parent is None else self.parent.name,
            "start": self.start,
            "head": self.timeline.end,
            "edited": self.edited,
            "changes": [change._asdict() for change in self.timeline.log[self._inherited :]],
        }


def timeline_of(program: Program) -> Any:
    """The timeline of a program's run. The slower snapshots are to take, the farther apart they are."""
    if program.fixed is not None:
        return ForwardOnly(program.run)
    start = time.perf_counter()
    _ = program.run.state
    every = EVERY * max(1, round((time.perf_counter() - start) / COST))
    return Timeline(program.run, every, KEPT, MAX_SNAPSHOTS_BYTES)
