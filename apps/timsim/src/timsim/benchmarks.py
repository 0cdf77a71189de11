"""TimSim: how fast a learner learns while it is watched."""

import dataclasses
import math
import multiprocessing
import subprocess
import sys
import time
from collections.abc import Callable
from multiprocessing.connection import Connection

from motorgrad._processes import environment
from motorgrad.benchmarks import Figures, Goal, Row, Took, figures, timed
from motorgrad.training import agent_for, stepper_for
from timsim.live import Pause, Play, Session, setup_of
from timsim.page import Page

PATIENCE = 300.0  # seconds for what takes some ten


def rows() -> list[Row]:
    """The rows of TimSim in the speed table."""
    return [
        Row(
            f"watched-{name}",
            f"{name}, watched by a client ÷ headless, 1 seed",
            lambda quick, pairs, name=name: watched(name, 0.5 if quick else 5.0, 1 if quick else pairs),
            Goal(0.95),
        )
        for name in ("hopper", "hexapod")
    ]


def watched(task: str, seconds: float, pairs: int) -> Figures:
    """Decisions per second of a learner in a page watched by one client, which receives everything and does not draw,
    against the same learner alone; in turn, each in its own process. Processor time is without that of the client."""
    context = multiprocessing.get_context("spawn")
    pipe, theirs = context.Pipe()
    alone = context.Process(target=_learn, args=(theirs, task), daemon=True)
    with environment():
        alone.start()
    found: list[tuple[Took, Took | None]] = []
    with Session(setup_of(task), playing=False, speed=math.inf) as session, Page(session) as page:
        length = 2 * pairs * (seconds + 5) + 60
        command = [sys.executable, "-m", "timsim._watching_client", str(length)]
        with environment():
            client = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        assert client.stdin is not None
        client.stdin.write(f"{page.url}\n")
        client.stdin.close()
        try:
            _until(lambda: bool(page.server.get_clients()))
            _receive(pipe)  # it has compiled

            _played(session, seconds)  # compiles
            for _ in range(pairs):
                ours = _played(session, seconds)
                pipe.send(seconds)
                found.append((ours, _receive(pipe)))
        finally:
            client.terminate()
            client.wait()
            pipe.send(None)
            alone.join()
    return figures("decisions/s", found)


def _played(session: Session, seconds: float) -> Took:
    """The decisions of a session that plays for `seconds`."""
    before = session.snapshot().decision

    def play() -> None:
        session.order(Play())
        time.sleep(seconds)
        session.order(Pause())
        _until(lambda: not session.snapshot().playing)

    return dataclasses.replace(timed(play), amount=session.snapshot().decision - before)


def _learn(pipe: Connection, name: str) -> None:
    """A process that learns alone for as long as each message says, and replies with what it took."""
    from motorgrad.tasks import make

    task = make(name)
    stepper = stepper_for(task, agent_for(task), [0], threads=1)
    stepper.advance(200)
    pipe.send(None)
    while (seconds := pipe.recv()) is not None:
        decisions = 0

        def learn(seconds: float = seconds) -> None:
            nonlocal decisions
            start = time.perf_counter()
            while time.perf_counter() - start < seconds:
                stepper.advance(200)
                decisions += 200

        took = timed(learn)
        pipe.send(dataclasses.replace(took, amount=decisions))


def _receive(pipe: Connection) -> Took | None:
    if not pipe.poll(PATIENCE):
        raise RuntimeError("the learner without a page did not answer")
    return pipe.recv()


def _until(true: Callable[[], bool]) -> None:
    until = time.monotonic() + PATIENCE
    while not true():
        if time.monotonic() > until:
            raise RuntimeError("the page did not answer")
        time.sleep(0.01)
