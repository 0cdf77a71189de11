"""Saving a run while it learns: a full disk or a missing folder does not end it."""

import contextlib
import time
import warnings
from typing import Any

import numpy as np
import pyarrow as pa
from jaxtyping import PyTree

from motorgrad.training.plots import EventFiles
from motorgrad.training.store import RunDirectory, RunDirectoryError, RunWarning

GIVE_UP_AFTER = 3600.0  # seconds
PAUSE = 5.0  # seconds between two attempts at the end, at most


class NotSaved(RunDirectoryError):
    """A run that ended without being saved. `run` is all of it, in memory."""

    run: Any = None


class Saving:
    """Saves a run at its checkpoints, `every` so many seconds of a monotonic clock, and keeps what could not be written
    until it can be. After `give_up_after` seconds of failed attempts `given_up` is true."""

    def __init__(self, directory: RunDirectory, every: float, give_up_after: float):
        self.directory, self.every, self.give_up_after = directory, every, give_up_after
        self.events: EventFiles | None = None
        self.why: str | None = None
        """Why the last attempt failed; `None` if it did not."""
        self._waiting: list[pa.Table] = []
        self._short: list[pa.Table] = []
        self._last = time.monotonic()
        self._failing_since = self._last

    @property
    def due(self) -> bool:
        """Whether it is time for an attempt."""
        return time.monotonic() - self._last >= self.every

    @property
    def given_up(self) -> bool:
        """Whether nothing could be saved for too long."""
        return self.why is not None and time.monotonic() - self._failing_since >= self.give_up_after

    @property
    def pause(self) -> float:
        """Seconds between two attempts when there is nothing else to do."""
        return min(self.every, PAUSE)

    def metrics(self) -> pa.Table | None:
        """All records: those of the directory, where it can be read, and those that are not saved."""
        tables: list[pa.Table | None] = [] if self.why is None else [*self._waiting, *self._short]
        with contextlib.suppress(OSError):
            if self.directory.is_held:
                tables.insert(0, self.directory.metrics())
        whole = [table for table in tables if table is not None]
        return pa.concat_tables(whole) if whole else None

    def save(
        self, state: PyTree[np.ndarray], about: dict[str, Any], records: pa.Table | None, short: pa.Table | None
    ) -> bool:
        """Commit, as `RunDirectory.save`; whether that succeeded. Warns of a failure, and when it is over."""
        if records is not None:
            self._waiting.append(records)
        self._short = [] if short is None else [short]
        path = self.directory.path
        decision = about["decision"]
        try:
            self.directory.save(state, about, pa.concat_tables(self._waiting) if self._waiting else None, short)
        except OSError as error:
            why = f"{error.strerror or error}" + (f": {error.filename}" if error.filename else "")
            if self.why is None:
                self._failing_since = time.monotonic()
            if why != self.why:
                warnings.warn(
                    f"{path}: decision {decision:,} could not be saved: {why}. Learning continues, and the next "
                    f"checkpoint tries again; it ends after {self.give_up_after:,.0f} s of this",
                    RunWarning,
                    stacklevel=2,
                )
            self.why = why
            return False
        finally:
            self._last = time.monotonic()
        if self.why is not None:
            warnings.warn(
                f"{path}: saved again, up to decision {decision:,}; nothing is lost", RunWarning, stacklevel=2
            )
        self.why = None
        new = [*self._waiting, *self._short]
        self._waiting = []
        self._add_events(new)
        return True

    def _add_events(self, new: list[pa.Table]) -> None:
        """Append to the event files. They follow from the metrics, so what fails now is written at a later commit."""
        if self.events is None:
            return
        try:
            if self.events.complete:
                for part in new:
                    self.events.add(part)
            else:
                self.events.add(self.directory.metrics())
        except OSError as error:
            self.events.complete = False
            warnings.warn(f"{self.directory.path}: event files: {error}; tried again later", RunWarning, stacklevel=3)
