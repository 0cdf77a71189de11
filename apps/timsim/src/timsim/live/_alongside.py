"""Run another branch beside the current one, always at the same decision."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from motorgrad.pages import Playback
from timsim.live._beside import fitted
from timsim.live._branches import Course
from timsim.live._messages import Subject
from timsim.live._setup import Setup
from timsim.live._snapshot import Sample, Tally


class BranchBeside:
    """Runs a branch in its own subject: it repeats the branch's known decisions bit for bit, then continues.

    **Attributes:** `course`: the branch.
    """

    def __init__(self, course: Course, subject: Subject, playback: Playback[Subject], tick: int):
        assert course.line is not None
        self.course, self.subject = course, subject
        self.playback = playback.fork(subject)
        self.playback.follow(course.line, tick)

    def steps(self, count: int) -> list[Sample]:
        """Make decisions and sample each."""
        pieces = self.playback.advance(count, lambda ticks: [self.subject.step() for _ in range(ticks)])
        return [sample for piece in pieces for sample in piece]

    def advance(self, count: int) -> None:
        """Make decisions without sampling them."""
        self.playback.advance(count)

    def go_to(self, tick: int) -> None:
        """Go to the current branch's decision."""
        if tick != self.subject.tick:
            self.keep()
            self.playback.seek(tick)
            self.subject.tally()

    def keep(self) -> None:
        """Keep the current state, so that returning to it repeats nothing."""
        if self.playback.history.newest < self.subject.tick == self.playback.end:
            self.playback.keep()

    def tally(self) -> Tally:
        """The means of the branch's body since the last call."""
        return self.subject.tally()[0]

    def end(self, curves: Sequence[Any]) -> None:
        """Return the branch, with its new decisions and curves."""
        self.keep()
        self.course.line = self.playback.line
        self.course.curves = [*curves, *self.course.curves[1:]]

    @staticmethod
    def subject_of(setup: Setup, make: Callable[[Setup], Subject]) -> Subject:
        """A second subject of a setup. The two share nothing that either of them changes."""
        model: Any = setup.model
        return make(setup if model is None else dataclasses.replace(setup, model=copy.copy(model)))


def joined(sample: Sample, other: Sample) -> Sample:
    """A sample with the first body of another below it."""
    return {name: np.concatenate([rows, fitted(other[name][:1], rows)]) for name, rows in sample.items()}
