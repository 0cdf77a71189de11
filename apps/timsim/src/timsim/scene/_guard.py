"""Parts of a page, and its browsers, that may fail without stopping the others."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import ParamSpec

P = ParamSpec("P")
log = logging.getLogger(__name__)


class Guard:
    """Calls functions that may fail. The first failure of each is logged.

    **Arguments:** the `subject` that the log names.

    **Attributes:** `failures`: how many calls failed.
    """

    def __init__(self, subject: str) -> None:
        self._subject = subject
        self._reported = set[str]()
        self.failures = 0

    def __call__(self, name: str, act: Callable[P, object], *arguments: P.args, **named: P.kwargs) -> None:
        """Call a function, which the log calls by this name."""
        try:
            try:
                act(*arguments, **named)
            except RuntimeError as error:
                # viser wakes its senders through asyncio's Event, which is not thread-safe: about once in 10,000 frames
                # a sender goes to sleep at that very moment. Trying again succeeds
                if "mutated during iteration" not in str(error):
                    raise
                act(*arguments, **named)
        except Exception:
            self.failures += 1
            if name not in self._reported:
                self._reported.add(name)
                log.exception("%s: %s could not be drawn", self._subject, name)
