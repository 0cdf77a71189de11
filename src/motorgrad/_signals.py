"""Requests to stop: Ctrl-C (SIGINT), SIGTERM, and the end of the terminal (SIGHUP)."""

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar

T = TypeVar("T")

HANG_UP = (signal.SIGHUP,) if hasattr(signal, "SIGHUP") else ()  # Windows has none
STOPS = (signal.SIGINT, signal.SIGTERM, *HANG_UP)
_asked = threading.Event()  # since the command started


def asked() -> bool:
    """Whether the command has received a request to stop."""
    return _asked.is_set()


def leave_to_parent() -> None:
    """Ignore what a terminal tells all processes that were started in it: the parent gets it, and ends this one."""
    for number in (signal.SIGINT, *HANG_UP):
        signal.signal(number, signal.SIG_IGN)


def interrupt(message: str, **unfinished: object) -> KeyboardInterrupt:
    """The interrupt of a computation that has saved what it had when it was asked to stop, with the `unfinished` thing
    as an attribute. A script that does not expect it ends, and its caller sees that it was interrupted: only the class
    itself makes Python end as by the signal, which also ends a loop of a shell."""
    error = KeyboardInterrupt(message)
    for name, value in unfinished.items():
        setattr(error, name, value)
    return error


def unfinished(name: str, work: Callable[[], T]) -> T:
    """What `work` returns; where it was asked to stop, its unfinished outcome, which the interrupt has as `name`."""
    try:
        return work()
    except KeyboardInterrupt as error:
        if not hasattr(error, name):
            raise
        return getattr(error, name)


@contextmanager
def interrupt_when_asked() -> Iterator[None]:
    """Raise `KeyboardInterrupt` on these signals, and remember it, as a library being imported may swallow it."""
    _asked.clear()
    with _handled(lambda: _asked.set(), interrupt=True):
        yield


@contextmanager
def stop_when_asked() -> Iterator[Callable[[], bool]]:
    """Turn the first signal into a request to stop at the next safe point; a second one interrupts at once."""
    if _asked.is_set():
        raise KeyboardInterrupt
    asked = threading.Event()

    def ask() -> None:
        if asked.is_set():
            raise KeyboardInterrupt
        asked.set()

    with _handled(ask):
        yield asked.is_set


@contextmanager
def _handled(act: Callable[[], None], interrupt: bool = False) -> Iterator[None]:
    """Call `act` on these signals within the context. Only the main thread receives signals. What is started with
    `nohup` goes on without its terminal."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handle(number: int, frame: FrameType | None) -> None:
        act()
        if interrupt:
            raise KeyboardInterrupt

    def raise_again(swallowed: "sys.UnraisableHookArgs") -> None:
        if isinstance(swallowed.exc_value, KeyboardInterrupt):
            again = threading.Timer(0.01, signal.pthread_kill, [threading.main_thread().ident, signal.SIGINT])
            again.daemon = True
            again.start()
        else:
            hook(swallowed)

    kept = {number for number in HANG_UP if signal.getsignal(number) == signal.SIG_IGN}
    previous = {number: signal.signal(number, handle) for number in STOPS if number not in kept}
    # Python swallows what is raised while it collects garbage, where jax has a callback, and in finalizers
    hook, sys.unraisablehook = sys.unraisablehook, raise_again
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in previous.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
