"""Time travel: a run, snapshots of its past, and a log of its changes."""

import copy
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Self

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad.pages import MAX_PLAYBACK_BYTES, History, Playback
from timlab.diagram import Record, join
from timlab.engine._fault import RunFault
from timlab.engine._interpreter import Interpreter
from timlab.engine._run import Run


class Change(NamedTuple):
    """A parameter that was set, by its address, before the tick with this number."""

    tick: int
    address: str
    value: Any


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
    - `keep_bytes`: the largest number of their bytes, beyond which the same happens.

    **Raises** `ValueError` if a block of the diagram cannot be saved, before anything runs.
    """

    def __init__(
        self, run: Run | Interpreter, every: int = 1000, keep: int = 100, keep_bytes: int = MAX_PLAYBACK_BYTES
    ):
        check_arguments(Timeline, locals())
        check(isinstance(every, int) and every >= 1, "every", every, "a whole number of ticks from 1")
        check(isinstance(keep, int) and keep >= 2, "keep", keep, "a whole number of snapshots from 2")
        self._playback: Playback[Any] = Playback(run, _set_parameter, every, History(keep, keep_bytes))

    @property
    def run(self) -> Any:
        """The run, a `Run` or an `Interpreter`. Another one in the same state may take its place."""
        return self._playback.run

    @run.setter
    def run(self, run: Run | Interpreter) -> None:
        self._playback.run = run

    @property
    def tick(self) -> int:
        """The current tick."""
        return self._playback.tick

    @property
    def end(self) -> int:
        """The last known tick."""
        return self._playback.end

    @property
    def log(self) -> tuple[Change, ...]:
        """All changes, in order; `replay` repeats them."""
        return tuple(Change(change.tick, *change.what) for change in self._playback.changes)

    @property
    def snapshots(self) -> tuple[int, ...]:
        """The ticks of the snapshots."""
        return self._playback.history.ticks

    def __getitem__(self, address: str) -> Any:
        """The current value of a parameter."""
        return self.run[address]

    def __setitem__(self, address: str, value: object) -> None:
        """Set a parameter from now on; this begins another future."""
        self._playback.change((address, value))

    def forget(self) -> None:
        """Forget the known future, so that another one may follow."""
        self._playback.forget()

    def advance(self, ticks: int) -> Record:
        """Run a number of ticks, repeating the known future as far as it goes. **Returns** what the sinks recorded.

        **Raises** `RunFault` as `Run.advance` does.
        """
        pieces: list[Record] = []

        def advance(ticks: int) -> None:
            pieces.append(self.run.advance(ticks))

        try:
            self._playback.advance(ticks, advance)
        except RunFault as fault:
            fault.record = join([*pieces, fault.record]) if fault.record else None
            raise
        return join(pieces)

    def seek(self, tick: int) -> None:
        """Go to a tick in the past or in the future."""
        first = self._playback.history.oldest
        whole = isinstance(tick, int) and not isinstance(tick, bool)
        check(whole and tick >= first, "tick", tick, f"an integer from {first}")
        self._playback.seek(tick)

    def fork(self) -> Self:
        """Another timeline with the same past and a run of its own."""
        check(isinstance(self.run, Run), "run", type(self.run).__name__, "a Run, to be forked")
        other = copy.copy(self)
        other._playback = self._playback.fork(self.run.fork())
        return other


def _set_parameter(run: Run | Interpreter, change: tuple[str, Any]) -> None:
    address, value = change
    run[address] = value


def replay(run: Run | Interpreter, log: Iterable[Change], ticks: int) -> Record:
    """Run a number of ticks from the start of a log, making the log's changes at their ticks."""
    check_arguments(replay, locals())
    pieces = []
    end = run.tick + ticks
    for change in _until(log, end):
        pieces.append(run.advance(change.tick - run.tick))
        run[change.address] = change.value
    return join([*pieces, run.advance(end - run.tick)])


def _until(log: Iterable[Change], end: int) -> Sequence[Change]:
    return [change for change in log if change.tick <= end]
