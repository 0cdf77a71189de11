"""Recording a run that goes on, to be replayed from one HTML file."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import numpy as np

from motorgrad._errors import check
from motorgrad._files import check_writable
from motorgrad.sim.film import Motion, output_path
from motorgrad.sim.live import Session, Trail
from motorgrad.sim.replay import Plot, Replay, write_replay

EVERY = 0.25  # s between two readings of the trail, which holds about 20 s
LONGEST = 120.0  # s of simulated time; what comes later is not recorded


class ReplayRecorder:
    """Records every decision of a session's body from now on, until it is stopped, and writes it as a replay.

    A run that goes back in time discards what was recorded after that moment. Of a fast run (`speed` "max"), the
    stretches of consecutive decisions that the panels show are replayed one after the other. At most 120 simulated
    seconds are kept. Targets are read four times a second.

    **Arguments:** `session`; `path`, ending in ".html".

    **Attributes:** `path`; `seconds` recorded; `replay`: what was written, None before `stop`.

    **Raises** `ValueError` for a session without a body, or a file that cannot be written; `stop` raises any later
    error.

    ```py
    recorder = ReplayRecorder(session, "run.html")
    recorder.stop()
    ```
    """

    def __init__(self, session: Session, path: str | os.PathLike[str]) -> None:
        self.path: Path = output_path(path, ".html")
        check_writable("path", self.path)
        check(session.model is not None, "replay of", session.name, "a task or model with a body")
        self._session = session
        self.replay: Replay | None = None
        self._rows: list[tuple[Trail, np.ndarray]] = []
        self._next = session.snapshot().decision
        self._resets = session.snapshot().reset_count
        self._failed: BaseException | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="motorgrad sim replay", daemon=True)
        self._thread.start()

    @property
    def seconds(self) -> float:
        """Simulated seconds recorded so far."""
        return sum(len(trail.decision) for trail, _ in self._rows) * self._session.period

    def stop(self) -> None:
        """End the recording and write the file. A second call does nothing."""
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join()
        if self._failed is not None:
            raise self._failed
        self.replay = self._write()

    def _run(self) -> None:
        try:
            while not self._session.ended:
                if self.seconds < LONGEST:
                    self._read()
                if self._stop.wait(EVERY):
                    self._read()
                    return
        except RuntimeError as error:  # the recording ends with the run
            self._failed = None if self._session.ended else error
        except Exception as error:  # raised by `stop`, in the caller's thread
            self._failed = error

    def _read(self) -> None:
        """Add the decisions made since the last reading."""
        moment, trail = self._session.snapshot(), self._session.trail()
        if moment.reset_count != self._resets:  # the run went back
            self._resets = moment.reset_count
            self._rows = [(_before(trail, moment.decision), marks) for trail, marks in self._rows]
            self._next = min(self._next, moment.decision)
        new = trail.decision >= self._next
        if new.any():
            self._rows.append((Trail(*(column[new] for column in trail)), moment.marks[0].reshape(-1, 4)))
            self._next = int(trail.decision[-1]) + 1

    def _write(self) -> Replay:
        session = self._session
        rows = [(trail, marks) for trail, marks in self._rows if len(trail.decision)]
        check(rows, "replay", "nothing recorded", "at least one decision: the run is paused")
        whole = Trail(*map(np.concatenate, zip(*(trail for trail, _ in rows), strict=True)))
        good = np.all(np.isfinite(whole.position), axis=1)
        whole = Trail(*(column[good] for column in whole))
        marks = np.concatenate([np.tile(each, (len(trail.decision), 1, 1)) for trail, each in rows])[good]
        # gaps of a fast run take no time
        time = whole.seconds[0] + np.arange(len(whole.decision)) * session.period
        activation = np.clip(np.nan_to_num(whole.activation), 0, 1)
        motion = Motion(session.model, time, whole.position, activation, session.name, marks)
        plots = []
        if np.isfinite(whole.reward).any():
            plots.append(Plot("reward of each decision", time, whole.reward))
        if whole.contacts.shape[1]:
            plots.append(Plot("contact forces", time, whole.contacts, session.feet, "N"))
        return write_replay(motion, self.path, plots=plots, fps=min(60.0, max(5.0, 1 / session.period)))


def _before(trail: Trail, decision: int) -> Trail:
    """The part of a trail before a decision."""
    return Trail(*(column[trail.decision < decision] for column in trail))
