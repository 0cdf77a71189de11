"""Time travel: a run, snapshots of its past, and a log of its changes."""

import copy
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Self

from motorgrad._errors import check
from motorgrad.lab.diagram import Record, join
from motorgrad.lab.engine._interpreter import Interpreter
from motorgrad.lab.engine._run import Run
from motorgrad.lab.engine._state import State


class Change(NamedTuple):
    """A parameter that was set, by its address, before the tick with this number."""

    tick: int
    address: str
    value: Any


class Snapshot(NamedTuple):
    """A state, and the number of changes made before it."""

    state: State
    changes: int


class Timeline:
    """A run whose past can be revisited and replayed bit for bit.

        timeline = Timeline(Run(diagram))
        timeline.advance(5000)
        timeline.seek(1234)
        timeline["gain.gain"] = 2.0   # begins another future
        timeline.advance(1000)

    Between snapshots the run is computed again, with the changes that were made to it. Changing something in the past
    begins another future: the old one is forgotten, unless a `fork` keeps it.

    **Arguments:**

    - `run`: a `Run` or an `Interpreter`.
    - `every`: the initial number of ticks between snapshots.
    - `keep`: the largest number of snapshots; where there would be more, every second one is dropped.

    **Raises** `ValueError` if a block of the diagram cannot be saved, before anything runs.
    """

    def __init__(self, run: Run | Interpreter, every: int = 1000, keep: int = 100):
        check(isinstance(every, int) and every >= 1, "every", every, "a whole number of ticks from 1")
        check(isinstance(keep, int) and keep >= 2, "keep", keep, "a whole number of snapshots from 2")
        self.run, self._every, self._keep = run, every, keep
        self._log: list[Change] = []
        self._made = 0
        """The number of changes of the log made so far."""
        self._snapshots = {run.tick: Snapshot(run.state, 0)}
        self.end = run.tick
        """The last known tick."""

    @property
    def tick(self) -> int:
        """The current tick."""
        return self.run.tick

    @property
    def log(self) -> tuple[Change, ...]:
        """All changes, in order; `replay` repeats them."""
        return tuple(self._log)

    @property
    def snapshots(self) -> tuple[int, ...]:
        """The ticks of the snapshots."""
        return tuple(sorted(self._snapshots))

    def __getitem__(self, address: str) -> Any:
        """The current value of a parameter."""
        return self.run[address]

    def __setitem__(self, address: str, value: Any) -> None:
        """Set a parameter from now on; this begins another future."""
        self.run[address] = value
        self.forget()
        self._log.append(Change(self.tick, address, copy.deepcopy(value)))
        self._made += 1

    def forget(self) -> None:
        """Forget the known future, so that another one may follow."""
        self._log = self._log[: self._made]
        self._snapshots = {tick: kept for tick, kept in self._snapshots.items() if tick <= self.tick}
        self.end = self.tick

    def advance(self, ticks: int) -> Record:
        """Run a number of ticks, repeating the known future as far as it goes. **Returns** what the sinks recorded."""
        last, pieces = self.tick + ticks, []
        while self.tick < last or not pieces:
            stops = [last, (self.tick // self._every + 1) * self._every]
            stops += [change.tick for change in self._log[self._made : self._made + 1]]
            pieces.append(self.run.advance(max(0, min(stops) - self.tick)))
            self._apply_due_changes()
        return join(pieces)

    def seek(self, tick: int) -> None:
        """Go to a tick in the past or in the future."""
        first = min(self._snapshots)
        whole = isinstance(tick, int) and not isinstance(tick, bool)
        check(whole and tick >= first, "tick", tick, f"an integer from {first}")
        nearest = max(known for known in self._snapshots if known <= tick)
        if tick < self.tick or nearest > self.tick:
            kept = self._snapshots[nearest]
            self.run.restore(kept.state)
            self._made = kept.changes
            self._apply_due_changes()
        if tick > self.tick:
            self.advance(tick - self.tick)

    def fork(self) -> Self:
        """Another timeline with the same past and a run of its own."""
        check(isinstance(self.run, Run), "run", type(self.run).__name__, "a Run, to be forked")
        other = copy.copy(self)
        other.run = self.run.fork()  # type: ignore[union-attr]
        other._log, other._snapshots = list(self._log), dict(self._snapshots)
        return other

    def _apply_due_changes(self) -> None:
        """Make the changes that are due, and take a snapshot if it is time."""
        while self._made < len(self._log) and self._log[self._made].tick <= self.tick:
            self.run[self._log[self._made].address] = self._log[self._made].value
            self._made += 1
        self.end = max(self.end, self.tick)
        if self.tick % self._every == 0 and self.tick not in self._snapshots:
            self._snapshots[self.tick] = Snapshot(self.run.state, self._made)
            if len(self._snapshots) > self._keep:
                self._every *= 2
                first = min(self._snapshots)
                kept = {tick: s for tick, s in self._snapshots.items() if tick % self._every == 0 or tick == first}
                self._snapshots = kept


def replay(run: Run | Interpreter, log: Iterable[Change], ticks: int) -> Record:
    """Run a number of ticks from the start of a log, making the log's changes at their ticks."""
    pieces, end = [], run.tick + ticks
    for change in _until(log, end):
        pieces.append(run.advance(change.tick - run.tick))
        run[change.address] = change.value
    return join([*pieces, run.advance(end - run.tick)])


def _until(log: Iterable[Change], end: int) -> Sequence[Change]:
    return [change for change in log if change.tick <= end]
