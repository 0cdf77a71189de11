"""The process in which a run is at home: it advances, obeys, tells what is to be seen, and waits for nobody."""

import signal
import time
from multiprocessing.connection import Connection
from typing import Any

import cloudpickle

from motorgrad.sim.live import _orders as orders
from motorgrad.sim.live._history import History
from motorgrad.sim.live._learner import Learner
from motorgrad.sim.live._pace import SLICE, Pace
from motorgrad.sim.live._passive import Passive
from motorgrad.sim.live._recorder import CurveRecorder, TrailRecorder
from motorgrad.sim.live._replies import reply
from motorgrad.sim.live._setup import Setup
from motorgrad.sim.live._shared import Shared
from motorgrad.sim.live._snapshot import ARRAYS, SCALARS, layout
from motorgrad.sim.live._subject import Look, Subject

FRAME = 1 / 30  # seconds of wall time between two snapshots
APART = 1.0  # seconds of wall time, at work, between two states kept
COUNT = 0.1  # seconds of wall time, at least, that go into the learning curve at once
LOOKS = 150.0  # decisions a second that are looked at one by one
STRETCH = 600.0  # decisions looked at in a row, after which a faster run has a pause from it
REFUSED = (ValueError, OSError, RuntimeError)


def work(pipe: Connection, payload: bytes) -> None:
    """The life of a worker: everything that is wrong at the beginning goes to the page, which tells the user."""
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
        said = " ".join(f"{type(error).__name__}: {error}".splitlines())
        pipe.send(reply(worker.subject.decision, f"the simulation broke: {said}", "error"))
    finally:
        worker.close()


class Worker:
    """One run: a subject, its pace, its history, and what of it is in shared memory."""

    def __init__(self, setup: Setup, pipe: Connection, playing: bool, speed: float):
        self.subject: Subject = Passive(setup) if setup.task is None else Learner(setup)
        self.pipe, self.playing = pipe, playing
        about = self.subject.about()
        pipe.send(about)
        names = pipe.recv()
        self._shared = {part: Shared(shapes, names[part]) for part, shapes in layout(about.sizes).items()}
        self._pace, self._watching, self._history = Pace(self.subject.period, speed), Watching(), History()
        self._trail = TrailRecorder(self._shared["trail"], about.sizes, self.subject.period)
        self._curve = CurveRecorder(self._shared["curve"], about.sizes, self.subject.period)
        self._told = dict(about.settings)
        self._framed = self._kept = self._counted = 0.0
        self._resets = self._newest = self._tallied = 0
        self._back = False  # put back to before the newest decision, and not gone on since
        self._keep()
        self._latest = self.subject.decision, self.subject.look()
        self._show()

    def run(self) -> None:
        """Work until the page says that it is over, or is no more."""
        while True:
            wait = self._wait()
            while self.pipe.poll(wait):
                wait, order = 0.0, self.pipe.recv()
                if order is None:
                    return
                self._obey(order)
            if self.playing and (count := self._pace.due()):
                self._advance(count)
            if time.perf_counter() - self._framed >= FRAME:
                self._show()

    def close(self) -> None:
        """Let go of the shared memory."""
        for block in self._shared.values():
            block.close()

    def _wait(self) -> float:
        """Seconds in which there is nothing to do but to listen."""
        until_frame = max(0.0, self._framed + FRAME - time.perf_counter())
        return min(self._pace.wait(), until_frame) if self.playing else until_frame

    def _advance(self, count: int, looked: int | None = None) -> None:
        """Make decisions; the first, as many as may be `looked` at one by one, go into the trail."""
        if self._back:
            self._branch()
        start, subject = time.perf_counter(), self.subject
        looked = self._watching.take(count) if looked is None else looked
        looks = self._watch(looked)
        if rest := count - looked:
            shown = start - self._framed >= FRAME - SLICE  # the next snapshot tells what came of the last decision
            subject.skip(rest - shown)
            looks = [subject.step()] if shown else []
        if looks:
            self._latest = subject.decision, looks[-1]
        self._newest = subject.decision
        if count:
            self._pace.made(count, time.perf_counter() - start)
        if subject.decision - self._tallied >= self._curve.window and start - self._counted >= COUNT:
            self._curve.add(subject.decision, subject.tally(), subject.frozen)
            self._tallied, self._counted = subject.decision, start
        if start - self._kept >= APART:
            self._keep()

    def _watch(self, count: int) -> list[Look]:
        looks = []
        for _ in range(count):
            looks.append(self.subject.step())
        self._trail.add(self.subject.decision, looks)
        return looks

    def _obey(self, order: Any) -> None:
        """Do what is asked, and tell what became of it."""
        subject, said, kind = self.subject, "", "change"
        try:
            match order:
                case orders.Play():
                    self.playing = True
                    self._pace.restart()
                case orders.Pause():
                    self.playing = False
                case orders.Step():
                    self.playing = False
                    looked = min(order.decisions, int(STRETCH))
                    self._advance(order.decisions - looked, 0)
                    self._advance(looked, looked)
                case orders.Speed():
                    self._pace = Pace(subject.period, order.factor)
                case orders.Scrub():
                    self._scrub(order.decision)
                    said = f"put back to decision {order.decision:,}"
                case orders.Reset():
                    self._reset()
                    said = "begun anew"
                case orders.Save():
                    subject.save(order.path)
                    said, kind = f"policy saved to {order.path}", "saved"
                case _:
                    said, kind = self._intervene(order)
        except REFUSED as error:
            said, kind = " ".join(str(error).splitlines()), "error"
        self._tell(said, kind)
        self._show()

    def _intervene(self, order: Any) -> tuple[str, str]:
        """Change what follows, and keep the state, from which the way back is the same again."""
        subject, kind = self.subject, "change"
        if self._back:
            self._branch()
        match order:
            case orders.Edit():
                before = subject.settings[order.name]
                subject.edit(order.name, order.value)
                said = f"{order.name}: {before:.6g} → {order.value:.6g}"
            case orders.Freeze() | orders.Thaw():
                subject.freeze(isinstance(order, orders.Freeze))
                said = "frozen: nothing is learnt" if subject.frozen else "thawed: learning goes on"
            case orders.Push():
                subject.push(order.body, order.force, order.seconds)
                force = ", ".join(f"{x:g}" for x in order.force)
                said = f"push of ({force}) N at {order.body} for {order.seconds:g} s"
            case orders.Compare():
                subject.compare(order.on)
                said = "an untrained body stands beside" if order.on else "the untrained body is gone"
            case orders.Load():
                subject.load(order.path, order.seed)
                said, kind = f"policy loaded from {order.path}", "loaded"
            case orders.Control():
                subject.control(order.actuator, order.value)
                said = ""
            case _:
                raise ValueError(f"unknown order {order!r}")
        self._keep()
        self._latest = subject.decision, subject.look()
        return said, kind

    def _keep(self) -> None:
        self._history.keep(self.subject.decision, self.subject.state)
        self._kept = time.perf_counter()

    def _scrub(self, decision: int) -> None:
        """Go to a decision: from the last state before it, the decisions up to it are made again."""
        subject, history = self.subject, self._history
        if not history.oldest <= decision <= self._newest:
            raise ValueError(f"decision = {decision}: must be from {history.oldest:,} to {self._newest:,}")
        if not self._back and subject.decision > history.newest:
            self._keep()
        kept = history.before(decision)
        subject.restore(kept.state)
        count = decision - kept.decision
        looked = min(count, int(STRETCH))
        subject.skip(count - looked)
        self._trail.drop_after(subject.decision)
        looks = self._watch(looked)
        subject.tally()  # what was counted again is in the curve
        self._latest = decision, looks[-1] if looks else subject.look()
        self.playing, self._back, self._tallied = False, decision < self._newest, decision
        self._resets += 1

    def _branch(self) -> None:
        """Go on from where it was put back: what came after is no longer what follows."""
        now = self.subject.decision
        self._history.drop_from(now + 1)
        self._trail.drop_after(now)
        self._curve.drop_after(now)
        self._back, self._newest = False, now

    def _reset(self) -> None:
        self.subject.begin_again()
        self._history.drop_from(0)
        self._trail.drop_after(-1)
        self._curve.clear()
        self._back, self._newest, self._tallied = False, 0, 0
        self._resets += 1
        self._keep()
        self._pace.restart()
        self._latest = 0, self.subject.look()

    def _tell(self, said: str, kind: str) -> None:
        """Tell what became of an order, and the settings that have changed."""
        changed = {name: x for name, x in self.subject.settings.items() if x != self._told[name]}
        if said or changed:
            fields = self.subject.fields if any(name.startswith("body.") for name in changed) else {}
            self.pipe.send(reply(self.subject.decision, said, kind, changed, fields))
            self._told |= changed

    def _show(self) -> None:
        """Put the present moment into shared memory."""
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


class Watching:
    """Which decisions are looked at one by one: all, up to so many a second; then stretches of consecutive ones."""

    def __init__(self) -> None:
        self._credit, self._then, self._on = STRETCH, time.perf_counter(), True

    def take(self, decisions: int) -> int:
        """How many of the next decisions to look at."""
        now = time.perf_counter()
        self._credit = min(STRETCH, self._credit + LOOKS * (now - self._then))
        self._then = now
        self._on = self._credit >= (min(decisions, STRETCH) if self._on else STRETCH)
        count = min(decisions, int(self._credit)) if self._on else 0
        self._credit -= count
        return count
