"""The trail and the learning curve as they are put into shared memory."""

from collections.abc import Sequence

import numpy as np

from motorgrad.sim.live._shared import Shared
from motorgrad.sim.live._snapshot import POINTS, Sizes
from motorgrad.sim.live._subject import Look, Tally

ROWS = ("position", "velocity", "action", "contacts", "observation", "probability")


class TrailRecorder:
    """The last decisions of the first body, in a ring."""

    def __init__(self, shared: Shared, sizes: Sizes, period: float):
        self._shared, self._room, self._period = shared, sizes.trail, period
        self._count = self._next = 0

    def add(self, decision: int, looks: Sequence[Look]) -> None:
        """Take in consecutive decisions, of which this is the last."""
        if not looks:
            return
        with self._shared.writing() as arrays:
            for number, look in zip(range(decision - len(looks) + 1, decision + 1), looks, strict=True):
                row = self._next
                arrays["decision"][row], arrays["seconds"][row] = number, number * self._period
                arrays["reward"][row], arrays["activation"][row] = look["reward"][0], look["control"][0]
                for name in ROWS:
                    arrays[name][row] = look[name][0]
                self._next = (row + 1) % self._room
                self._count = min(self._count + 1, self._room)
            self._tell(arrays)

    def drop_after(self, decision: int) -> None:
        """Forget the decisions after this one."""
        with self._shared.writing() as arrays:
            while self._count and arrays["decision"][(self._next - 1) % self._room] > decision:
                self._next, self._count = (self._next - 1) % self._room, self._count - 1
            self._tell(arrays)

    def _tell(self, arrays: dict[str, np.ndarray]) -> None:
        arrays["count"][...], arrays["next"][...] = self._count, self._next


class CurveRecorder:
    """The learning curve: points of equally many decisions, twice as many of them each time there is no more room."""

    def __init__(self, shared: Shared, sizes: Sizes, period: float):
        self._shared, self._period = shared, period
        self._ends, self._frozen = np.zeros(POINTS, np.int64), np.zeros(POINTS)
        self._sums, self._counts = (np.zeros((1 + sizes.readings, POINTS)) for _ in range(2))
        self._points = 0
        self._first = self.window = max(1, round(1.0 / period))

    def add(self, decision: int, tally: Tally, frozen: bool) -> None:
        """Take in what happened since the last call; it goes into the last point until that is full."""
        last = self._points - 1
        begun = 0 if last < 1 else self._ends[last - 1]
        if last < 0 or self._ends[last] - begun >= self.window:
            last, self._points = last + 1, self._points + 1
            self._sums[:, last] = self._counts[:, last] = 0
        self._sums[:, last] += np.where(tally.counts > 0, tally.values * tally.counts, 0.0)
        self._counts[:, last] += tally.counts
        self._ends[last], self._frozen[last] = decision, frozen
        if self._points == POINTS:
            self._thin()
        self._tell()

    def drop_after(self, decision: int) -> None:
        """Forget the points that end after this decision."""
        self._points = int(np.searchsorted(self._ends[: self._points], decision, side="right"))
        self._tell()

    def clear(self) -> None:
        """Forget all."""
        self._points, self.window = 0, self._first
        self._tell()

    def _thin(self) -> None:
        half = POINTS // 2
        for array in (self._sums, self._counts):
            array[:, :half] = array[:, ::2] + array[:, 1::2]
        self._ends[:half], self._frozen[:half] = self._ends[1::2], self._frozen[1::2]
        self._points, self.window = half, 2 * self.window

    def _tell(self) -> None:
        n = self._points
        with self._shared.writing() as arrays:
            arrays["count"][...] = n
            arrays["decision"][:n], arrays["frozen"][:n] = self._ends[:n], self._frozen[:n]
            arrays["seconds"][:n] = self._ends[:n] * self._period
            seen = self._counts[:, :n] > 0
            means = np.divide(self._sums[:, :n], self._counts[:, :n], out=np.full((len(seen), n), np.nan), where=seen)
            arrays["values"][:, :n] = means
