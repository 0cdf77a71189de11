"""Annotations of motion and scale: the trail of the body, its ghost of a moment ago, and a bar of known length."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from collections import deque
from typing import Any

import mujoco
import numpy as np
import viser

from timsim.film import ground_height, nice_step
from timsim.live import Session
from timsim.scene._bodies import Pieces, placed_pieces, unit_pieces
from timsim.scene._geometry import Shape, rod
from timsim.scene._layer import Layer, MeshPool
from timsim.scene._pose import Pose

LINKS = 30  # rods of a trail
SECONDS = 1.5  # of simulated time that a trail shows
AGO = 0.5  # s of simulated time between a body and its ghost
NEAR = 0.2  # s: of a fast run so few moments are seen that none may be nearer to that time; then there is no ghost
TRAIL = (0.95, 0.45, 0.05)
GHOST = (0.35, 0.45, 0.60)
BAR = (0.12, 0.14, 0.17)
FAINT = 0.22  # opacity of a ghost


class Trail(Layer):
    """Draws the path of the first body's centre of mass over the last seconds, thinner with age."""

    name = "Trail"

    def build(self, server: viser.ViserServer, session: Session) -> None:
        if session.model is not None:
            self.applies = True
            self.pools = [MeshPool(server.scene, "/trail", rod(), LINKS, shadow=False)]
        self._points: deque[tuple[float, np.ndarray]] = deque(maxlen=LINKS + 1)
        self._resets = -1

    def draw(self, pose: Pose) -> None:
        snapshot, points = pose.snapshot, self._points
        assert snapshot is not None
        if snapshot.reset_count != self._resets or (points and snapshot.seconds < points[-1][0]):
            self._resets = snapshot.reset_count
            points.clear()
        if points and np.linalg.norm(pose.centre - points[-1][1]) > 2 * pose.size:  # a new episode
            points.clear()
        if not points or snapshot.seconds - points[-1][0] >= SECONDS / LINKS:
            points.append((snapshot.seconds, pose.centre.copy()))
        while points[0][0] < snapshot.seconds - SECONDS:
            points.popleft()
        place = np.array([point for _, point in points] + [pose.centre])
        age = np.array([snapshot.seconds - seconds for seconds, _ in points])
        radius = 0.004 * pose.size * (1 - age / SECONDS)
        self.pools[0].show_rods(place[:-1], place[1:], radius, np.tile(TRAIL, (len(age), 1)))


class Ghost(Layer):
    """Draws the first body as it was half a simulated second ago, translucently."""

    name = "Ghost (0.5 s ago)"
    initially_shown = False

    def build(self, server: viser.ViserServer, session: Session) -> None:
        model = session.model
        if model is None:
            return
        self._data = mujoco.MjData(model)
        self._past = deque[tuple[float, np.ndarray]](maxlen=500)
        self._parts = []
        self._edits = 0
        self._resets = -1
        for kind, shape, pieces in _moving(model):
            pool = MeshPool(server.scene, f"/ghost/{kind}", shape, len(pieces.geom), shadow=False, opacity=FAINT)
            self._parts.append((pool, pieces))
        self.pools = [pool for pool, _ in self._parts]
        self.applies = bool(self.pools)

    def draw(self, pose: Pose) -> None:
        snapshot, past, model = pose.snapshot, self._past, pose.model
        assert snapshot is not None
        assert model is not None
        if pose.edits != self._edits:  # sizes may have changed
            self._edits = pose.edits
            self._parts = [
                (pool, pieces) for (pool, _), (_, _, pieces) in zip(self._parts, _moving(model), strict=True)
            ]
        if snapshot.reset_count != self._resets:  # from one moment to another, between which the run was not
            self._resets = snapshot.reset_count
            past.clear()
        past.append((snapshot.seconds, snapshot.position[0].copy()))
        when = snapshot.seconds - AGO
        while len(past) > 1 and abs(past[1][0] - when) <= abs(past[0][0] - when):
            past.popleft()
        seconds, position = past[0]
        if abs(seconds - when) > NEAR or not np.isfinite(position).all():
            for pool, _ in self._parts:
                pool.show(*(np.empty((0, columns)) for columns in (3, 4, 3, 3)))
            return
        self._data.qpos[:] = position
        mujoco.mj_kinematics(model, self._data)
        for pool, pieces in self._parts:
            place, turn, size = placed_pieces(self._data, pose.offset[0], pieces)
            pool.show(place, turn, size, np.tile(GHOST, (len(place), 1)))


def _moving(model: mujoco.MjModel) -> list[tuple[str, Shape, Pieces]]:
    """The copies of each unit shape that move."""
    found = []
    for kind, shape, pieces in unit_pieces(model):
        moving = pieces.take(model.body_weldid[model.geom_bodyid[pieces.geom]] != 0)
        found += [(kind, shape, moving)] if len(moving.geom) else []
    return found


class ScaleBar(Layer):
    """Draws a bar of a round length on the ground beside the body, with its length in words."""

    name = "Scale bar"

    def __init__(self) -> None:
        super().__init__()
        self._label: Any = None
        self._at: tuple[float, ...] = ()

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self._scene = server.scene
        if session.model is not None:
            self.applies = True
            self.pools = [MeshPool(server.scene, "/scale/bar", rod(), 3, shadow=False)]

    def draw(self, pose: Pose) -> None:
        long = nice_step(0.7 * pose.size)
        middle = np.round(pose.centre[:2] / long) * long  # it stands still while the body moves by less than its length
        if (*middle, pose.edits) == self._at:
            return
        self._at = (*middle, pose.edits)
        aside = np.array([*middle, 0.0]) - (0.0, 0.3 * pose.size, 0.0)
        height = ground_height(pose.model, pose.bodies[0], aside[None])
        low = pose.middle[2] - 0.5 * pose.size if height is None else float(height[0])
        ends = aside + np.array([(-long / 2, 0, 0), (long / 2, 0, 0)])
        ends[:, 2] = low + 0.012 * pose.size
        up = np.array([0, 0, 0.035 * pose.size])
        start = np.array([ends[0], *(ends - up / 3)])
        end = np.array([ends[1], *(ends + up)])
        self.pools[0].show_rods(start, end, 0.006 * pose.size, np.tile(BAR, (3, 1)))
        words = f"{long:g} m" if long >= 1 else f"{100 * long:g} cm" if long >= 0.01 else f"{1000 * long:g} mm"
        if self._label is None:
            self._label = self._scene.add_label("/scale/label", words, anchor="bottom-center", visible=self.shown)
        self._label.position = ends.mean(axis=0) + up

    def switch(self, shown: bool) -> None:
        super().switch(shown)
        if self._label is not None:
            self._label.visible = shown
