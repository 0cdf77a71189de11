"""Requests to stop: Ctrl-C (SIGINT) and SIGTERM."""

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

STOPS = (signal.SIGINT, signal.SIGTERM)
_asked = threading.Event()  # since the command started


def asked() -> bool:
    """Whether the command has received a request to stop."""
    return _asked.is_set()


@contextmanager
def interrupt_when_asked() -> Iterator[None]:
    """Raise `KeyboardInterrupt` on either signal, and remember it, as a library being imported may swallow it."""
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
    """Call `act` on both signals within the context. Only the main thread receives signals."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handle(number: int, frame: Any) -> None:
        act()
        if interrupt:
            raise KeyboardInterrupt

    def raise_again(swallowed: Any) -> None:
        if isinstance(swallowed.exc_value, KeyboardInterrupt):
            again = threading.Timer(0.01, signal.pthread_kill, [threading.main_thread().ident, signal.SIGINT])
            again.daemon = True
            again.start()
        else:
            hook(swallowed)

    previous = {number: signal.signal(number, handle) for number in STOPS}
    # Python swallows what is raised while it collects garbage, where jax has a callback, and in finalizers
    hook, sys.unraisablehook = sys.unraisablehook, raise_again
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in previous.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
