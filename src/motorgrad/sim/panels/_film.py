"""A film of a run as it goes on, rendered beside it."""

from __future__ import annotations

import copy
import math
import os
import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad._errors import check
from motorgrad._files import check_writable
from motorgrad.sim._film import GAP, target_of
from motorgrad.sim._renderer import check_picture

if TYPE_CHECKING:
    from motorgrad.sim.live import Session, Snapshot

FPS, WIDTH, HEIGHT = 30.0, 640, 480
LABELS = ("learning", "untrained")


class FilmRecorder:
    """Films what a session does from now on, in the time of the clock, until it is stopped.

    MuJoCo's renderer paints the present moment `fps` times a second, with muscles as in every film of this library, but
    without multisampling; a moment that took too long to paint is shown the longer, so that a film always lasts as long
    as what it shows. H.264 (x264), preset "veryfast", constant rate factor 20, 4:2:0. Where an
    untrained body stands beside at the start, both are filmed. The plane of a particle is filmed too.

    **Arguments:** `session`; `path`, ending in ".mp4"; frames a second; `width` and `height` of each body's picture.

    **Attributes:** `path`; `frames` that the film has; `painted`, those that were painted for it; `busy`, seconds that
    painting them took.

    **Raises** `ValueError` for what cannot be filmed, or where no file can be written; `stop` raises what went wrong.
    """

    def __init__(
        self,
        session: Session,
        path: str | os.PathLike[str],
        *,
        fps: float = FPS,
        width: int = WIDTH,
        height: int = HEIGHT,
    ) -> None:
        self.path = target_of(path, ".mp4")
        check_writable("path", self.path)
        check(math.isfinite(fps) and 0 < fps <= 120, "fps", fps, "above 0, at most 120")
        check_picture([], width, height, None)
        self._session, self._fps, self._size = session, fps, (width, height)
        self._make = painting_of(session)
        self.frames = self.painted = 0
        self.busy = 0.0
        self._stop = threading.Event()
        self._failed: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="motorgrad sim film", daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether it films."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """End the film and wait until its file is whole. A second time does nothing."""
        self._stop.set()
        self._thread.join()
        failed, self._failed = self._failed, None
        if failed is not None:
            raise failed

    def _run(self) -> None:
        from motorgrad.sim._video import write_mp4

        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            painting = self._make(*self._size, self._session.snapshot())
            try:
                first = painting.paint(self._session.snapshot())
                size = (first.shape[1], first.shape[0])
                write_mp4(self.path, self._pictures(painting), size, self._fps)
            finally:
                painting.close()
        except Exception as error:  # told by `stop`, in the thread of whoever asked for the film
            self._failed = error

    def _pictures(self, painting: Painting) -> Iterator[np.ndarray]:
        begin = time.monotonic()
        while not self._stop.is_set():
            since = time.monotonic()
            try:
                picture = painting.paint(self._session.snapshot())
            except RuntimeError:
                if self._session.ended:  # the film ends with the run
                    return
                raise
            self.busy += time.monotonic() - since
            self.painted += 1
            due = max(self.frames + 1, math.floor((time.monotonic() - begin) * self._fps))
            for _ in range(due - self.frames):
                yield picture
            self.frames = due
            self._stop.wait(max(0.0, begin + self.frames / self._fps - time.monotonic()))


class Painting:
    """Pictures of a session's moments: `paint` makes one, `close` frees what it holds. One thread alone uses it."""

    def paint(self, snapshot: Snapshot) -> np.ndarray:
        """The picture `(height, width, 3)`, uint8."""
        raise NotImplementedError

    def close(self) -> None:
        """Free what the graphics driver holds."""


class _Bodies(Painting):
    """Bodies, side by side."""

    def __init__(self, session: Session, width: int, height: int, snapshot: Snapshot) -> None:
        from motorgrad.sim._painter import Painter
        from motorgrad.sim.scene import Pose

        self._pose = Pose(session.model)
        count = len(snapshot.position)
        model: Any = copy.copy(session.model)
        model.vis.quality.offsamples = 0  # smooth edges would more than double the time of a software renderer
        self._painters = [Painter(model, width=width, height=height) for _ in range(count)]
        self._labels = LABELS if count > 1 else (session.name,)
        self._canvas = np.full((height, count * (width + GAP) - GAP, 3), 255, np.uint8)
        self._width = width

    def paint(self, snapshot: Snapshot) -> np.ndarray:
        self._pose.place(snapshot)
        shown = zip(self._painters, self._pose.bodies, self._pose.activation, self._labels, strict=False)
        for index, (painter, data, activation, label) in enumerate(shown):
            clock = f"{snapshot.seconds:.2f} s"
            left = index * (self._width + GAP)
            picture = painter.paint(data.qpos, activation, label, clock)
            self._canvas[:, left : left + self._width] = picture
        return self._canvas.copy()

    def close(self) -> None:
        for painter in self._painters:
            painter.close()


class _Plane(Painting):
    """The plane of a particle, and the units of its policy."""

    def __init__(self, session: Session, width: int, height: int, snapshot: Snapshot) -> None:
        from motorgrad.sim.panels._present_policy import PresentPolicy
        from motorgrad.sim.panels._units import UnitsPicture

        self._session, self._policy = session, PresentPolicy(session)
        side = min(width, height)
        self._picture = UnitsPicture(session.task, self._policy.of(snapshot.parameters[0]), side)
        self._canvas = np.full((height, width, 3), 255, np.uint8)
        self._corner = (height - side) // 2, (width - side) // 2

    def paint(self, snapshot: Snapshot) -> np.ndarray:
        from motorgrad.sim._caption import caption

        policy = self._policy.of(snapshot.parameters[0])
        if policy is not None:
            drawn = self._picture.paint(policy, self._session.trail().position[:, :2])
            top, left = self._corner
            self._canvas[top : top + len(drawn), left : left + len(drawn)] = drawn
        return caption(self._canvas, self._session.name, f"{snapshot.decision:,}")


def painting_of(session: Session) -> Callable[[int, int, Snapshot], Painting]:
    """What paints a session: from width, height and its present moment. **Raises** `ValueError` where nothing can."""
    if session.model is not None:
        return lambda width, height, now: _Bodies(session, width, height, now)
    if not can_be_filmed(session):
        raise ValueError(f"{session.name}: has neither a body nor local units, so there is nothing to film")
    return lambda width, height, now: _Plane(session, width, height, now)


def can_be_filmed(session: Session) -> bool:
    """Whether there is a body, or a particle with local units."""
    from motorgrad.sim.panels._present_policy import PresentPolicy
    from motorgrad.sim.panels._units import is_local

    if session.model is not None:
        return True
    if session.agent is None:
        return False
    return is_local(session.task, PresentPolicy(session).of(session.snapshot().parameters[0]))
