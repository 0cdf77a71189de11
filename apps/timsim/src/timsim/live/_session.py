"""A session: a run in a worker process, read through snapshots and steered by orders."""

import atexit
import contextlib
import functools
import multiprocessing
import sys
import threading
import time
import types
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Self

import cloudpickle
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from motorgrad._arguments import check_arguments
from motorgrad._processes import environment
from motorgrad.policies import Policy, split
from timsim.live._foreign import Picture
from timsim.live._messages import Edit, Order, Speed
from timsim.live._numbers import editable_numbers, write_numbers
from timsim.live._replies import Branch, Event, Ready, Reply
from timsim.live._setup import Setup
from timsim.live._snapshot import (
    ARRAYS,
    COUNTS,
    SCALARS,
    Curve,
    SharedArrays,
    Sizes,
    Snapshot,
    Trail,
    decoded,
    layout,
    part_of,
)
from timsim.live._worker import work

START = 300.0  # s that any part of the start may take; compiling a large learner takes about ten
KEPT = 10_000  # events that have not been read


class Session:
    """A run in its own process. It continues whether or not anyone watches.

    **Arguments:** `setup`; `playing`: whether it starts at once; `speed`: simulated seconds per second of wall time;
    `wait`: whether to return only when it is ready. Without, call `wait_until_ready` before anything else but `close`.

    **Attributes:**

    - `model`: the `mujoco.MjModel` of the body in view, with edits applied; None for worlds in JAX.
    - `task`, `agent`: None for a model without a learner.
    - `observations`, `actions`, `muscles` (the model's actuators), `feet`, `metrics` (of the task): names.
    - `period`: simulated seconds of a decision; `speed`: simulated seconds per second of wall time, as wanted.
    - `settings`: what `Edit` can change, by name, with its present value; `started`: with its value at first.
    - `successor`: another session, already running, that a page is to show in place of this one.
    - `rendered`: whether it is a Gymnasium environment with a picture of its own, and no body.
    - `picture`: of such an environment, the answer to the last `Look`; `pictures`: how many came.
    - `log`: the last events, whether or not `events` has returned them.
    - `folders`: where a page may save and load policies: the working folder, and that of the run it began with.

    **Raises** `ValueError` or `RuntimeError` with the worker's message where it cannot start.
    """

    def __init__(self, setup: Setup, *, playing: bool = True, speed: float = 1.0, wait: bool = True):
        check_arguments(Session, locals())
        self.setup, self.name, self.speed = setup, setup.name, speed
        self.successor: Session | None = None
        self.model, self.task, self.agent = setup.model, setup.task, setup.agent
        self.rendered = setup.rendered
        self.folders = [Path.cwd(), *([] if setup.folder is None else [setup.folder])]
        self._events: deque[Event] = deque(maxlen=KEPT)
        self.log: deque[Event] = deque(maxlen=KEPT)
        self.picture: Picture | None = None
        self.pictures = 0
        self._ended = threading.Event()
        self._lock = threading.Lock()
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        payload = cloudpickle.dumps((setup, playing, speed))
        self._process = context.Process(target=work, args=(theirs, payload), name="motorgrad sim", daemon=True)
        with _bare_main(), environment():
            self._process.start()
        theirs.close()
        atexit.register(self.close)
        self._listener: threading.Thread | None = None
        self._shared: dict[str, SharedArrays] = {}
        self._branches: tuple[Branch, ...] = (Branch("A", "", 0, 0, (), True, False),)
        if wait:
            self.wait_until_ready()

    def wait_until_ready(self, report: Callable[[str], object] = lambda _: None) -> None:
        """Wait until the run has started; `report` is called with short progress messages.

        **Raises** `ValueError` or `RuntimeError` with the worker's message where it cannot start.
        """
        if self._listener is not None:
            return
        report("starting a process for the simulation")
        ready = self._first(report)
        self.sizes: Sizes = ready.sizes
        self.period = ready.period
        self.settings = dict(ready.settings)
        self.started = dict(ready.settings)
        numbers = {} if self.model is None else editable_numbers(self.model)
        self._numbers = {name: number for name, number in numbers.items() if name in self.settings}
        self.observations, self.actions, self.muscles = ready.observations, ready.actions, ready.muscles
        self.feet, self.metrics = ready.feet, ready.metrics
        self._shared = {part: SharedArrays(shapes) for part, shapes in layout(self.sizes).items()}
        self._pipe.send({part: block.name for part, block in self._shared.items()})
        self._await_first_snapshot()
        self._listener = threading.Thread(target=self._listen, name="motorgrad sim events", daemon=True)
        self._listener.start()

    def snapshot(self) -> Snapshot:
        """The present moment. **Raises** `RuntimeError` once the session is closed."""
        found = self._read("moment")
        bodies = int(found["bodies"])
        values: dict[str, Any] = {name: found[name][:bodies] for name in (*ARRAYS, *SCALARS)}
        values |= {name: int(found[name]) for name in COUNTS}
        values |= {name: bool(found[name]) for name in ("playing", "frozen")}
        values["labels"] = decoded(found["labels"][:bodies])
        return Snapshot(**values, seconds=float(found["seconds"]), speed=float(found["speed"]))

    def policy(self, snapshot: Snapshot) -> Policy | None:
        """The acting policy of the first body at a snapshot. None where there is no learner, or where the policy has
        grown since the run began."""
        if self.agent is None:
            return None
        (shapes, rest) = self._structure
        shaped = []
        for numbers, (like, unravel) in zip((snapshot.parameters[0], snapshot.fixed[0]), shapes, strict=True):
            if numbers.shape != like.shape:
                return None
            shaped.append(unravel(jnp.asarray(numbers, like.dtype)))
        return eqx.combine(*shaped, rest)

    @functools.cached_property
    def _structure(self) -> tuple[list[tuple[Any, Any]], Any]:
        """Of the policy: the numbers that are trained and those that are not, flat, with the functions that shape them;
        and everything else."""
        assert self.agent is not None
        initial = self.setup.initial
        if initial is None:
            whole = self.agent.init(jax.random.key(self.setup.seed)).policy
        else:
            whole = jax.tree.map(lambda leaf: leaf[0], initial)
        trained, settings = split(whole)
        fixed, rest = eqx.partition(settings, eqx.is_array)
        return [ravel_pytree(trained), ravel_pytree(fixed)], rest

    @property
    def branches(self) -> tuple[Branch, ...]:
        """The branches of the run, oldest first. One of them is `present`."""
        now = self.snapshot()
        reached = {(True, False): now.newest, (False, True): now.decision}
        return tuple(
            branch._replace(end=max(branch.end, reached.get((branch.present, branch.beside), 0)))
            for branch in self._branches
        )

    def trail(self, body: int = 0) -> Trail:
        """The last decisions of a body in view, oldest first; 0 is the one that learns."""
        found = self._read(part_of("trail", body))
        count = int(found.pop("count"))
        place = int(found.pop("next"))
        room = self.sizes.trail
        rows = (np.arange(count) + place - count) % room
        decision = found.pop("decision")[rows].astype(np.int64)
        return Trail(decision=decision, **{name: array[rows] for name, array in found.items()})

    def curve(self, body: int = 0) -> Curve:
        """The learning curve of a body in view so far; for bodies beside the learner, since they were added."""
        found = self._read(part_of("curve", body))
        count = int(found["count"])
        decision, seconds, frozen = (found[name][:count] for name in ("decision", "seconds", "frozen"))
        names = ("reward", *self.metrics)
        values = {name: row[:count] for name, row in zip(names, found["values"], strict=True)}
        return Curve(decision.astype(np.int64), seconds, values["reward"], values, frozen.astype(bool))

    def order(self, order: Order) -> None:
        """Send an order to the run; `events` reports the outcome.

        **Raises** `ValueError` for an order that this run cannot carry out; `RuntimeError` where the run has ended.
        """
        if not isinstance(order, Order):
            raise TypeError(f"order = {order!r}: must be an order of timsim.live")
        order.check(self)
        if self._ended.is_set():
            raise RuntimeError(f"{self.name}: the simulation has ended")
        with self._lock:
            self._pipe.send(order)
        if isinstance(order, Speed):
            self.speed = order.factor

    def events(self) -> list[Event]:
        """The events since the last call, oldest first; a page calls it to show them."""
        found = []
        while self._events:
            found.append(self._events.popleft())
        return found

    @property
    def ended(self) -> bool:
        """Whether the run has ended: it was closed, or it failed, as the last event says."""
        return self._ended.is_set()

    def close(self) -> None:
        """End the run and free its memory. A second call does nothing."""
        if self._process.is_alive():
            if self._listener is not None:  # it is ready, and can end by itself
                with self._lock, contextlib.suppress(OSError):
                    self._pipe.send(None)
                self._process.join(5.0)
            if self._process.is_alive():
                self._process.terminate()
                self._process.join()
        self._ended.set()
        atexit.unregister(self.close)
        if self._listener is not None:
            self._listener.join(5.0)
        self._pipe.close()
        shared = self._shared
        self._shared = {}
        for block in shared.values():
            block.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _read(self, part: str) -> dict[str, np.ndarray]:
        if not self._shared:
            raise RuntimeError(f"{self.name}: the session is closed")
        return self._shared[part].read()

    def _first(self, report: Callable[[str], object]) -> Ready:
        """The worker's first reply after its progress messages."""
        reply: Any = ""
        while isinstance(reply, str):
            try:
                reply = self._pipe.recv() if self._pipe.poll(START) else None
            except (EOFError, OSError):
                reply = None
            if isinstance(reply, str):
                report(reply)
        if isinstance(reply, Ready):
            return reply
        self._process.terminate()
        self._process.join()
        self._pipe.close()
        atexit.unregister(self.close)
        if isinstance(reply, Exception):
            raise reply
        raise RuntimeError(f"{self.name}: the simulation did not start (exit status {self._process.exitcode})")

    def _await_first_snapshot(self) -> None:
        until = time.monotonic() + START
        while self._shared["moment"].read()["bodies"] < 1:
            if not self._process.is_alive() or time.monotonic() > until:
                raise RuntimeError(f"{self.name}: the simulation ended as it started")
            time.sleep(0.005)

    def _listen(self) -> None:
        """Receive the worker's replies, so that it never waits."""
        with contextlib.suppress(EOFError, OSError):
            while True:
                reply: Reply | Picture = self._pipe.recv()
                if isinstance(reply, Picture):
                    self.picture = reply
                    self.pictures = self.pictures + 1
                    continue
                self.settings.update(reply.settings)
                if reply.branches is not None:
                    self._branches = reply.branches
                if self.model is not None and reply.settings:
                    write_numbers(self.model, self._numbers, self.settings)
                if reply.event.text:
                    self._note(reply.event)
        if not self._ended.is_set():
            self._ended.set()
            self._note(Event(time.time(), 0, f"{self.name}: the simulation has ended", "ended"))

    def _note(self, event: Event) -> None:
        self._events.append(event)
        self.log.append(event)


def succeed(session: Session, setup: Setup, report: Callable[[str], object] = lambda _: None) -> Session:
    """Start another run, with the numbers of the body that were edited by hand, and let the page of a session show it.

    **Arguments:** `session` of the page; `setup` of what follows; `report`, as of `Session.wait_until_ready`.

    **Raises** `ValueError` or `RuntimeError` where it cannot start; the page then stays as it is.
    """
    playing = setup.task is not None or setup.motion is not None
    found = Session(setup, playing=playing, speed=session.speed, wait=False)
    try:
        found.wait_until_ready(report)
        for name, value in session.settings.items():
            if name.startswith("body.") and value != session.started[name] and name in found.settings:
                found.order(Edit(name, value))
    except BaseException:
        found.close()
        raise
    session.successor = found
    return found


@contextlib.contextmanager
def _bare_main() -> Iterator[None]:
    """Keep the new process from running the user's script again, so that scripts need no `__main__` guard.

    What the script defines crosses by value.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
