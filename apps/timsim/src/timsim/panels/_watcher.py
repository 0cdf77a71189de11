"""Record the camera of a live run, and what programs add to its pictures, so that a film can be made later."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from timsim.film import Annotations, Viewpoint
from timsim.live import Session, Snapshot

RATE = 30.0  # Hz
Annotating = Callable[[Snapshot], Annotations]
"""A function from a moment to the texts, plots and arrows that its picture shows."""


def no_annotations(snapshot: Snapshot) -> Annotations:
    """No annotations."""
    del snapshot
    return Annotations()


class Watcher:
    """Records annotations, and a camera that moves, 30 times a second until it is stopped.

    **Arguments:** `session`; `annotations`; `camera`: a function of the simulated time, or None.

    A run that goes back in time discards what was recorded after that moment. `stop` raises any error of `camera`.
    """

    def __init__(
        self, session: Session, annotations: Annotating, camera: Callable[[float], Viewpoint] | None = None
    ) -> None:
        self._session, self._annotations, self._camera = session, annotations, camera
        self._moments: list[float] = []
        self._added: list[Annotations] = []
        self._views: list[Viewpoint] = []
        self._failed: Exception | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="motorgrad sim watcher", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the recording."""
        self._stop.set()
        self._thread.join()
        if self._failed is not None:
            raise self._failed

    def viewpoint(self, moment: float) -> Viewpoint:
        """The camera at a simulated time in s, after `stop`."""
        rows = np.array([[*v.position, *v.target, *v.up, v.field_of_view] for v in self._views])
        x = [float(np.interp(moment, self._moments, column)) for column in rows.T]
        return Viewpoint((x[0], x[1], x[2]), (x[3], x[4], x[5]), x[9], (x[6], x[7], x[8]))

    def annotations(self, moment: float) -> Annotations:
        """What was added to the picture at a simulated time in s, after `stop`; arrows move between two readings."""
        when = self._moments
        if not when:
            return Annotations()
        row = min(max(int(np.searchsorted(when, moment, "right")) - 1, 0), len(when) - 1)
        late = min(row + 1, len(when) - 1)
        part = (moment - when[row]) / (when[late] - when[row]) if late > row else 0.0
        return self._added[row].towards(self._added[late], float(np.clip(part, 0, 1)))

    def _run(self) -> None:
        try:
            while not self._session.ended:
                self._read(self._session.snapshot())
                if self._stop.wait(1 / RATE):
                    return
        except RuntimeError as error:  # the recording ends with the run
            self._failed = None if self._session.ended else error
        except Exception as error:  # raised by `stop`, in the caller's thread
            self._failed = error

    def _read(self, snapshot: Snapshot) -> None:
        while self._moments and self._moments[-1] > snapshot.seconds:
            for column in (self._moments, self._added, self._views):
                if column:
                    column.pop()
        if self._moments and self._moments[-1] == snapshot.seconds:
            return
        added = self._annotations(snapshot)
        view = self._camera and self._camera(snapshot.seconds)
        if view is not None:
            self._views.append(view)
        self._moments.append(snapshot.seconds)
        self._added.append(added)
