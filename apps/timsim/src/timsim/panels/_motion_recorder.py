"""Record every decision of a live run, as a motion with its numbers."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from __future__ import annotations

import threading
import warnings
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motorgrad._errors import check
from timsim.film import Motion, Plot
from timsim.live import Session, Snapshot, Trail

if TYPE_CHECKING:
    import mujoco

EVERY = 0.25  # s between two readings of the trail, which holds about 20 s
MAX_RECORDING_SECONDS = 120.0  # of simulated time; what comes later is not recorded


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
    stretches of consecutive decisions that the panels show follow one another. Targets are read four times a second.

    **Arguments:** `session`; `longest`: simulated seconds after which it ends by itself, above 0, at most 120; None for
    120, of which `stop` then warns.

    **Attributes:** `full`: whether it has ended by itself.

    **Raises** `ValueError` for a session without a body, or another length; `stop` raises any later error.
    """

    def __init__(self, session: Session, longest: float | None = None) -> None:
        check(session.model is not None, "recording of", session.name, "a task or model with a body")
        fine = longest is None or 0 < longest <= MAX_RECORDING_SECONDS
        check(fine, "longest", longest, f"above 0 s, at most {MAX_RECORDING_SECONDS:g} s")
        self._session = session
        self._asked = longest is not None
        self.full = False
        self._most = max(1, round((longest or MAX_RECORDING_SECONDS) / session.period))  # decisions
        self._rows: list[tuple[Trail, np.ndarray]] = []
        self._shape = _sizes(session.model)
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
        check(rows, "recording", "nothing recorded", f"at least one decision: {self._why_nothing()}")
        if self.full and not self._asked:
            text = (
                f"recording of {session.name}: full after {MAX_RECORDING_SECONDS:g} simulated seconds, at "
                f"{rows[-1][0].seconds[-1]:.2f} s of the run; what followed is not in it: record it apart"
            )
            warnings.warn(text, stacklevel=3)
        if not np.array_equal(_sizes(session.model), self._shape):
            text = f"recording of {session.name}: sizes were edited meanwhile; it shows the last ones: record anew"
            warnings.warn(text, stacklevel=3)
        whole = Trail(*map(np.concatenate, zip(*(trail for trail, _ in rows), strict=True)))
        good = np.all(np.isfinite(whole.position), axis=1)
        whole = Trail(*(column[good] for column in whole))
        marks = np.concatenate([np.tile(each, (len(trail.decision), 1, 1)) for trail, each in rows])[good]
        # gaps of a fast run take no time
        time = whole.seconds[0] + np.arange(len(whole.decision)) * session.period
        activation = np.clip(np.nan_to_num(whole.activation), 0, 1)
        motion = Motion(session.model, time, whole.position, activation, session.name, marks)
        return Recorded(motion, whole.seconds, trail_plots(session, whole, time))

    def _why_nothing(self) -> str:
        if self._session.ended:
            return "the run has ended"
        playing = self._session.snapshot().playing
        return "the run made none while it was recorded" if playing else "the run is paused"

    def _run(self) -> None:
        try:
            while not self._session.ended and not self.full:
                self._read()
                if self._stop.wait(EVERY):
                    if not self.full:
                        self._read()
                    return
        except RuntimeError as error:  # the recording ends with the run
            self._failed = None if self._session.ended else error
        except Exception as error:  # raised by `stop`, in the caller's thread
            self._failed = error

    def _read(self) -> None:
        """Add the decisions made since the last reading."""
        moment = self._session.snapshot()
        trail = self._session.trail()
        if moment.reset_count != self._resets:
            self._resets = moment.reset_count
            self._go_back(trail)
        room = self._most - sum(len(rows.decision) for rows, _ in self._rows)
        new = np.flatnonzero(trail.decision >= self._next)[:room]
        if new.size:
            self._rows.append((Trail(*(column[new] for column in trail)), moment.marks[0].reshape(-1, 4)))
            self._next = int(trail.decision[new[-1]]) + 1
        self.full = new.size == room

    def _go_back(self, trail: Trail) -> None:
        """Drop what the run has left by going back, from which it may have gone on since: what is later than its trail,
        and what that has otherwise.
        """
        end = int(trail.decision[-1]) if len(trail.decision) else 0
        left = end + 1
        for rows, _ in self._rows:
            both, here, there = np.intersect1d(rows.decision, trail.decision, return_indices=True)
            other = both[np.any(rows.position[here] != trail.position[there], axis=1)]
            left = min([left, *other.tolist()])
        kept = [(_before(rows, left), marks) for rows, marks in self._rows]
        self._rows = [(rows, marks) for rows, marks in kept if len(rows.decision)]
        self._next = min(self._next, left if self._rows else end)


def path_until(trail: Trail, snapshot: Snapshot) -> np.ndarray:
    """The places `(n, 2)` of a particle up to a moment, which a trail may not reach, or pass."""
    before = trail.position[trail.decision < snapshot.decision, :2]
    return np.concatenate([before, snapshot.position[:1, :2]])


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


def _sizes(model: mujoco.MjModel) -> np.ndarray:
    """The numbers of a model that may be edited and change its shape."""
    return np.concatenate([model.geom_size.ravel(), model.hfield_size.ravel()])


def _before(trail: Trail, decision: int) -> Trail:
    """The part of a trail before a decision."""
    return Trail(*(column[trail.decision < decision] for column in trail))
