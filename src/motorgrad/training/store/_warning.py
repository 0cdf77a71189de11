"""Warnings about run directories, which one thread can do without."""

import contextlib
import contextvars
import warnings
from collections.abc import Iterator

_QUIET = contextvars.ContextVar("quiet", default=False)


class RunWarning(UserWarning):
    """A warning about a run directory, such as a damaged checkpoint."""


@contextlib.contextmanager
def reading_quietly() -> Iterator[None]:
    """Within this, directories are read without a `RunWarning`, by this thread alone. Filters of `warnings` belong to
    the whole process, so that `warnings.catch_warnings` would take warnings from other threads, too."""
    before = _QUIET.set(True)
    try:
        yield
    finally:
        _QUIET.reset(before)


def warn_of_reading(text: str) -> None:
    """Warn, at the place that called the caller, unless reading is quiet."""
    if not _QUIET.get():
        warnings.warn(text, RunWarning, stacklevel=3)
