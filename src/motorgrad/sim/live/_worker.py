"""The worker process of a run: it advances the subject, obeys orders and publishes snapshots, and never waits."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

import logging
import signal
import time
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection

import cloudpickle
import mujoco
import numpy as np

from motorgrad._playback import Clock, Playback
from motorgrad.sim.live._bare_model import BareModel
from motorgrad.sim.live._learner import Learner
from motorgrad.sim.live._messages import (
    Event,
    Intervention,
    Order,
    Pause,
    Play,
    Reply,
    Reset,
    Save,
    Scrub,
    Speed,
    Step,
    Subject,
    Undo,
)
from motorgrad.sim.live._setup import Setup
from motorgrad.sim.live._snapshot import ARRAYS, SCALARS, CurveRecorder, Sample, SharedArrays, TrailRecorder, layout

FRAME = 1 / 30  # s of wall time between two snapshots
KEEP_EVERY = 1.0  # s of wall time at work between two states kept
CURVE_EVERY = 0.1  # s of wall time, at least, between two additions to the learning curve
SLICE = 1 / 60  # s of wall time between two samples at the pipe
LOOKS = 150.0  # decisions a second that are sampled one by one
FAR = 1e5  # m or rad, by which nothing moves after an intervention unless it was thrown
WATCHED = 60.0  # s of simulated time after an intervention
STRETCH = 600  # decisions sampled in a row, after which a faster run pauses sampling
REFUSED = (ValueError, OSError, RuntimeError)

log = logging.getLogger(__name__)


def work(pipe: Connection, payload: bytes) -> None:
    """Run a worker. What it does until it is ready is sent to the session in words; an error then is raised there."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the page, which ends this process
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
        told: Callable[[str], object] = lambda _: None,
    ):
        told("building the model" if setup.task is None else "building the learner")
        self.subject: Subject = BareModel(setup) if setup.task is None else Learner(setup)
        self.pipe = pipe
        told("starting the model" if setup.task is None else "compiling the learner")
        about = self.subject.about()
        pipe.send(about)
        names = pipe.recv()
        self._shared = {part: SharedArrays(shapes, names[part]) for part, shapes in layout(about.sizes).items()}
        self.clock, self._budget = Clock(self.subject.period, speed, SLICE), SamplingBudget()
        self.clock.playing = playing
        self.playback: Playback[Subject] = Playback(self.subject, lambda subject, order: order.apply(subject))
        self._trail = TrailRecorder(self._shared["trail"], about.sizes, self.subject.period)
        self._curve = CurveRecorder(self._shared["curve"], about.sizes, self.subject.period)
        self._sent = dict(about.settings)
        self._framed = self._counted = 0.0
        self._kept = time.perf_counter()
        self._resets = self._tallied = 0
        self._watched: tuple[int, np.ndarray, int] | None = None
        """Of the last intervention: its decision, the position, and how often the simulation had broken down."""
        self._latest = self.subject.tick, self.subject.sample()
        self._publish()

    def run(self) -> None:
        """Work until the page ends the run or is gone."""
        while True:
            wait = self._idle_time()
            while self.pipe.poll(wait):
                wait, order = 0.0, self.pipe.recv()
                if order is None:
                    return
                self.obey(order)
            if count := self.clock.due():
                self._advance(count)
            if time.perf_counter() - self._framed >= FRAME:
                self._publish()

    def close(self) -> None:
        """Detach from the shared memory."""
        for block in self._shared.values():
            block.close()

    def obey(self, order: Order) -> None:
        """Carry out an order and report the outcome."""
        subject, text, kind = self.subject, "", "change"
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
                    subject.save(order.path)
                    text, kind = "" if order.quiet else f"policy saved to {order.path}", "saved"
                case Undo():
                    text = f"took back: {self._undo()}"
                case Intervention():
                    if self.playback.history.before(subject.tick).tick < subject.tick:
                        self._keep()  # the state before, for `Undo`
                    text, kind = self.playback.change(order.resolve(subject)), order.kind
                    self._drop_after(subject.tick)
                    self._latest = subject.tick, subject.sample()
                    self._watched = subject.tick, self._latest[1]["position"].copy(), subject.diverged
                case _:
                    raise ValueError(f"unknown order {order!r}")
        except REFUSED as error:
            text, kind = " ".join(str(error).splitlines()), "error"
        changed = {name: x for name, x in subject.settings.items() if x != self._sent[name]}
        if text or changed:
            self.send(text, kind, changed)
            self._sent |= changed
        self._publish()

    def send(self, text: str, kind: str, settings: Mapping[str, float] = {}) -> None:
        """Report an event to the session, with the settings that changed."""
        self.pipe.send(Reply(Event(time.time(), self.subject.tick, text, kind), settings))

    def _idle_time(self) -> float:
        """Seconds until there is something to do but to listen."""
        until_frame = max(0.0, self._framed + FRAME - time.perf_counter())
        return min(self.clock.wait(), until_frame)

    def _advance(self, count: int, sampled: int | None = None) -> None:
        """Make decisions. The first `sampled`, by default as many as the budget allows, go into the trail."""
        if self.playback.tick < self.playback.end:  # the run continues from an earlier decision
            self.playback.forget()
            self._drop_after(self.subject.tick)
        start, subject = time.perf_counter(), self.subject
        sampled = self._budget.take(count) if sampled is None else sampled
        samples = self._sample(sampled)
        if rest := count - sampled:
            shown = start - self._framed >= FRAME - SLICE  # the next snapshot needs what the last decision led to
            self.playback.advance(rest - shown)
            samples = self._steps(1) if shown else []
        if samples:
            self._latest = subject.tick, samples[-1]
        if count:
            self.clock.record(count, time.perf_counter() - start)
        if subject.tick - self._tallied >= self._curve.window and start - self._counted >= CURVE_EVERY:
            self._curve.add(subject.tick, subject.tally(), subject.frozen)
            self._tallied, self._counted = subject.tick, start
        if start - self._kept >= KEEP_EVERY and self.playback.history.newest < subject.tick:
            self._keep()

    def _sample(self, count: int) -> list[Sample]:
        """Make decisions and record each in the trail."""
        samples = self._steps(count)
        self._trail.add(self.subject.tick, samples)
        return samples

    def _steps(self, count: int) -> list[Sample]:
        """Make decisions and sample each."""
        pieces = self.playback.advance(count, lambda ticks: [self.subject.step() for _ in range(ticks)])
        return [sample for piece in pieces for sample in piece]

    def _keep(self) -> None:
        self.playback.keep()
        self._kept = time.perf_counter()

    def _scrub(self, decision: int) -> None:
        """Go to a decision: restore the last state before it and repeat the decisions between."""
        subject, playback = self.subject, self.playback
        oldest = playback.history.oldest
        if not oldest <= decision <= playback.end:
            raise ValueError(f"decision = {decision}: must be from {oldest:,} to {playback.end:,}")
        if playback.history.newest < subject.tick == playback.end:
            self._keep()  # so that coming back repeats nothing
        playback.rewind(decision)
        count = decision - subject.tick
        sampled = min(count, STRETCH)
        playback.advance(count - sampled)
        self._trail.drop_after(subject.tick)
        samples = self._sample(sampled)
        subject.tally()  # the repeated decisions are in the curve already
        self._latest = decision, samples[-1] if samples else subject.sample()
        self.clock.pause()
        self._tallied, self._watched = decision, None
        self._resets += 1

    def _undo(self) -> str:
        """Go back to before the last intervention, pause there, and return its name."""
        what = self.playback.undo()
        self.subject.tally()
        self._drop_after(self.subject.tick)
        self._latest = self.subject.tick, self.subject.sample()
        self.clock.pause()
        self._tallied, self._watched = self.subject.tick, None
        self._resets += 1
        return type(what).__name__.lower()

    def _watch(self) -> None:
        """Pause, and tell of it, where an intervention has broken the simulation or thrown the body away."""
        if self._watched is None:
            return
        decision, position, diverged = self._watched
        subject, now = self.subject, self._latest[1]["position"]
        if subject.tick < decision or (subject.tick - decision) * subject.period > WATCHED:
            self._watched = None
            return
        moved = np.abs(now[0] - position[0]).max(initial=0.0)
        broken = subject.diverged > diverged or not np.isfinite(moved)
        if broken or moved > FAR:
            self._watched = None
            self.clock.pause()
            how = "the simulation broke down" if broken else f"the body was thrown away, by {moved:.1e} m or rad"
            self.send(f"{how} after decision {decision:,}; Undo goes back to before it", "lost")

    def _drop_after(self, decision: int) -> None:
        """Drop what the trail and the curve have of later decisions, after the known future was forgotten."""
        self._trail.drop_after(decision)
        self._curve.drop_after(decision)

    def _reset(self) -> None:
        self.subject.begin_again()
        self.playback.begin()
        self._trail.drop_after(-1)
        self._curve.clear()
        self._tallied, self._watched = 0, None
        self._resets += 1
        self.clock.restart()
        self._latest = 0, self.subject.sample()

    def _publish(self) -> None:
        """Write the present moment to shared memory."""
        subject = self.subject
        self._watch()
        seen, sample = self._latest
        if seen != subject.tick:
            sample = subject.sample()
        numbers: dict[str, float] = {
            "decision": subject.tick,
            "seconds": subject.tick * subject.period,
            "playing": self.clock.playing,
            "frozen": subject.frozen,
            "speed": self.clock.achieved(subject.tick),
            "reset_count": self._resets,
            "oldest": self.playback.history.oldest,
            "newest": self.playback.end,
            "bodies": len(sample["position"]),
        }
        with self._shared["moment"].writing() as arrays:
            for name, value in numbers.items():
                arrays[name][...] = value
            for name in (*ARRAYS, *SCALARS):
                arrays[name][: len(sample[name])] = sample[name]
        self._framed = time.perf_counter()


class SamplingBudget:
    """Which decisions are sampled one by one: all up to `LOOKS` a second, then stretches of consecutive ones."""

    def __init__(self) -> None:
        self._credit, self._then, self._on = float(STRETCH), time.perf_counter(), True

    def take(self, decisions: int) -> int:
        """How many of the next decisions to sample."""
        now = time.perf_counter()
        self._credit = min(STRETCH, self._credit + LOOKS * (now - self._then))
        self._then = now
        self._on = self._credit >= (min(decisions, STRETCH) if self._on else STRETCH)
        count = min(decisions, int(self._credit)) if self._on else 0
        self._credit -= count
        return count
