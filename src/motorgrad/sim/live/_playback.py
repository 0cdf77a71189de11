"""Playback of a run: the pace of its decisions, which of them are sampled, and the states to go back to."""

import math
import time
from typing import Any, NamedTuple

import jax
import numpy as np

SLICE = 1 / 60  # s of wall time between two looks at the pipe
BEHIND = 0.25  # s of delay that a run makes up for at most
LOOKS = 150.0  # decisions a second that are sampled one by one
STRETCH = 600.0  # decisions sampled in a row, after which a faster run pauses sampling
MOST_BYTES = 256 * 2**20
MOST_STATES = 900  # 15 minutes, at one a second


class Pace:
    """How many decisions are due at `speed` simulated seconds per second of wall time, `period` s each."""

    def __init__(self, period: float, speed: float):
        self.period, self.speed, self._cost = period, speed, 1e-3
        self._due, self._then = 0.0, time.perf_counter()
        self._marks: list[tuple[float, int]] = []

    def restart(self) -> None:
        """Count from now."""
        self._due, self._then, self._marks = 0.0, time.perf_counter(), []

    def due(self) -> int:
        """The number of decisions to make now, at most what fits into a slice."""
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
        """Update the estimated cost of a decision, a moving average that soon forgets the time of compilation."""
        self._cost = 0.7 * self._cost + 0.3 * max(took / decisions, 1e-7)

    def achieved(self, decision: int) -> float:
        """Simulated seconds per second of wall time, over about the last half second."""
        now = time.perf_counter()
        self._marks.append((now, decision))
        while len(self._marks) > 2 and now - self._marks[1][0] > 0.5:
            self._marks.pop(0)
        then, before = self._marks[0]
        span = now - then
        return (decision - before) * self.period / span if span > 0 else 0.0


class SamplingBudget:
    """Which decisions are sampled one by one: all up to `LOOKS` a second, then stretches of consecutive ones."""

    def __init__(self) -> None:
        self._credit, self._then, self._on = STRETCH, time.perf_counter(), True

    def take(self, decisions: int) -> int:
        """How many of the next decisions to sample."""
        now = time.perf_counter()
        self._credit = min(STRETCH, self._credit + LOOKS * (now - self._then))
        self._then = now
        self._on = self._credit >= (min(decisions, STRETCH) if self._on else STRETCH)
        count = min(decisions, int(self._credit)) if self._on else 0
        self._credit -= count
        return count


class Kept(NamedTuple):
    """A state of a run, before the decision of this number; `size` in bytes."""

    decision: int
    state: Any
    size: int


class History:
    """Complete states in order of their decisions. The oldest are dropped when they become too many or too large.

    Random numbers are a function of the decision's number, so repeating decisions reproduces them bit for bit, unless
    something was changed by hand in between: after each such change a state is kept.
    """

    def __init__(self, most_bytes: int = MOST_BYTES, most_states: int = MOST_STATES):
        self._kept: list[Kept] = []
        self._most = most_bytes, most_states

    def keep(self, decision: int, state: Any) -> None:
        """Keep a state, and drop those of this decision and of later ones."""
        self.drop_from(decision)
        size = sum(leaf.nbytes for leaf in jax.tree.leaves(state) if isinstance(leaf, np.ndarray))
        self._kept.append(Kept(decision, state, size))
        bytes_, states = self._most
        total = sum(kept.size for kept in self._kept)
        while len(self._kept) > 1 and (total > bytes_ or len(self._kept) > states):
            total -= self._kept.pop(0).size

    def drop_from(self, decision: int) -> None:
        """Drop the states of this decision and of later ones."""
        while self._kept and self._kept[-1].decision >= decision:
            self._kept.pop()

    def before(self, decision: int) -> Kept:
        """The last state at or before a decision."""
        return next(kept for kept in reversed(self._kept) if kept.decision <= decision)

    @property
    def oldest(self) -> int:
        """The decision of the oldest state, or 0."""
        return self._kept[0].decision if self._kept else 0

    @property
    def newest(self) -> int:
        """The decision of the newest state, or 0."""
        return self._kept[-1].decision if self._kept else 0
