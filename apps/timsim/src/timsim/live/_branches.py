"""Branches of a run, which share a past: the orders for them, and the worker's record of them."""

from __future__ import annotations

import dataclasses
import itertools
import string
from collections.abc import Sequence
from typing import Any

from motorgrad._errors import check, unknown
from motorgrad.pages import MAX_PLAYBACK_BYTES, MAX_PLAYBACK_STATES, Line, Playback
from timsim.live._messages import Order, View
from timsim.live._replies import Branch
from timsim.live._snapshot import MAX_LABEL_CHARACTERS

MAX_BRANCHES = 12
"""Where there would be more, the oldest without a name of its own is dropped."""


class BranchOrder(Order):
    """An order about branches: the worker gives it to `Branches` and reports what they say."""


def _check_name(name: str) -> None:
    fine = isinstance(name, str) and 0 < len(name.strip()) <= MAX_LABEL_CHARACTERS and name == name.strip()
    check(fine, "name", name, f"a text of at most {MAX_LABEL_CHARACTERS} characters, without spaces around it")


def _check_known(name: str, session: View) -> None:
    names = [branch.name for branch in session.branches]
    if name not in names:
        raise unknown("branch", name, names)


@dataclasses.dataclass(frozen=True)
class Fork(BranchOrder):
    """Begin another branch at the present decision, or at another known one, and pause there. The branch that it
    leaves is kept as it is.

    **Arguments:** `name`: by default the next free letter; `decision`.
    """

    name: str | None = None
    decision: int | None = None

    def __post_init__(self) -> None:
        if self.name is not None:
            _check_name(self.name)

    def check(self, session: View) -> None:
        now = session.snapshot()
        names = [branch.name for branch in session.branches]
        check(self.name not in names, "name", self.name, "a new one")
        if self.decision is not None:
            known = now.oldest <= self.decision <= now.newest
            check(known, "decision", self.decision, f"from {now.oldest:,} to {now.newest:,}")


@dataclasses.dataclass(frozen=True)
class Switch(BranchOrder):
    """Go to the end of another branch and pause there; body, learner and settings are restored bit for bit."""

    name: str

    def check(self, session: View) -> None:
        _check_known(self.name, session)


@dataclasses.dataclass(frozen=True)
class Rename(BranchOrder):
    """Give a branch another name. One with a name of its own is not dropped to make room."""

    name: str
    to: str

    def __post_init__(self) -> None:
        _check_name(self.to)

    def check(self, session: View) -> None:
        _check_known(self.name, session)
        names = [branch.name for branch in session.branches]
        check(self.to == self.name or self.to not in names, "to", self.to, "a new name")


@dataclasses.dataclass(frozen=True)
class Delete(BranchOrder):
    """Delete a branch other than the present one."""

    name: str

    def check(self, session: View) -> None:
        _check_known(self.name, session)
        present = next(branch.name for branch in session.branches if branch.present)
        check(self.name != present, "branch", self.name, "another than the present one: switch first")


@dataclasses.dataclass(frozen=True)
class Alongside(BranchOrder):
    """Run another branch beside the current one, always at the same decision. None ends this.

    Both bodies are in the picture, and their metrics in the same charts. A branch that is shorter goes on.
    """

    name: str | None

    def check(self, session: View) -> None:
        if self.name is not None:
            _check_known(self.name, session)
            present = next(branch.name for branch in session.branches if branch.present)
            check(self.name != present, "branch", self.name, "another than the present one")


@dataclasses.dataclass(eq=False)
class Course:
    """A branch in the worker: its name, that of its `parent`, the decision at which it left that, and how many changes
    it has `inherited`. Of those that the run does not follow, `line` and `curves` are kept here.
    """

    name: str
    parent: str = ""
    start: int = 0
    inherited: int = 0
    named: bool = False
    line: Line | None = None
    curves: Sequence[Any] = ()

    def about(self, line: Line, present: bool, beside: bool) -> Branch:
        """What a session shows of it."""
        own = [change for change in line.log[self.inherited :] if change.said]
        edits = tuple((change.tick, str(change.said)) for change in own)
        return Branch(self.name, self.parent, self.start, line.end, edits, present, beside)


class Branches:
    """All branches of a run. The playback runs one of them, `now`; the others are kept.

    All of them together keep no more states than one would: the bounds of `motorgrad.pages` are shared out.
    """

    def __init__(self, playback: Playback[Any]):
        self._playback = playback
        self.now = Course("A")
        self._courses = [self.now]

    def __getitem__(self, name: str) -> Course:
        for course in self._courses:
            if course.name == name:
                return course
        raise unknown("branch", name, [course.name for course in self._courses])

    def __len__(self) -> int:
        return len(self._courses)

    def about(self, beside: Course | None, playback: Playback[Any] | None) -> tuple[Branch, ...]:
        """All branches, in the order of their making; `playback` runs the one `beside`."""
        lines = {id(self.now): self._playback.line} | ({} if playback is None else {id(beside): playback.line})
        return tuple(
            course.about(lines.get(id(course), course.line), course is self.now, course is beside)  # type: ignore[arg-type]
            for course in self._courses
        )

    def leave(self, curves: Sequence[Any]) -> Course:
        """The present branch as it is now, to be kept by `begin` if another one begins."""
        return dataclasses.replace(self.now, line=self._playback.line, curves=curves)

    def begin(self, left: Course, start: int, name: str | None = None, keep: Course | None = None) -> None:
        """Begin a branch at a decision of the one that is `left`. The one to `keep` is not dropped to make room."""
        self._courses[self._courses.index(self.now)] = left
        used = {course.name for course in self._courses}
        fresh = name or next(each for each in _names() if each not in used)
        before = [] if left.line is None else left.line.log
        log = self._playback.line.log
        shared = itertools.takewhile(lambda pair: pair[0] is pair[1], zip(before, log, strict=False))
        self.now = Course(fresh, left.name, start, sum(1 for _ in shared), named=name is not None)
        self._courses.append(self.now)
        while len(self._courses) > MAX_BRANCHES:
            others = [course for course in self._courses if course not in (self.now, keep, left)]
            self._courses.remove(next((course for course in others if not course.named), others[0]))
        self._share()

    def switch(self, name: str, curves: Sequence[Any], back: int) -> Course:
        """Let the playback go to so many decisions before the end of another branch, which is returned; its curves are
        to be restored."""
        course = self[name]
        left = self.leave(curves)
        check(course is not self.now, "branch", name, "another than the present one")
        assert course.line is not None
        self._courses[self._courses.index(self.now)] = left
        self.now = course
        line = course.line
        course.line = None
        self._playback.follow(line, max(line.end - back, line.history.oldest))
        self._share()
        return course

    def rename(self, name: str, to: str) -> None:
        """Give a branch another name."""
        course = self[name]
        check(to == name or to not in {each.name for each in self._courses}, "to", to, "a new name")
        for each in self._courses:
            if each.parent == name:
                each.parent = to
        course.name = to
        course.named = True

    def delete(self, name: str) -> None:
        """Delete a branch other than the present one."""
        course = self[name]
        check(course is not self.now, "branch", name, "another than the present one: switch first")
        self._courses.remove(course)
        for each in self._courses:
            if each.parent == name:
                each.parent = course.parent
                each.start = min(each.start, course.start)
        self._share()

    def _share(self) -> None:
        """Share out the bounds of kept states among all branches."""
        count = len(self._courses)
        for history in [self._playback.history, *(each.line.history for each in self._courses if each.line)]:
            history.limit(max(MAX_PLAYBACK_STATES // count, 2), MAX_PLAYBACK_BYTES // count)


def _names() -> itertools.chain[str]:
    """A, B, …, Z, A1, B1, …"""
    letters = string.ascii_uppercase
    return itertools.chain(letters, (f"{letter}{number}" for number in itertools.count(1) for letter in letters))
