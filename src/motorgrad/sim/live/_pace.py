"""How many decisions are due: at a chosen speed, or as many as can be made."""

import math
import time

SLICE = 1 / 60  # seconds of wall time in which nobody is listened to
BEHIND = 0.25  # seconds that may be made up for where the run was held up


class Pace:
    """Decisions that are due, at `speed` simulated seconds per second of wall time, each being `period` long."""

    def __init__(self, period: float, speed: float):
        self.period, self.speed, self._cost = period, speed, 1e-3
        self._due, self._then = 0.0, time.perf_counter()
        self._marks: list[tuple[float, int]] = []

    def restart(self) -> None:
        """Begin to count from now."""
        self._due, self._then, self._marks = 0.0, time.perf_counter(), []

    def due(self) -> int:
        """How many decisions to make now, no more than fit into a slice."""
        now = time.perf_counter()
        most = max(1, int(SLICE / self._cost))
        if math.isinf(self.speed):
            return most
        rate = self.speed / self.period
        self._due = min(self._due + (now - self._then) * rate, max(1.0, BEHIND * rate))
        self._then = now
        count = min(int(self._due), most)
        self._due -= count
        return count

    def wait(self) -> float:
        """Seconds until the next decision is due."""
        return 0.0 if math.isinf(self.speed) else max(0.0, (1.0 - self._due) * self.period / self.speed)

    def made(self, decisions: int, took: float) -> None:
        """So many were made in so many seconds. The first ones compile, and soon count for nothing."""
        self._cost = 0.7 * self._cost + 0.3 * max(took / decisions, 1e-7)

    def achieved(self, decision: int) -> float:
        """Simulated seconds per second of wall time, over the last half second or so."""
        now = time.perf_counter()
        self._marks.append((now, decision))
        while len(self._marks) > 2 and now - self._marks[1][0] > 0.5:
            self._marks.pop(0)
        then, before = self._marks[0]
        span = now - then
        return (decision - before) * self.period / span if span > 0 else 0.0
