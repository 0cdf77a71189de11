"""Playback of a live run: a clock that determines what is due, stored states, and a log of changes to repeat.

A run advances in ticks. Its random numbers are a function of the tick, so restoring a state and repeating what followed
reproduces the run bit for bit, if the changes that were made by hand are repeated at their ticks.
"""

import bisect
import copy
import math
import time
from collections.abc import Callable, Sequence
from typing import Any, Generic, NamedTuple, Protocol, Self, TypeVar

import jax
import numpy as np
from jaxtyping import PyTree

from motorgrad._errors import check

MAX_PLAYBACK_STATES = 900
MAX_PLAYBACK_BYTES = 256 * 2**20


class Clock:
    """Play, pause and speed: how many ticks of a `period` in simulated seconds are due, at a `speed` of so many
    simulated seconds per second of wall time, which may be infinite. Those due at once take a `slice` of wall time at
    most. A run that cannot keep up does not catch up later: at most `BEHIND` seconds of delay are made up for."""

    BEHIND = 0.25  # s
    SPAN = 0.5  # s of wall time over which the achieved speed is measured

    def __init__(self, period: float, speed: float = 1.0, slice: float = 1 / 60):
        self.period, self._speed, self._slice = period, speed, slice
        self.playing = False
        self._cost = 1e-3  # s of wall time that a tick takes
        self.restart()

    @property
    def speed(self) -> float:
        """Simulated seconds per second of wall time, as wanted."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        self._speed = speed
        self.restart()

    def play(self) -> None:
        """Let ticks become due from now on."""
        self.playing = True
        self.restart()

    def pause(self) -> None:
        """Let no more ticks become due."""
        self.playing = False

    def restart(self) -> None:
        """Count from now. Call it after the run was set to another tick."""
        self._due = 0.0
        self._then = time.perf_counter()
        self._marks: list[tuple[float, int]] = []

    def due(self) -> int:
        """The number of ticks to make now, at most what fits into a slice; 0 while paused."""
        if not self.playing:
            return 0
        now = time.perf_counter()
        most = max(1, int(self._slice / self._cost))
        if math.isinf(self._speed):
            return most
        rate = self._speed / self.period
        self._due = min(self._due + (now - self._then) * rate, max(1.0, self.BEHIND * rate))
        self._then = now
        count = min(int(self._due), most)
        self._due -= count
        return count

    def wait(self) -> float:
        """Seconds until the next tick is due; infinite while paused."""
        if not self.playing:
            return math.inf
        return 0.0 if math.isinf(self._speed) else max(0.0, (1.0 - self._due) * self.period / self._speed)

    def record(self, ticks: int, took: float) -> None:
        """Update the estimated cost of a tick, after `ticks` took so many seconds. The estimate rises slowly and falls
        fast, so that a tick that waited for compilation is soon forgotten."""
        each = max(took / ticks, 1e-9)
        self._cost = 0.7 * self._cost + 0.3 * each if each > self._cost else max(each, self._cost / 4)

    def achieved(self, tick: int) -> float:
        """Simulated seconds per second of wall time over about the last `SPAN`; 0 while paused or just begun."""
        if not self.playing:
            return 0.0
        now = time.perf_counter()
        self._marks.append((now, tick))
        while len(self._marks) > 2 and now - self._marks[1][0] > self.SPAN:
            self._marks.pop(0)
        then, before = self._marks[0]
        return (tick - before) * self.period / (now - then) if now - then > 0.1 else 0.0


class Kept(NamedTuple):
    """A state of a run after a number of ticks and of changes in the log; `size` in bytes."""

    tick: int
    state: Any
    changes: int = 0
    size: int = 0


class History:
    """States of a run in order of their ticks, bounded in number and in bytes. When there are too many or they are too
    large, every second one is dropped, so older states lie farther apart. The first and the newest one stay."""

    def __init__(self, most: int = MAX_PLAYBACK_STATES, most_bytes: int = MAX_PLAYBACK_BYTES):
        self.most, self.most_bytes = most, most_bytes
        self._kept: list[Kept] = []

    def keep(self, tick: int, state: PyTree, changes: int = 0) -> bool:
        """Keep a state, in place of any other of this tick. **Returns** whether others were dropped to make room."""
        place = bisect.bisect_left(self._kept, tick, key=lambda kept: kept.tick)
        same = place < len(self._kept) and self._kept[place].tick == tick
        self._kept[place : place + same] = [Kept(tick, state, changes, size_of(state))]
        return self._thin()

    def limit(self, most: int, most_bytes: int) -> None:
        """Change the bounds, and drop what is beyond them."""
        self.most, self.most_bytes = most, most_bytes
        self._thin()

    def _thin(self) -> bool:
        """Drop states until the others fit. **Returns** whether any were dropped."""
        thinned = False
        while len(self._kept) > 2 and (
            len(self._kept) > self.most or sum(kept.size for kept in self._kept) > self.most_bytes
        ):
            del self._kept[1:-1:2]
            thinned = True
        return thinned

    def drop_after(self, tick: int) -> None:
        """Drop the states of later ticks."""
        del self._kept[bisect.bisect_right(self._kept, tick, key=lambda kept: kept.tick) :]

    def before(self, tick: int) -> Kept:
        """The last state at or before a tick. **Raises** `ValueError` where there is none."""
        place = bisect.bisect_right(self._kept, tick, key=lambda kept: kept.tick)
        check(place > 0, "tick", tick, f"at least {self.oldest:,}")
        return self._kept[place - 1]

    @property
    def ticks(self) -> tuple[int, ...]:
        """The ticks of the states, in order."""
        return tuple(kept.tick for kept in self._kept)

    @property
    def oldest(self) -> int:
        """The tick of the first state, or 0."""
        return self._kept[0].tick if self._kept else 0

    @property
    def newest(self) -> int:
        """The tick of the last state, or 0."""
        return self._kept[-1].tick if self._kept else 0

    def copy(self) -> "History":
        """Another history of the same states."""
        other = History(self.most, self.most_bytes)
        other._kept = list(self._kept)
        return other


class Playable(Protocol):
    """A run that can be played: it advances in ticks, and can be set back to a state of its own."""

    @property
    def tick(self) -> int:
        """Ticks made."""
        ...

    @property
    def state(self) -> Any:
        """Everything that the future depends on, copied."""
        ...

    def advance(self, ticks: int, /) -> Any:
        """Make this number of ticks."""
        ...

    def restore(self, state: PyTree, /) -> None:
        """Restore a state."""
        ...


R = TypeVar("R", bound=Playable)


class Change(NamedTuple):
    """Something that was changed by hand before the tick with this number. `what` is for `Playback.apply`, and `said`
    is what that returned the first time."""

    tick: int
    what: Any
    said: Any = None


class Line(NamedTuple):
    """One course of a run: the states kept on it, all changes made to it, and its last known tick."""

    history: History
    log: list[Change]
    end: int


class Playback(Generic[R]):
    """A run whose past can be revisited and repeated bit for bit.

    Between kept states the run is computed again, with the changes that were made to it. A change in the past begins
    another future: the known one is forgotten, unless a `fork` keeps it.

    ```python
    playback = Playback(run, lambda run, change: change(run))
    playback.advance(5000)
    playback.seek(1234)
    playback.change(push)  # begins another future
    ```

    **Arguments:**

    - `run`: anything with `tick`, `advance`, `state` and `restore`.
    - `apply`: `apply(run, what)` makes a change. Repeated on the same state, it must have the same effect.
    - `every`: how many ticks lie between the states that `advance` keeps; twice as many whenever the history is full.
      With None, states are kept by `keep` alone.
    - `history`: where states are kept.
    """

    def __init__(
        self, run: R, apply: Callable[[R, Any], Any], every: int | None = None, history: History | None = None
    ):
        self.run, self.apply, self.every = run, apply, every
        self.history = History() if history is None else history
        self.begin()

    def begin(self) -> None:
        """Forget past and future: the run begins with its present state."""
        self.history.drop_after(-1)
        self._log: list[Change] = []
        self._made = 0
        """The number of changes of the log made so far."""
        self.end = self.tick
        """The last known tick."""
        self.keep()

    @property
    def tick(self) -> int:
        """The current tick."""
        return self.run.tick

    @property
    def changes(self) -> Sequence[Change]:
        """All changes, in order."""
        return tuple(self._log)

    def keep(self) -> None:
        """Keep the present state."""
        if self.history.keep(self.tick, self.run.state, self._made) and self.every is not None:
            self.every *= 2

    def advance(self, ticks: int, by: Callable[[int], Any] | None = None) -> list[Any]:
        """Run a number of ticks, repeating the known future as far as it goes. The run stops at changes and where
        states are kept. **Returns** what it returned for each stretch, of which there is at least one. `by` advances it
        in place of `run.advance`."""
        last = self.tick + ticks
        pieces = []
        while self.tick < last or not pieces:
            stops = [last, *(change.tick for change in self._log[self._made : self._made + 1])]
            if self.every is not None:
                stops.append((self.tick // self.every + 1) * self.every)
            try:
                pieces.append((by or self.run.advance)(max(0, min(stops) - self.tick)))
            finally:  # it may stop on the way
                self.end = max(self.end, self.tick)
            self._repeat_changes()
            due = self.every is not None and self.tick % self.every == 0
            if due and self.history.before(self.tick).tick < self.tick:
                self.keep()
        return pieces

    def rewind(self, tick: int) -> None:
        """Restore the last kept state at or before a tick, with the changes made at its own tick."""
        kept = self.history.before(tick)
        self.run.restore(kept.state)
        self._made = kept.changes
        self._repeat_changes()

    def seek(self, tick: int) -> None:
        """Go to a tick in the past or in the future. **Raises** `ValueError` for one before the first kept state."""
        if tick < self.tick or self.history.before(tick).tick > self.tick:
            self.rewind(tick)
        if tick > self.tick:
            self.advance(tick - self.tick)

    def change(self, what: Any) -> Any:
        """Make a change, which begins another future. **Returns** what `apply` returns; if it raises, all stays."""
        found = self.apply(self.run, what)
        self.forget()
        self._log.append(Change(self.tick, copy.deepcopy(what), found))
        self._made += 1
        return found

    def undo(self) -> Any:
        """Go back to before the last change, and forget it with what followed. **Returns** what was changed. **Raises**
        `ValueError` where nothing has been changed so far, or where no state from before it is kept."""
        number = self._made - 1
        check(number >= 0, "changes", self._made, "at least one to take back")
        change = self._log[number]
        kept = self.history.before(change.tick)
        check(kept.changes <= number, "changes", kept.changes, f"at most {number} in the state before the last one")
        del self._log[number:]
        self.rewind(change.tick)
        self.advance(change.tick - self.tick)
        self.forget()
        return change.what

    def forget(self) -> None:
        """Forget the known future, so that another one may follow."""
        del self._log[self._made :]
        self.history.drop_after(self.tick)
        self.end = self.tick

    @property
    def has_later_changes(self) -> bool:
        """Whether the known future has changes that have not been made yet."""
        return self._made < len(self._log)

    @property
    def line(self) -> Line:
        """The past and the known future, copied; kept states are shared."""
        return Line(self.history.copy(), list(self._log), self.end)

    def follow(self, line: Line, tick: int) -> None:
        """Go to a tick of another line, which takes the place of the present one and is changed from now on."""
        self.history, self._log, self.end = line.history, line.log, line.end
        self.rewind(tick)
        self.advance(tick - self.tick)

    def fork(self, run: R) -> Self:
        """The playback of another run, in the same state, with the same past and future."""
        other = copy.copy(self)
        other.run = run
        other.history = self.history.copy()
        other._log = list(self._log)
        return other

    def _repeat_changes(self) -> None:
        """Make the changes of the log that are due."""
        while self._made < len(self._log) and self._log[self._made].tick <= self.tick:
            self.apply(self.run, self._log[self._made].what)
            self._made += 1


def size_of(state: PyTree) -> int:
    """The bytes of a state's arrays."""
    return sum(leaf.nbytes for leaf in jax.tree.leaves(state) if isinstance(leaf, np.ndarray | jax.Array))
