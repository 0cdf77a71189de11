"""Saving the policy of a live run while it is watched."""

import sys
import time
from pathlib import Path

from motorgrad._errors import plain
from timsim import live

PATIENCE = 600.0
"""Seconds in which a run must have saved its policy at its end."""


class Autosave:
    """Saves the policy of a run to a file as it learns, every so many seconds, and at the end."""

    def __init__(self, file: Path, every: float):
        self._last = live.Save(str(file))
        self._every = every
        self._due = time.monotonic() + every
        self._reported = ""

    def go_on(self, session: live.Session) -> None:
        """Save if it is time, and tell why it could not be saved before."""
        if time.monotonic() > self._due:
            session.order(live.Save(self._last.path, quiet=True))
            self._due = time.monotonic() + self._every
        for failure in self._outcomes(session, self._last.not_saved)[-1:]:
            if failure != self._reported:
                print(f"motorgrad sim: warning: {plain(failure)}", file=sys.stderr)
                self._reported = failure

    def finish(self, session: live.Session) -> None:
        """Save for the last time. **Raises** `RuntimeError` where it could not be saved."""
        ends = (self._last.saved, self._last.not_saved)
        before = len(self._outcomes(session, *ends))
        until = time.monotonic() + PATIENCE
        session.order(self._last)
        while len(found := self._outcomes(session, *ends)) <= before:
            if session.ended or time.monotonic() > until:
                raise RuntimeError(f"{self._last.not_saved}: the simulation did not answer")
            time.sleep(0.01)
        if found[-1].startswith(self._last.not_saved):
            raise RuntimeError(found[-1])

    @staticmethod
    def _outcomes(session: live.Session, *begin: str) -> list[str]:
        return [event.text for event in tuple(session.log) if event.text.startswith(begin)]
