"""The worker process of a run: it advances the subject, obeys orders and publishes snapshots, and never waits."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

import logging
import time
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from typing import Any

import cloudpickle
import mujoco
import numpy as np

from motorgrad._signals import leave_to_parent
from motorgrad.pages import Clock, Playback
from timsim.live._alongside import BranchBeside, joined
from timsim.live._bare_model import BareModel
from timsim.live._branches import Alongside, Branches, BranchOrder, Course, Delete, Fork, Rename, Switch
from timsim.live._intervention_guard import InterventionGuard
from timsim.live._learner import Learner
from timsim.live._messages import (
    Intervention,
    Look,
    Order,
    Pause,
    Play,
    Reset,
    Save,
    Scrub,
    Speed,
    Step,
    Subject,
    Undo,
)
from timsim.live._motion_player import MotionPlayer
from timsim.live._records import STRETCH, Records, SamplingBudget
from timsim.live._replies import Event, Reply
from timsim.live._setup import Setup
from timsim.live._snapshot import ARRAYS, SCALARS, Sample, SharedArrays, Tally, encoded, layout

FRAME = 1 / 30  # s of wall time between two snapshots
FAST = 4.0  # times real time; at more, half as many snapshots do: the eye does not connect their postures
KEEP_EVERY = 1.0  # s of wall time at work between two states kept
SLICE = 1 / 60  # s of wall time between two looks at the pipe
REFUSED = (ValueError, OSError, RuntimeError)

log = logging.getLogger(__name__)


def work(pipe: Connection, payload: bytes) -> None:
    """Run a worker. What it does until it is ready is sent to the session in words; an error then is raised there."""
    leave_to_parent()
    mujoco.set_mju_user_warning(log.debug)  # by default MuJoCo writes a file into the user's folder
    try:
        setup, playing, speed = cloudpickle.loads(payload)
        worker = Worker(setup, pipe, playing, speed, pipe.send)
    except Exception as error:
        pipe.send(error if isinstance(error, REFUSED) else RuntimeError(f"{type(error).__name__}: {error}"))
        return
    try:
        worker.run()
    except (EOFError, OSError):  # the page is gone
        pass
    except Exception as error:
        worker.send("simulation failed: " + " ".join(f"{type(error).__name__}: {error}".splitlines()), "error")
    finally:
        worker.close()


class Worker:
    """One run: a subject with its clock, its playback, and its snapshots, trail and curve in shared memory."""

    def __init__(
        self,
        setup: Setup,
        pipe: Connection,
        playing: bool,
        speed: float,
        report: Callable[[str], object] = lambda _: None,
    ):
        report("building the model" if setup.task is None else "building the learner")
        self._setup, self.pipe = setup, pipe
        self.subject = self._subject(setup)
        report("starting the model" if setup.task is None else "compiling the learner")
        about = self.subject.about()
        pipe.send(about)
        names = pipe.recv()
        self._shared = {part: SharedArrays(shapes, names[part]) for part, shapes in layout(about.sizes).items()}
        self.clock = Clock(self.subject.period, speed, SLICE)
        self._budget = SamplingBudget()
        self.clock.playing = playing
        self.playback: Playback[Subject] = Playback(self.subject, lambda subject, order: order.apply(subject))
        self.branches = Branches(self.playback)
        self.beside: BranchBeside | None = None
        """Another branch that runs beside the present one."""
        self._spare: Subject | None = None  # for another branch, once one was made
        self.records = Records(self._shared, about.sizes, self.subject.period, self.subject.labels)
        self._sent = dict(about.settings)
        self._framed = 0.0
        self._frame = FRAME
        self._kept = time.perf_counter()
        self._resets = 0
        self._guard = InterventionGuard()
        self._latest = self.subject.tick, self._sampled()
        self._sent_branches: object = None
        self._broken = False  # whether the learner's parameters are not finite
        self._publish()
        self._tell_branches()

    @staticmethod
    def _subject(setup: Setup) -> Subject:
        if setup.task is not None:
            return Learner(setup)
        return BareModel(setup) if setup.motion is None else MotionPlayer(setup)

    @property
    def labels(self) -> list[str]:
        """Of the bodies in view: while branches are compared, by the names of these."""
        labels = self.subject.labels
        return labels if self.beside is None else [self.branches.now.name, *labels[1:], self.beside.course.name]

    def run(self) -> None:
        """Work until the page ends the run or is gone."""
        while True:
            wait = self._idle_time()
            while self.pipe.poll(wait):
                wait = 0.0
                order = self.pipe.recv()
                if order is None:
                    return
                self.obey(order)
            if count := self.clock.due():
                self._advance(count)
            if time.perf_counter() - self._framed >= self._frame:
                self._publish()

    def close(self) -> None:
        """Detach from the shared memory."""
        for block in self._shared.values():
            block.close()

    def obey(self, order: Order) -> None:
        """Carry out an order and report the outcome."""
        subject = self.subject
        text = ""
        kind = "change"
        try:
            match order:
                case Play():
                    self.clock.play()
                case Pause():
                    self.clock.pause()
                case Step():
                    self.clock.pause()
                    sampled = min(order.decisions, STRETCH)
                    self._advance(order.decisions - sampled, 0)
                    self._advance(sampled, sampled)
                case Speed():
                    self.clock.speed = order.factor
                case Scrub():
                    self._scrub(order.decision)
                    text = f"went to decision {order.decision:,}"
                case Reset():
                    self._reset()
                    text = "reset to the start"
                case Save():
                    try:
                        subject.save(order.path)
                    except REFUSED as error:
                        raise RuntimeError(f"{order.not_saved}: {error}") from None
                    text = "" if order.quiet else order.saved
                    kind = "saved"
                case Look():
                    self.pipe.send(subject.picture())
                    return
                case Undo():
                    text = f"took back: {self._undo()}"
                case BranchOrder():
                    text = self._branch(order)
                case Intervention():
                    if self.playback.history.before(subject.tick).tick < subject.tick:
                        self._keep()  # the state before, for `Undo`
                    ahead = subject.tick < self.playback.end
                    left = self.branches.leave(self._saved_curves) if ahead else None
                    text = self.playback.change(order.resolve(subject))
                    kind = order.kind
                    if left is not None:
                        self._begin_branch(left)
                    self._drop_after(subject.tick)
                    self._latest = subject.tick, self._sampled()
                    self._guard.begin(subject, self._latest[1])
                case _:
                    raise ValueError(f"unknown order {order!r}")
        except REFUSED as error:
            text = " ".join(str(error).splitlines())
            kind = "error"
        changed = {name: x for name, x in subject.settings.items() if x != self._sent[name]}
        if text or changed:
            self.send(text, kind, changed)
            self._sent |= changed
        self._tell_branches()
        self._publish()

    def send(self, text: str, kind: str, settings: Mapping[str, float] = {}) -> None:
        """Report an event to the session, with the settings that changed."""
        self.pipe.send(Reply(Event(time.time(), self.subject.tick, text, kind), settings))

    def _idle_time(self) -> float:
        """Seconds until the worker has something to do besides listening."""
        until_frame = max(0.0, self._framed + self._frame - time.perf_counter())
        return min(self.clock.wait(), until_frame)

    def _advance(self, count: int, sampled: int | None = None) -> None:
        """Make decisions. The first `sampled`, by default as many as the budget allows, go into the trails."""
        if self.playback.tick < self.playback.end and self.playback.has_later_changes:
            # the run goes on from an earlier decision without what was changed after it
            left = self.branches.leave(self._saved_curves)
            self.playback.forget()
            self._begin_branch(left)
            self._drop_after(self.subject.tick)
            self._tell_branches()
        sampled = self._budget.take(count) if sampled is None else sampled
        last = self.subject.tick + count
        while (end := self.records.next_end(self.subject.tick)) is not None and end < last:
            first = end - self.subject.tick  # what is known of a curve is not added again: stop where it ends
            self._make(first, min(first, sampled))
            sampled = max(0, sampled - first)
        self._make(last - self.subject.tick, sampled)

    def _make(self, count: int, sampled: int) -> None:
        """Make decisions, and add to the trails, to the curves and to the states kept."""
        start = time.perf_counter()
        subject = self.subject
        samples = self._sample(sampled)
        if rest := count - sampled:
            shown = start - self._framed >= self._frame - SLICE  # the next snapshot needs what the last decision led to
            self.playback.advance(rest - shown)
            if self.beside is not None:
                self.beside.advance(rest - shown)
            samples = self._steps(1) if shown else []
        if samples:
            self._latest = subject.tick, samples[-1]
        if count:
            self.clock.record(count, time.perf_counter() - start)
        if self.records.due(subject.tick, start):
            self.records.count(subject.tick, self._tallies(), subject.frozen, start)
        if start - self._kept >= KEEP_EVERY and self.playback.history.newest < subject.tick:
            self._keep()

    def _sample(self, count: int) -> list[Sample]:
        """Make decisions and record each in the trails."""
        samples = self._steps(count)
        self.records.add(self.subject.tick, samples)
        return samples

    def _steps(self, count: int) -> list[Sample]:
        """Make decisions and sample each."""
        pieces = self.playback.advance(count, lambda ticks: [self.subject.step() for _ in range(ticks)])
        samples = [sample for piece in pieces for sample in piece]
        if self.beside is None:
            return samples
        return [joined(*each) for each in zip(samples, self.beside.steps(count), strict=True)]

    def _sampled(self) -> Sample:
        """The present moment of all bodies in view."""
        sample = self.subject.sample()
        return sample if self.beside is None else joined(sample, self.beside.subject.sample())

    def _tallies(self) -> list[Tally]:
        """The means of all bodies in view since the last call."""
        return self.subject.tally() + ([] if self.beside is None else [self.beside.tally()])

    @property
    def _saved_curves(self) -> list[Any]:
        """The curves of the subject's bodies."""
        return self.records.saved_curves(len(self.subject.labels))

    def _branch(self, order: BranchOrder) -> str:
        """Carry out an order about branches. **Returns** what to say of it."""
        branches = self.branches
        match order:
            case Fork():
                if order.decision is not None:
                    self._scrub(order.decision)
                self.clock.pause()
                self._keep()
                left = branches.leave(self._saved_curves)
                self.playback.forget()
                self._begin_branch(left, order.name)
                self._drop_after(self.subject.tick)
                return f"branch {branches.now.name!r} begun at decision {self.subject.tick:,}"
            case Switch():
                if self.beside is not None and self.beside.course is branches[order.name]:
                    self._run_beside(None)
                if self.playback.history.newest < self.subject.tick == self.playback.end:
                    self._keep()
                course = branches.switch(order.name, self._saved_curves, STRETCH)
                self.records.label(self.labels, self.subject.tick)
                self.records.restore_curves(course.curves[: len(self.subject.labels)])
                self.records.drop_trails_after(-1)
                self._arrive(self.playback.end)
                return f"went to branch {order.name!r}"
            case Rename():
                branches.rename(order.name, order.to)
                return f"branch {order.name!r} renamed to {order.to!r}"
            case Delete():
                if self.beside is not None and self.beside.course is branches[order.name]:
                    self._run_beside(None)
                branches.delete(order.name)
                return f"branch {order.name!r} deleted"
            case Alongside():
                self._run_beside(order.name)
                return "no other branch beside" if order.name is None else f"branch {order.name!r} runs beside"
            case _:
                raise ValueError(f"unknown order {order!r}")

    def _begin_branch(self, left: Course, name: str | None = None) -> None:
        """Begin another branch at the present decision of the one that is left."""
        self.branches.begin(left, self.subject.tick, name, None if self.beside is None else self.beside.course)

    def _run_beside(self, name: str | None) -> None:
        """Run a branch beside the present one, or none."""
        course = None if name is None else self.branches[name]
        if course is self.branches.now:
            raise ValueError(f"branch = {name!r}: must be another than the present one")
        if self.beside is not None:
            self.beside.end(self.records.saved_curves(len(self.records.labels))[-1:])
            self.beside = None
        if course is not None:
            if self._spare is None:
                self._spare = BranchBeside.subject_of(self._setup, self._subject)
            self.beside = BranchBeside(course, self._spare, self.playback, self.subject.tick)
        self.records.label(self.labels, self.subject.tick)
        if course is not None:
            self.records.restore_curves(course.curves[:1], len(self.labels) - 1)
        self._latest = self.subject.tick, self._sampled()

    def _tell_branches(self) -> None:
        """Send the branches to the session if any has changed."""
        beside = self.beside
        now = self.branches.about(*((None, None) if beside is None else (beside.course, beside.playback)))
        if (branches := [branch._replace(end=0) for branch in now]) != self._sent_branches:
            self._sent_branches = branches
            self.pipe.send(Reply(Event(time.time(), self.subject.tick, "", "change"), {}, now))

    def _keep(self) -> None:
        self.playback.keep()
        if self.beside is not None:
            self.beside.keep()
        self._kept = time.perf_counter()

    def _scrub(self, decision: int) -> None:
        """Go to a decision: restore the last state before it and repeat the decisions between."""
        subject, playback = self.subject, self.playback
        oldest = playback.history.oldest
        if not oldest <= decision <= self._newest:
            raise ValueError(f"decision = {decision}: must be from {oldest:,} to {self._newest:,}")
        if playback.history.newest < subject.tick == playback.end:
            self._keep()  # so that coming back repeats nothing
        playback.rewind(decision)
        self._arrive(decision)

    def _arrive(self, decision: int) -> None:
        """Arrive at a decision, with the trails that led to it, and pause."""
        subject, playback = self.subject, self.playback
        count = decision - subject.tick
        sampled = min(count, STRETCH)
        playback.advance(count - sampled)
        if self.beside is not None:
            self.beside.go_to(subject.tick)
        self.records.label(self.labels, self.subject.tick)
        self.records.drop_trails_after(subject.tick)
        samples = self._sample(sampled)
        self._tallies()  # the repeated decisions are in the curves already
        self._latest = decision, samples[-1] if samples else self._sampled()
        self._come_to(decision)

    def _come_to(self, decision: int) -> None:
        """Pause at a decision that was reached by a jump."""
        self.clock.pause()
        self.records.skip(decision)
        self._guard.forget()
        self._resets += 1

    @property
    def _newest(self) -> int:
        """The last decision that the run can go to."""
        return max(self.playback.end, self.subject.horizon)

    def _undo(self) -> str:
        """Go back to just before the last intervention, pause, and return its name."""
        what = self.playback.undo()
        now = self.branches.now
        now.start = min(now.start, self.subject.tick)
        if self.beside is not None:
            self.beside.go_to(self.subject.tick)
        self._tallies()
        self.records.label(self.labels, self.subject.tick)
        self._drop_after(self.subject.tick)
        self._latest = self.subject.tick, self._sampled()
        self._come_to(self.subject.tick)
        return type(what).__name__.lower()

    def _drop_after(self, decision: int) -> None:
        """Drop what trails and curves have of later decisions, after the known future was forgotten; what another
        branch has stays."""
        self.records.label(self.labels, self.subject.tick)
        self.records.drop_after(decision, len(self.subject.labels))

    def _reset(self) -> None:
        self._run_beside(None)
        if self.playback.history.newest < self.subject.tick == self.playback.end:
            self._keep()
        left = self.branches.leave(self._saved_curves)
        self.subject.begin_again()
        self.playback.begin()
        if left.line is not None and left.line.end:
            self.branches.begin(left, 0)
            self.branches.now.parent = ""
        self.records.label(self.labels, 0)
        self.records.clear()
        self._guard.forget()
        self._resets += 1
        self.clock.restart()
        self._latest = 0, self._sampled()

    def _publish(self) -> None:
        """Write the present moment to shared memory."""
        subject = self.subject
        if problem := self._guard.problem(subject, self._latest[1]):
            self.clock.pause()
            self.send(problem, "lost")
        seen, sample = self._latest
        if seen != subject.tick:
            sample = self._sampled()
        broken = not np.isfinite(sample["parameters"][0]).all()
        if broken and not self._broken:
            self.clock.pause()
            message = f"parameters not finite by decision {subject.tick:,}: nothing is learned, and rewards are unknown"
            self.send(f"{message}; Undo, or reset with a lower learning rate", "lost")
        self._broken = broken
        numbers: dict[str, float] = {
            "decision": subject.tick,
            "seconds": subject.tick * subject.period,
            "playing": self.clock.playing,
            "frozen": subject.frozen,
            "speed": self.clock.achieved(subject.tick),
            "reset_count": self._resets,
            "oldest": self.playback.history.oldest,
            "newest": self._newest,
            "bodies": len(sample["position"]),
        }
        with self._shared["moment"].writing() as arrays:
            for name, value in numbers.items():
                arrays[name][...] = value
            for name in (*ARRAYS, *SCALARS):
                arrays[name][: len(sample[name])] = sample[name]
            arrays["labels"][: len(self.records.labels)] = encoded(self.records.labels)
        self._framed = time.perf_counter()
        self._frame = 2 * FRAME if numbers["speed"] > FAST else FRAME  # the learner gets the time that is spared
