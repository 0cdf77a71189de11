"""A run as a page knows it: snapshots to look at, orders to give."""

import atexit
import contextlib
import multiprocessing
import sys
import threading
import time
import types
from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple, Self

import cloudpickle
import jax
import numpy as np

from motorgrad._errors import check, unknown
from motorgrad.sim.live._orders import Control, Edit, Order, Push, Scrub
from motorgrad.sim.live._replies import Ready, Reply
from motorgrad.sim.live._setup import Setup
from motorgrad.sim.live._shared import Shared
from motorgrad.sim.live._snapshot import ARRAYS, COUNTS, SCALARS, Curve, Sizes, Snapshot, Trail, layout
from motorgrad.sim.live._worker import work

START = 300.0  # seconds in which a worker must be ready; a large learner is compiled in some ten
KEPT = 10_000  # events that nobody has read


class Event(NamedTuple):
    """What became of an order, or what happened by itself.

    - `wall`: time of the day, s since the epoch; `decision` at which it happened.
    - `kind`: `"change"`, `"error"`, `"saved"`, `"loaded"`, or `"ended"` where the worker is no more.
    - `text`: one line.
    """

    wall: float
    decision: int
    text: str
    kind: str


class Session:
    """A run in a process of its own, which goes on whether or not anyone looks.

    **Arguments:** `setup`; `playing`, whether it begins at once; `speed`, simulated seconds per second of wall time.

    **Attributes:**

    - `model`: the `mujoco.MjModel` of the body in view, with edits of muscles applied; None for worlds in JAX.
    - `task`, `agent`, `policy_shape` (one seed's policy, of shapes): None for a model without a learner.
    - `observations`, `actions`, `muscles` (the model's actuators), `feet`, `readings` (of the task): their names.
    - `period`: simulated seconds of a decision.
    - `settings`: what `Edit` can change, by name, with its present value.
    - `log`: the last events, whether or not they were asked for.

    **Raises** `ValueError` or `RuntimeError` with the worker's own line where it cannot begin.
    """

    def __init__(self, setup: Setup, *, playing: bool = True, speed: float = 1.0):
        self.setup, self.name = setup, setup.name
        self.model, self.task, self.agent = setup.model, setup.task, setup.agent
        self.policy_shape: Any = None
        if setup.agent is not None:
            self.policy_shape = jax.eval_shape(setup.agent.init, jax.random.key(0)).policy
        self._events: deque[Event] = deque(maxlen=KEPT)
        self.log: deque[Event] = deque(maxlen=KEPT)
        self._ended = threading.Event()
        self._lock = threading.Lock()
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        payload = cloudpickle.dumps((setup, playing, speed))
        self._process = context.Process(target=work, args=(theirs, payload), name="motorgrad sim", daemon=True)
        with _bare_main():
            self._process.start()
        theirs.close()
        ready = self._first()
        self.sizes: Sizes = ready.sizes
        self.period, self.settings = ready.period, dict(ready.settings)
        self.observations, self.actions, self.muscles = ready.observations, ready.actions, ready.muscles
        self.feet, self.readings = ready.feet, ready.readings
        self._shared = {part: Shared(shapes) for part, shapes in layout(self.sizes).items()}
        self._pipe.send({part: block.name for part, block in self._shared.items()})
        self._await_first_snapshot()
        self._listener = threading.Thread(target=self._listen, name="motorgrad sim events", daemon=True)
        self._listener.start()
        atexit.register(self.close)

    def snapshot(self) -> Snapshot:
        """The present moment. **Raises** `RuntimeError` once the session is closed."""
        found = self._read("moment")
        bodies = int(found["bodies"])
        values: dict[str, Any] = {name: found[name][:bodies] for name in (*ARRAYS, *SCALARS)}
        values |= {name: int(found[name]) for name in COUNTS}
        values |= {name: bool(found[name]) for name in ("playing", "frozen")}
        return Snapshot(**values, seconds=float(found["seconds"]), speed=float(found["speed"]))

    def trail(self) -> Trail:
        """The last decisions, oldest first."""
        found = self._read("trail")
        count, place, room = int(found.pop("count")), int(found.pop("next")), self.sizes.trail
        rows = (np.arange(count) + place - count) % room
        decision = found.pop("decision")[rows].astype(np.int64)
        return Trail(decision=decision, **{name: array[rows] for name, array in found.items()})

    def curve(self) -> Curve:
        """The learning curve so far."""
        found = self._read("curve")
        count = int(found["count"])
        decision, seconds, frozen = (found[name][:count] for name in ("decision", "seconds", "frozen"))
        names = ("reward", *self.readings)
        values = {name: row[:count] for name, row in zip(names, found["values"], strict=True)}
        return Curve(decision.astype(np.int64), seconds, values["reward"], values, frozen.astype(bool))

    def order(self, order: Order) -> None:
        """Ask the run for something. What became of it comes with `events`.

        **Raises** `ValueError` for what this run does not have; `RuntimeError` where it is no more.
        """
        if not isinstance(order, Order):
            raise TypeError(f"order = {order!r}: must be one of the orders of motorgrad.sim.live")
        self._check(order)
        if self._ended.is_set():
            raise RuntimeError(f"{self.name}: the simulation has ended")
        with self._lock:
            self._pipe.send(order)

    def events(self) -> list[Event]:
        """What happened since this was asked last, oldest first; a page asks, and shows it."""
        found = []
        while self._events:
            found.append(self._events.popleft())
        return found

    @property
    def ended(self) -> bool:
        """Whether the run is no more: closed, or broken, of which the last event tells."""
        return self._ended.is_set()

    def close(self) -> None:
        """End the run and give its memory back. A second call does nothing."""
        if self._process.is_alive():
            with self._lock, contextlib.suppress(OSError):
                self._pipe.send(None)
            self._process.join(5.0)
            if self._process.is_alive():
                self._process.terminate()
                self._process.join()
        self._ended.set()
        atexit.unregister(self.close)
        self._listener.join(5.0)
        self._pipe.close()
        shared, self._shared = self._shared, {}
        for block in shared.values():
            block.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def _read(self, part: str) -> dict[str, np.ndarray]:
        if not self._shared:
            raise RuntimeError(f"{self.name}: the session is closed")
        return self._shared[part].read()

    def _check(self, order: Order) -> None:
        if isinstance(order, Edit) and order.name not in self.settings:
            raise unknown("setting", order.name, self.settings)
        if isinstance(order, Push):
            names = [] if self.model is None else [self.model.body(i).name for i in range(1, self.model.nbody)]
            if order.body not in names:
                raise unknown("body", order.body, names)
        if isinstance(order, Control):
            known = 0 <= order.actuator < len(self.muscles) and self.task is None
            check(known, "actuator", order.actuator, f"one of the {len(self.muscles)} of a model without a learner")
        if isinstance(order, Scrub):
            now = self.snapshot()
            fits = now.oldest <= order.decision <= now.newest
            check(fits, "decision", order.decision, f"from {now.oldest:,} to {now.newest:,}")

    def _first(self) -> Ready:
        """What the worker says when it can begin."""
        said: Any = None
        with contextlib.suppress(EOFError):
            said = self._pipe.recv() if self._pipe.poll(START) else None
        if isinstance(said, Ready):
            return said
        self._process.terminate()
        self._process.join()
        self._pipe.close()
        if isinstance(said, Exception):
            raise said
        raise RuntimeError(f"{self.name}: the simulation did not begin (exit status {self._process.exitcode})")

    def _await_first_snapshot(self) -> None:
        until = time.monotonic() + START
        while self._shared["moment"].read()["bodies"] < 1:
            if not self._process.is_alive() or time.monotonic() > until:
                raise RuntimeError(f"{self.name}: the simulation ended as it began")
            time.sleep(0.005)

    def _listen(self) -> None:
        """Take in what the worker says, so that it never waits."""
        with contextlib.suppress(EOFError, OSError):
            while True:
                reply: Reply = self._pipe.recv()
                self.settings.update(reply.settings)
                if self.model is not None:
                    reply.put_into(self.model)
                if reply.text:
                    self._note(Event(reply.wall, reply.decision, reply.text, reply.kind))
        if not self._ended.is_set():
            self._ended.set()
            self._note(Event(time.time(), 0, f"{self.name}: the simulation has ended", "ended"))

    def _note(self, event: Event) -> None:
        self._events.append(event)
        self.log.append(event)


@contextlib.contextmanager
def _bare_main() -> Iterator[None]:
    """Keep a new process from running the user's script again, so that it needs no guard: what the script defines
    crosses by value."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
