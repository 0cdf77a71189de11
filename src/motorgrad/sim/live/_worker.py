"""The worker process of a run: it advances the subject, obeys orders and publishes snapshots, and never waits."""

import signal
import time
from collections.abc import Mapping
from multiprocessing.connection import Connection

import cloudpickle
import numpy as np

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
)
from motorgrad.sim.live._playback import SLICE, STRETCH, History, Pace, SamplingBudget
from motorgrad.sim.live._setup import Setup
from motorgrad.sim.live._snapshot import ARRAYS, SCALARS, CurveRecorder, Look, SharedArrays, TrailRecorder, layout

FRAME = 1 / 30  # s of wall time between two snapshots
KEEP_EVERY = 1.0  # s of wall time at work between two states kept
CURVE_EVERY = 0.1  # s of wall time, at least, between two additions to the learning curve
REFUSED = (ValueError, OSError, RuntimeError)


def work(pipe: Connection, payload: bytes) -> None:
    """Run a worker. An error at the start is sent to the session, which raises it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the page, which ends this process
    try:
        setup, playing, speed = cloudpickle.loads(payload)
        worker = Worker(setup, pipe, playing, speed)
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
    """One run: a subject with its pace, its history, and its snapshots, trail and curve in shared memory."""

    def __init__(self, setup: Setup, pipe: Connection, playing: bool, speed: float):
        self.subject: Subject = BareModel(setup) if setup.task is None else Learner(setup)
        self.pipe, self.playing = pipe, playing
        about = self.subject.about()
        pipe.send(about)
        names = pipe.recv()
        self._shared = {part: SharedArrays(shapes, names[part]) for part, shapes in layout(about.sizes).items()}
        self._pace, self._budget, self._history = Pace(self.subject.period, speed), SamplingBudget(), History()
        self._trail = TrailRecorder(self._shared["trail"], about.sizes, self.subject.period)
        self._curve = CurveRecorder(self._shared["curve"], about.sizes, self.subject.period)
        self._sent = dict(about.settings)
        self._framed = self._kept = self._counted = 0.0
        self._resets = self._newest = self._tallied = 0
        self._rewound = False  # set back to before the newest decision, and not continued since
        self._keep()
        self._latest = self.subject.decision, self.subject.look()
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
            if self.playing and (count := self._pace.due()):
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
                    self.playing = True
                    self._pace.restart()
                case Pause():
                    self.playing = False
                case Step():
                    self.playing = False
                    sampled = min(order.decisions, int(STRETCH))
                    self._advance(order.decisions - sampled, 0)
                    self._advance(sampled, sampled)
                case Speed():
                    self._pace = Pace(subject.period, order.factor)
                case Scrub():
                    self._scrub(order.decision)
                    text = f"went to decision {order.decision:,}"
                case Reset():
                    self._reset()
                    text = "reset to the start"
                case Save():
                    subject.save(order.path)
                    text, kind = f"policy saved to {order.path}", "saved"
                case Intervention():
                    self._branch()
                    text, kind = order.apply(subject), order.kind
                    self._keep()  # going back reproduces what follows from here
                    self._latest = subject.decision, subject.look()
                case _:
                    raise ValueError(f"unknown order {order!r}")
        except REFUSED as error:
            text, kind = " ".join(str(error).splitlines()), "error"
        changed = {name: x for name, x in subject.settings.items() if x != self._sent[name]}
        if text or changed:
            self.send(text, kind, changed, subject.fields if any(name.startswith("body.") for name in changed) else {})
            self._sent |= changed
        self._publish()

    def send(
        self, text: str, kind: str, settings: Mapping[str, float] = {}, fields: Mapping[str, np.ndarray] = {}
    ) -> None:
        """Report an event to the session, with the settings and the arrays of the model that changed."""
        self.pipe.send(Reply(Event(time.time(), self.subject.decision, text, kind), settings, fields))

    def _idle_time(self) -> float:
        """Seconds until there is something to do but to listen."""
        until_frame = max(0.0, self._framed + FRAME - time.perf_counter())
        return min(self._pace.wait(), until_frame) if self.playing else until_frame

    def _advance(self, count: int, sampled: int | None = None) -> None:
        """Make decisions. The first `sampled`, by default as many as the budget allows, go into the trail."""
        self._branch()
        start, subject = time.perf_counter(), self.subject
        sampled = self._budget.take(count) if sampled is None else sampled
        looks = self._sample(sampled)
        if rest := count - sampled:
            shown = start - self._framed >= FRAME - SLICE  # the next snapshot needs what the last decision led to
            subject.skip(rest - shown)
            looks = [subject.step()] if shown else []
        if looks:
            self._latest = subject.decision, looks[-1]
        self._newest = subject.decision
        if count:
            self._pace.made(count, time.perf_counter() - start)
        if subject.decision - self._tallied >= self._curve.window and start - self._counted >= CURVE_EVERY:
            self._curve.add(subject.decision, subject.tally(), subject.frozen)
            self._tallied, self._counted = subject.decision, start
        if start - self._kept >= KEEP_EVERY:
            self._keep()

    def _sample(self, count: int) -> list[Look]:
        """Make decisions and record each in the trail."""
        looks = [self.subject.step() for _ in range(count)]
        self._trail.add(self.subject.decision, looks)
        return looks

    def _keep(self) -> None:
        self._history.keep(self.subject.decision, self.subject.state)
        self._kept = time.perf_counter()

    def _scrub(self, decision: int) -> None:
        """Go to a decision: restore the last state before it and repeat the decisions between."""
        subject, history = self.subject, self._history
        if not history.oldest <= decision <= self._newest:
            raise ValueError(f"decision = {decision}: must be from {history.oldest:,} to {self._newest:,}")
        if not self._rewound and subject.decision > history.newest:
            self._keep()
        kept = history.before(decision)
        subject.restore(kept.state)
        count = decision - kept.decision
        sampled = min(count, int(STRETCH))
        subject.skip(count - sampled)
        self._trail.drop_after(subject.decision)
        looks = self._sample(sampled)
        subject.tally()  # the repeated decisions are in the curve already
        self._latest = decision, looks[-1] if looks else subject.look()
        self.playing, self._rewound, self._tallied = False, decision < self._newest, decision
        self._resets += 1

    def _branch(self) -> None:
        """Before the run continues from an earlier decision, forget what came after it."""
        if not self._rewound:
            return
        now = self.subject.decision
        self._history.drop_from(now + 1)
        self._trail.drop_after(now)
        self._curve.drop_after(now)
        self._rewound, self._newest = False, now

    def _reset(self) -> None:
        self.subject.begin_again()
        self._history.drop_from(0)
        self._trail.drop_after(-1)
        self._curve.clear()
        self._rewound, self._newest, self._tallied = False, 0, 0
        self._resets += 1
        self._keep()
        self._pace.restart()
        self._latest = 0, self.subject.look()

    def _publish(self) -> None:
        """Write the present moment to shared memory."""
        subject, history = self.subject, self._history
        seen, look = self._latest
        if seen != subject.decision:
            look = subject.look()
        numbers: dict[str, float] = {
            "decision": subject.decision,
            "seconds": subject.decision * subject.period,
            "playing": self.playing,
            "frozen": subject.frozen,
            "speed": self._pace.achieved(subject.decision) if self.playing else 0.0,
            "reset_count": self._resets,
            "oldest": history.oldest,
            "newest": self._newest,
            "bodies": len(look["position"]),
        }
        with self._shared["moment"].writing() as arrays:
            for name, value in numbers.items():
                arrays[name][...] = value
            for name in (*ARRAYS, *SCALARS):
                arrays[name][: len(look[name])] = look[name]
        self._framed = time.perf_counter()
