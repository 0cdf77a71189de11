"""Record every decision of a live run, as a motion with its numbers."""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np

from motorgrad._errors import check
from motorgrad.sim.film import Motion, Plot
from motorgrad.sim.live import Session, Trail

EVERY = 0.25  # s between two readings of the trail, which holds about 20 s
LONGEST = 120.0  # s of simulated time; what comes later is not recorded


class Recorded(NamedTuple):
    """A motion; the run's simulated `seconds` `(frames,)` at each of its frames, which have gaps where the run was
    fast; and `plots` by their short names.
    """

    motion: Motion
    seconds: np.ndarray
    plots: dict[str, Plot]


class MotionRecorder:
    """Records every decision of a session's body from now on, until it is stopped.

    A run that goes back in time discards what was recorded after that moment. Of a fast run (`speed` "max"), the
    stretches of consecutive decisions that the panels show follow one another. At most 120 simulated seconds are kept.
    Targets are read four times a second.

    **Raises** `ValueError` for a session without a body; `stop` raises any later error.
    """

    def __init__(self, session: Session) -> None:
        check(session.model is not None, "recording of", session.name, "a task or model with a body")
        self._session = session
        self._rows: list[tuple[Trail, np.ndarray]] = []
        self._next = session.snapshot().decision
        self._resets = session.snapshot().reset_count
        self._failed: BaseException | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="motorgrad sim recording", daemon=True)
        self._thread.start()

    @property
    def seconds(self) -> float:
        """Simulated seconds recorded so far."""
        return sum(len(trail.decision) for trail, _ in self._rows) * self._session.period

    @property
    def running(self) -> bool:
        """Whether it is recording."""
        return self._thread.is_alive()

    def stop(self) -> Recorded:
        """End the recording. **Raises** `ValueError` if no decision was made during it."""
        self._stop.set()
        self._thread.join()
        if self._failed is not None:
            raise self._failed
        session = self._session
        rows = [(trail, marks) for trail, marks in self._rows if len(trail.decision)]
        check(rows, "recording", "nothing recorded", "at least one decision: the run is paused")
        whole = Trail(*map(np.concatenate, zip(*(trail for trail, _ in rows), strict=True)))
        good = np.all(np.isfinite(whole.position), axis=1)
        whole = Trail(*(column[good] for column in whole))
        marks = np.concatenate([np.tile(each, (len(trail.decision), 1, 1)) for trail, each in rows])[good]
        # gaps of a fast run take no time
        time = whole.seconds[0] + np.arange(len(whole.decision)) * session.period
        activation = np.clip(np.nan_to_num(whole.activation), 0, 1)
        motion = Motion(session.model, time, whole.position, activation, session.name, marks)
        return Recorded(motion, whole.seconds, trail_plots(session, whole, time))

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


PLOTS = ("reward", "activations", "contact forces")


def trail_plots(session: Session, trail: Trail, time: np.ndarray) -> dict[str, Plot]:
    """The quantities of a trail that can be plotted, by the names in `PLOTS`, at times `(n,)` in s."""
    found = {}
    if np.isfinite(trail.reward).any():
        found["reward"] = Plot("reward of each decision", time, trail.reward)
    if trail.activation.shape[1]:
        found["activations"] = Plot("activation", time, np.clip(trail.activation, 0, 1), session.muscles)
    if trail.contacts.shape[1]:
        found["contact forces"] = Plot("contact forces", time, trail.contacts, session.feet, "N")
    return found


def _before(trail: Trail, decision: int) -> Trail:
    """The part of a trail before a decision."""
    return Trail(*(column[trail.decision < decision] for column in trail))
