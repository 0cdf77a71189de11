"""The pictures of a film of a live run: its bodies or a particle's plane at a moment, and the plots beside them."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from motorgrad.plane import has_local_units
from motorgrad.tasks import ParticleTask
from timsim.film import GAP, Arrow, Camera, Ground, Painter, Plot, PlotStrip, Viewpoint, caption
from timsim.live import Session, Snapshot
from timsim.panels._motion_recorder import PLOTS, path_until, trail_plots
from timsim.plane import PlanePicture
from timsim.scene import Pose, main_metric

RENEW = 1.0  # s between two drawings of the plots beside a film, each of which takes about 0.1 s for a plot
RECENT = 8.0  # s of simulated time that they show
CURVE = "learning curve"
CHOICES = (*PLOTS, CURVE)
"""What can be plotted beside a film."""


class PictureOptions(NamedTuple):
    """What a film is to look like, as `FilmRecorder` describes it."""

    width: int
    height: int
    camera: Camera
    ground: Ground
    titles: bool


class Painting(Protocol):
    """Paints pictures of a session's moments. Use it from one thread only."""

    def paint(self, snapshot: Snapshot, arrows: Sequence[Arrow] = ()) -> np.ndarray:
        """The picture `(height, width, 3)`, uint8."""
        ...

    def close(self) -> None:
        """Free the resources of the graphics driver."""


class Bodies(Painting):
    """Pictures of the bodies side by side; with a viewpoint, one picture with all of them, as on the page."""

    def __init__(self, session: Session, snapshot: Snapshot, options: PictureOptions) -> None:
        self._pose = Pose(session.model)
        self._options = options
        camera = options.camera
        self._moving = camera if callable(camera) else None
        self._together = callable(camera) or isinstance(camera, Viewpoint)
        count = 1 if self._together else len(snapshot.position)
        self._painters: list[Painter] = []
        self._open(count)
        self._name = session.name
        self._canvas = np.full((options.height, count * (options.width + GAP) - GAP, 3), 255, np.uint8)

    def _open(self, count: int) -> None:
        """Open painters of the body as it is now; they keep a copy of its model."""
        self.close()
        model: Any = copy.copy(self._pose.model)
        model.vis.quality.offsamples = 0  # multisampling would more than double the time of a software renderer
        width, height, camera, ground, _ = self._options
        still = None if callable(camera) else camera
        self._painters = [Painter(model, width=width, height=height, camera=still, ground=ground) for _ in range(count)]
        self._edits = self._pose.edits

    def paint(self, snapshot: Snapshot, arrows: Sequence[Arrow] = ()) -> np.ndarray:
        self._pose.place(snapshot)
        if self._pose.edits != self._edits:
            self._open(len(self._painters))
        marks = snapshot.marks.reshape(len(snapshot.marks), -1, 4)
        pose = self._pose
        width, titles = self._options.width, self._options.titles
        clock = f"{snapshot.seconds:.2f} s" if titles else ""
        viewpoint = None if self._moving is None else self._moving(snapshot.seconds)
        beside = []
        if self._together:
            others = zip(pose.bodies[1:], pose.activation[1:], pose.offset[1:], strict=True)
            beside = [(data.qpos, activation, shift) for data, activation, shift in others]
        labels = snapshot.labels if len(self._painters) > 1 else (self._name,)
        self._canvas[:] = 255  # a body that was filmed may be there no more
        shown = zip(self._painters, pose.bodies, pose.activation, labels, marks, strict=False)
        for index, (painter, data, activation, label, marked) in enumerate(shown):
            left = index * (width + GAP)
            label = label if titles else ""
            added = arrows if index == 0 else ()
            picture = painter.paint(data.qpos, activation, label, clock, marked, viewpoint, beside, added)
            self._canvas[:, left : left + width] = picture
        return self._canvas.copy()

    def close(self) -> None:
        for painter in self._painters:
            painter.close()


class PlaneOfUnits(Painting):
    """Pictures of a particle's plane with the units of its policy."""

    def __init__(self, session: Session, snapshot: Snapshot, options: PictureOptions) -> None:
        width, height, _, _, self._titles = options
        self._session = session
        side = min(width, height)
        policy = session.policy(snapshot)
        assert isinstance(session.task, ParticleTask)
        assert policy is not None
        self._picture = PlanePicture(session.task, policy, side)
        self._canvas = np.full((height, width, 3), 255, np.uint8)
        self._corner = (height - side) // 2, (width - side) // 2

    def paint(self, snapshot: Snapshot, arrows: Sequence[Arrow] = ()) -> np.ndarray:
        del arrows  # the plane has none
        policy = self._session.policy(snapshot)
        if policy is not None:
            drawn = self._picture.paint(policy, path_until(self._session.trail(), snapshot))
            top, left = self._corner
            self._canvas[top : top + len(drawn), left : left + len(drawn)] = drawn
        if not self._titles:
            return self._canvas.copy()
        return caption(self._canvas, self._session.name, f"{snapshot.decision:,}")


def painting_of(session: Session) -> Callable[[Session, Snapshot, PictureOptions], Painting] | None:
    """What paints a session: its bodies, or the plane of a particle with local units; None for any other."""
    if session.model is not None:
        return Bodies
    policy = session.policy(session.snapshot())
    return PlaneOfUnits if has_local_units(session.task, policy) else None


class LiveStrip:
    """The plots beside a film of a live run."""

    def __init__(self, session: Session, names: Sequence[str], height: int) -> None:
        self._session, self._names, self._height = session, names, height
        self._strip: PlotStrip | None = None
        self._due = 0.0
        self._resets = -1

    def paint(self, moment: Snapshot) -> np.ndarray:
        """The picture of a moment."""
        now = time.monotonic()
        if now >= self._due or moment.reset_count != self._resets:
            self._due = now + RENEW
            self._resets = moment.reset_count
            plots = self._present(moment)
            if self._strip is None:
                self._strip = PlotStrip(plots, self._height)
            else:
                self._strip.show(plots)
        assert self._strip is not None
        return self._strip.at(math.nan)

    def _present(self, moment: Snapshot) -> list[Plot]:
        session = self._session
        trail = self._session.trail()
        end = moment.seconds
        recent = (trail.seconds > end - RECENT) & (trail.decision <= moment.decision)
        shown = type(trail)(*(column[recent] for column in trail))
        known = trail_plots(session, shown, shown.seconds) if recent.any() else {}
        curve = session.curve().until(moment.decision) if session.agent is not None else None
        if curve is not None and len(curve.seconds) > 1:
            name = main_metric(curve.values)
            known[CURVE] = Plot(f"{CURVE}: {name}", curve.seconds, curve.values[name])
        found = [known[name] for name in self._names if name in known]
        return found or [Plot("nothing yet", np.array([end]), np.array([np.nan]))]
