"""Compile in a separate thread, so that a user can stop waiting: nothing can interrupt the compiler itself.

What is stopped goes on unseen until it is done. The number of such compilations is limited, and the process waits for
them at its end: the compiler aborts a process that ends under it.
"""

import atexit
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Generic, TypeVar

from motorgrad._errors import check

PATIENCE = 60.0  # seconds after which a compilation is said to be long
POLL = 0.02  # seconds between looks whether it is to be stopped
REPORT = 1.0  # seconds between reports
MAX_STOPPED_COMPILATIONS = 2  # that still go on
T = TypeVar("T")


class Stopped(ValueError):
    """A compilation was stopped."""


class _Making(threading.Thread, Generic[T]):
    """Runs a function and keeps its result, or its exception."""

    def __init__(self, make: Callable[[], T]):
        super().__init__(name="motorgrad-lab-compiler", daemon=True)
        self._make = make
        self.made: T | None = None
        self.error: BaseException | None = None

    def run(self) -> None:
        try:
            self.made = self._make()
        except BaseException as error:  # a block's own code may raise anything
            self.error = error


class Compilation:
    """Waits for compilations.

    **Arguments:** whether a compilation is to be stopped; a function that is told after every second how long it has
    taken so far; one that takes a message to the user.
    """

    def __init__(self, stopped: Callable[[], bool], report: Callable[[float], None], say: Callable[[str], None]):
        self._stopped, self._report, self._say = stopped, report, say
        self._left: list[_Making] = []

    def __call__(self, make: Callable[[], T], what: str = "compilation") -> T:
        """The result of `make`; messages call it `what`. **Raises** `Stopped`, and whatever `make` raises."""
        self._left = [thread for thread in self._left if thread.is_alive()]
        allowed = (
            f"at most {MAX_STOPPED_COMPILATIONS - 1}, so that the machine is not used up: wait, or restart the server"
        )
        check(
            len(self._left) < MAX_STOPPED_COMPILATIONS,
            "compilations that were stopped and still go on",
            len(self._left),
            allowed,
        )
        making = _Making(make)
        start = time.monotonic()
        reported_at = 0.0
        making.start()
        while making.is_alive():
            making.join(POLL)
            took = time.monotonic() - start
            if self._stopped() and making.is_alive():
                self._left.append(making)
                atexit.register(_wait_for, making)  # after JAX's own handlers, hence called before them
                raise Stopped(f"{what} stopped after {took:.0f} s: what was begun goes on unseen until it is done")
            if took - reported_at >= REPORT:
                if reported_at < PATIENCE <= took:
                    self._say(f"{what}: {PATIENCE:.0f} s so far: pause stops it")
                reported_at = took
                self._report(took)
        if making.error is not None:
            raise making.error
        return making.made  # type: ignore[return-value]  # it was made


def _wait_for(making: threading.Thread) -> None:
    """Wait for compilations when the process ends; a second interrupt ends it at once."""
    if making.is_alive():
        # an exception instead would be lost where a callback of the garbage collector is interrupted
        signal.signal(signal.SIGINT, lambda *_: os._exit(130))
        print("waiting for the compiler to end; Ctrl-C ends at once", file=sys.stderr, flush=True)
    making.join()
