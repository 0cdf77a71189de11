"""Being asked to stop: by Ctrl-C, or by a system that ends processes politely (SIGTERM)."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

STOPS = (signal.SIGINT, signal.SIGTERM)
_asked = threading.Event()  # since a command began


def asked() -> bool:
    """Whether the command was asked to stop."""
    return _asked.is_set()


@contextmanager
def interrupt_when_asked() -> Iterator[None]:
    """Raise `KeyboardInterrupt` for either. Libraries that are being loaded may swallow it: it is remembered."""
    _asked.clear()
    with _handled(lambda: _asked.set(), interrupt=True):
        yield


@contextmanager
def stop_when_asked() -> Iterator[Callable[[], bool]]:
    """Turn the first Ctrl-C or SIGTERM into a request to stop at the next safe point; a second interrupts at once."""
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
    """Within it, `act` on both signals; only the main thread hears of them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def hear(number: int, frame: Any) -> None:
        act()
        if interrupt:
            raise KeyboardInterrupt

    previous = {number: signal.signal(number, hear) for number in STOPS}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
