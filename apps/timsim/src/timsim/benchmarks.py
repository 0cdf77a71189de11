"""TimSim: how fast a learner learns while it is watched."""

import math
import multiprocessing
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection

import numpy as np

from motorgrad._processes import environment
from motorgrad.benchmarks import Row
from motorgrad.training import agent_for, stepper_for
from timsim.live import Pause, Play, Session, setup_of
from timsim.page import Page

PATIENCE = 300.0  # seconds for what takes some ten


def rows(quick: bool, pairs: int) -> Iterator[Row]:
    """The rows of TimSim in the speed table; `pairs`, how many of ours and of others are measured in turn."""
    for name in ("hopper", "hexapod"):
        yield watched_row(name, 0.5 if quick else 5.0, 1 if quick else pairs, "≥ 0.9")


def watched_row(task: str, seconds: float, pairs: int, wanted: str = "") -> Row:
    """Decisions per second of a learner in a page watched by one client, which receives everything and does not draw,
    against the same learner alone; in turn, each in its own process."""
    context = multiprocessing.get_context("spawn")
    pipe, theirs = context.Pipe()
    alone = context.Process(target=_learn, args=(theirs, task), daemon=True)
    with environment():
        alone.start()
    rates: list[list[float]] = [[], []]
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
                rates[0].append(_played(session, seconds))
                pipe.send(seconds)
                rates[1].append(_receive(pipe))
        finally:
            client.terminate()
            client.wait()
            pipe.send(None)
            alone.join()
    return _row(f"{task}, watched by a client ÷ headless, 1 seed", rates, wanted)


def _row(name: str, rates: list[list[float]], wanted: str) -> Row:
    ours, other = np.array(rates)
    ratios = ours / other
    spread = (float(ratios.min()), float(ratios.max()))
    medians = (float(np.median(ours)), float(np.median(other)))
    return Row(name, *medians, "decisions/s", float(np.median(ratios)), spread, wanted)


def _played(session: Session, seconds: float) -> float:
    """Decisions per second of a session that plays for `seconds`."""
    before = session.snapshot().decision
    start = time.perf_counter()
    session.order(Play())
    time.sleep(seconds)
    session.order(Pause())
    _until(lambda: not session.snapshot().playing)
    return (session.snapshot().decision - before) / (time.perf_counter() - start)


def _learn(pipe: Connection, name: str) -> None:
    """A process that learns alone for as long as each message says, and replies with the decisions per second."""
    from motorgrad.tasks import make

    task = make(name)
    stepper = stepper_for(task, agent_for(task), [0], threads=1)
    stepper.advance(200)
    pipe.send(0.0)
    while (seconds := pipe.recv()) is not None:
        made = 0
        start = time.perf_counter()
        while (took := time.perf_counter() - start) < seconds:
            stepper.advance(200)
            made += 200
        pipe.send(made / took)


def _receive(pipe: Connection) -> float:
    if not pipe.poll(PATIENCE):
        raise RuntimeError("the learner without a page did not answer")
    return pipe.recv()


def _until(true: Callable[[], bool]) -> None:
    until = time.monotonic() + PATIENCE
    while not true():
        if time.monotonic() > until:
            raise RuntimeError("the page did not answer")
        time.sleep(0.01)
