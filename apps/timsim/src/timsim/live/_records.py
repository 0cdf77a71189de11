"""Records of a run for the page: trails and learning curves of all bodies in view, and how often to sample."""

import time
from collections.abc import Mapping, Sequence
from typing import Any

from timsim.live._snapshot import (
    MAX_BODIES,
    CurveRecorder,
    Sample,
    SharedArrays,
    Sizes,
    Tally,
    TrailRecorder,
    part_of,
)

SAMPLES_PER_SECOND = 150.0  # decisions a second that are sampled one by one
STRETCH = 600  # decisions sampled in a row, after which a faster run pauses sampling
SPARSE_SAMPLES_PER_SECOND = 50.0  # of a faster run: sampling a decision takes as long as making one
CURVE_EVERY = 0.1  # s of wall time, at least, between two additions to the learning curves


class Records:
    """The trails and learning curves of the bodies in view.

    **Attributes:** `labels` of the bodies; the first is the one that learns.
    """

    def __init__(self, shared: Mapping[str, SharedArrays], sizes: Sizes, period: float, labels: Sequence[str]):
        rows = range(MAX_BODIES)
        self._trails = [TrailRecorder(shared[part_of("trail", row)], sizes, period, row) for row in rows]
        self._curves = [CurveRecorder(shared[part_of("curve", row)], sizes, period) for row in rows]
        self.labels = list(labels)
        self._counted = 0
        self._added = -float("inf")

    def label(self, labels: Sequence[str], tick: int) -> None:
        """Start trails and curves for bodies added beside the first; the others keep theirs."""
        if self.labels == labels:
            return
        saved = {label: curve.saved for label, curve in zip(self.labels[1:], self._curves[1:], strict=False)}
        for row, label in enumerate(labels[1:], 1):
            if self.labels[row : row + 1] != [label]:
                self._trails[row].drop_after(-1)
                self._curves[row].clear(tick)
                if label in saved:
                    self._curves[row].restore(saved[label])
        self.labels = list(labels)

    def add(self, tick: int, samples: Sequence[Sample]) -> None:
        """Add consecutive decisions to the trails, the last of which is `tick`."""
        for trail in self._trails[: len(self.labels)]:
            trail.add(tick, samples)

    def next_end(self, tick: int) -> int | None:
        """The next decision at which a known curve ends, after which decisions are new to it."""
        ends = [curve.end for curve in self._curves[: len(self.labels)] if curve.end > tick]
        return min(ends, default=None)

    def due(self, tick: int, now: float) -> bool:
        """Whether the means since the last addition are to be taken: for `count`."""
        curves = self._curves[: len(self.labels)]
        new = tick - self._counted >= curves[0].window and now - self._added >= CURVE_EVERY
        return new or (tick > self._counted and any(curve.end == tick for curve in curves))

    def count(self, tick: int, tallies: Sequence[Tally], frozen: bool, now: float) -> None:
        """Add the means since the last call to the curves, unless they are known."""
        for curve, tally in zip(self._curves, tallies, strict=False):
            if tick > curve.end:
                curve.add(tick, tally, frozen)
                self._added = now
        self._counted = tick

    def skip(self, tick: int) -> None:
        """Count from a decision on."""
        self._counted = tick

    def drop_trails_after(self, decision: int) -> None:
        """Drop what the trails have of later decisions; −1 for all."""
        for trail in self._trails:
            trail.drop_after(decision)

    def drop_after(self, decision: int, bodies: int) -> None:
        """Drop what the trails, and the curves of the first so many bodies, have of later decisions."""
        self.drop_trails_after(decision)
        for curve in self._curves[:bodies]:
            curve.drop_after(decision)

    def clear(self) -> None:
        """Drop everything."""
        self.drop_trails_after(-1)
        for curve in self._curves:
            curve.clear()
        self._counted = 0

    def saved_curves(self, bodies: int) -> list[Any]:
        """The curves of the first bodies, for `restore_curves`."""
        return [curve.saved for curve in self._curves[:bodies]]

    def restore_curves(self, saved: Sequence[Any], row: int = 0) -> None:
        """Put saved curves in place of those from a row on."""
        for curve, each in zip(self._curves[row:], saved, strict=False):
            curve.restore(each)


class SamplingBudget:
    """Which decisions are sampled one by one: all up to `SAMPLES_PER_SECOND`; of a faster run stretches of consecutive
    ones, on average `SPARSE_SAMPLES_PER_SECOND`.
    """

    def __init__(self) -> None:
        self._credit = float(STRETCH)
        self._then = time.perf_counter()
        self._on = True

    def take(self, decisions: int) -> int:
        """How many of the next decisions to sample."""
        now = time.perf_counter()
        rate = SAMPLES_PER_SECOND if self._on else SPARSE_SAMPLES_PER_SECOND
        self._credit = min(STRETCH, self._credit + rate * (now - self._then))
        self._then = now
        self._on = self._credit >= (min(decisions, STRETCH) if self._on else STRETCH)
        count = min(decisions, int(self._credit)) if self._on else 0
        self._credit -= count
        return count
