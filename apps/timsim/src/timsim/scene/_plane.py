"""The plane of a particle: a board with the reward, the particle with its trail, and its policy's units."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import numpy as np
import trimesh
import viser

from motorgrad.plane import direction_colours, draw_reward, shapes_of
from motorgrad.tasks import ParticleTask
from motorgrad.worlds import Walls
from timsim.live import Session, Snapshot
from timsim.plane import Animation
from timsim.scene._beside import label_each, rgb_of_body
from timsim.scene._geometry import arrow, ball, quaternions_from_z, ring, rod, textured_glb
from timsim.scene._layer import AWAY, Layer, MeshPool
from timsim.scene._pose import Pose
from timsim.scene._surroundings import floor_glb

LIFT = 0.05  # m from the floor to the lower edge of the board
PIXELS = 640
FACING = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
"""The rotation from a flat picture, seen along z, onto the upright board: its y becomes the world's z."""


class Board:
    """An upright board, one metre along its longer side, and the mapping from the plane to it: x to the right, y
    upwards.

    The viewer stands at negative y.

    **Arguments:** `walls`, of the box that the board shows.

    **Attributes:** `scale`: metres per unit of the plane; `half`: `(2,)` m, half its sides.
    """

    def __init__(self, walls: Walls) -> None:
        (left, right), (bottom, top) = walls.spans
        self.scale = 1.0 / max(right - left, top - bottom)
        self._middle = (left + right) / 2
        self._bottom = bottom
        self.half = np.array([right - left, top - bottom]) * self.scale / 2

    def place(self, points: np.ndarray, before: float = 0.0) -> np.ndarray:
        """Positions `(n, 3)` of points `(n, 2)`, `before` metres in front of the board."""
        points = np.asarray(points, float).reshape(-1, 2)
        across = (points[:, 0] - self._middle) * self.scale
        return np.stack([across, np.full(len(points), -before), (points[:, 1] - self._bottom) * self.scale + LIFT], 1)

    def direction(self, ways: np.ndarray) -> np.ndarray:
        """Directions `(n, 3)` of directions `(n, 2)`, of the same length."""
        ways = np.asarray(ways, float).reshape(-1, 2)
        return np.stack([ways[:, 0], np.zeros(len(ways)), ways[:, 1]], axis=1)

    def glb(self, task: ParticleTask) -> bytes:
        """The board with the task's reward painted on it, in its own coordinates: flat, seen along z."""
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * self.half
        mesh = trimesh.Trimesh(np.c_[corners, np.zeros(4)], [(0, 1, 2), (0, 2, 3)], process=False)
        return textured_glb(mesh, (corners / self.half + 1) / 2, self._picture(task), glows=True)

    def _picture(self, task: ParticleTask) -> np.ndarray:
        from matplotlib.figure import Figure

        sides = 2 * self.half / self.half.max() / 2
        figure = Figure(figsize=tuple(PIXELS * sides / 100), dpi=100, facecolor="white")
        draw_reward(figure.add_axes((0.0, 0.0, 1.0, 1.0)), task)
        return Animation(figure, ()).pixels / 255


FLOOR = np.array([0.74, 0.77, 0.77])
LEARNING = (0.82, 0.01, 0.11)  # of the particle that learns; those beside it have the colours of bodies
TRAIL = 80  # decisions of the path that are shown
# m
BALL = 0.018
LINE = 0.0035
MAX_DRAWN_UNITS = 1_000
FILLED = 0.6  # opacity of the filled part of a unit
PERIOD = 0.25  # s between two updates of the units, which take some milliseconds


def _is_particle(session: Session) -> bool:
    return session.model is None and isinstance(session.task, ParticleTask)


class Plane(Layer):
    """Draws a board with the reward, green where positive, and the particle with its last decisions."""

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self.applies = _is_particle(session)
        if not self.applies:
            return
        task: Any = session.task
        board = self._board = Board(task.physics.walls)
        middle = np.array([0.0, 0.0, board.half[1] + LIFT])
        scene = server.scene
        scene.add_glb("/plane/floor", floor_glb(np.full(2, 60.0), 1.0, FLOOR), cast_shadow=False)
        scene.add_glb("/plane/reward", board.glb(task), wxyz=FACING, position=middle)
        back = (2 * board.half[0] + 0.03, 0.02, 2 * board.half[1] + 0.03)
        scene.add_box(
            "/plane/back", color=(64, 68, 76), dimensions=back, position=middle + np.array([0.0, 0.0125, 0.0])
        )
        self.pools = [
            MeshPool(scene, "/plane/particle", ball(), 2),
            MeshPool(scene, "/plane/trail", rod(), 2 * TRAIL, shadow=False),
        ]
        self._scene = scene
        self._texts: list[viser.LabelHandle] = []
        self._trails: list[deque[np.ndarray]] = []
        self._began = -1

    def draw(self, pose: Pose) -> None:
        snapshot = pose.snapshot
        assert snapshot is not None
        count = len(snapshot.position)
        if snapshot.reset_count != self._began or len(self._trails) != count:
            self._began = snapshot.reset_count
            self._trails = [deque(maxlen=TRAIL) for _ in range(count)]
        for trail, place in zip(self._trails, snapshot.position, strict=True):
            if trail and np.linalg.norm(place[:2] - trail[-1]) * self._board.scale > 0.25:
                trail.clear()  # a new episode starts elsewhere
            trail.append(np.array(place[:2]))
        here = self._board.place(snapshot.position[:, :2], BALL)
        colours = np.array([LEARNING, *(rgb_of_body(row) for row in range(1, count))])
        self._name(snapshot.labels, here)
        self.pools[0].show_balls(here, BALL, colours)
        paths = [self._board.place(np.array(trail), 2 * LINE) for trail in self._trails]
        start, end = (np.concatenate([path[part] for path in paths]) for part in (slice(-1), slice(1, None)))
        age = np.concatenate([np.linspace(0.25, 1, TRAIL)[TRAIL - len(path) + 1 :] for path in paths])
        who = np.repeat(colours, [len(path) - 1 for path in paths], axis=0)
        self.pools[1].show_rods(start, end, LINE * age, who)

    def _name(self, labels: tuple[str, ...], here: np.ndarray) -> None:
        """Label each particle with its name, if there are several."""
        names = labels if len(here) > 1 else ()
        label_each(self._scene, self._texts, names)
        for text, name, place in zip(self._texts, names, here, strict=False):
            text.position = np.add(place, (0.0, 0.0, 2 * BALL))
            if text.text != name:
                text.text = name


class PlaneUnits(Layer):
    """Draws the units of a local policy: an ellipse of each unit's width, of whose area the share is filled with which
    it fires, and an arrow of its force.
    """

    name = "Units of the policy"

    def build(self, server: viser.ViserServer, session: Session) -> None:
        if not _is_particle(session) or session.agent is None:
            return

        self._session = session
        policy = session.policy(session.snapshot())
        try:
            shapes_of(policy)  # type: ignore[arg-type]
        except ValueError:  # units without a centre in the plane
            return
        self.applies = True
        task: Any = session.task
        self._board = Board(task.physics.walls)
        self._forces = np.asarray(task.dynamics.forces, float)
        room = min(len(self._forces), MAX_DRAWN_UNITS)
        scene = server.scene
        self.pools = [
            MeshPool(scene, "/units/rims", ring(), room, shadow=False),
            MeshPool(scene, "/units/discs", rod(), room, shadow=False, opacity=FILLED),
            MeshPool(scene, "/units/forces", arrow(), room, shadow=False),
        ]
        self._due = 0.0

    def renew(self, pose: Pose) -> int:
        """The units drawn last while it plays are older than the moment at which it is paused."""
        assert pose.snapshot is not None
        return int(pose.snapshot.playing)

    def draw(self, pose: Pose) -> None:
        snapshot = pose.snapshot
        now = time.monotonic()
        assert snapshot is not None
        if now >= self._due or not snapshot.playing:
            self._due = now + PERIOD
            self._place_units(snapshot)
        firing = np.nan_to_num(snapshot.probability[0])[: len(self._forces)][self._there]
        count = len(firing)
        share = np.maximum(np.sqrt(firing), AWAY)[:, None]  # of the half axes
        flat = np.column_stack([share * self._half, np.full(count, 0.002)])
        self.pools[0].show(self._at, self._turn, np.column_stack([self._half, np.full(count, 0.1)]), self._colours)
        self.pools[1].show(self._at, self._turn, flat, self._colours)

    def _place_units(self, snapshot: Snapshot) -> None:
        """Update the positions of the units."""
        policy = self._session.policy(snapshot)
        if policy is None:
            return
        shapes = shapes_of(policy)
        self._there = np.flatnonzero(shapes.active)[:MAX_DRAWN_UNITS]
        half, angle = (each[self._there] for each in shapes.ellipses())
        self._half = half * self._board.scale
        cosine = FACING[0] * np.cos(angle / 2)
        sine = FACING[0] * np.sin(angle / 2)
        self._turn = np.stack([cosine, cosine, -sine, sine], axis=1)  # in the plane, and then upright as the board
        self._at = self._board.place(shapes.centre[self._there])
        # coplanar discs would flicker where they overlap
        self._at[:, 1] -= 0.004 + 0.0005 * (np.arange(len(self._there)) % 32)
        self._colours = direction_colours(self._forces)[self._there, :3]
        forces = self._forces[self._there]
        strength = np.linalg.norm(forces, axis=1)
        long = 0.07 * strength / max(float(strength.max(initial=0.0)), 1e-12)
        size = np.repeat(long[:, None], 3, axis=1) * [2.0, 2.0, 1.0]
        self.pools[2].show(self._at, quaternions_from_z(self._board.direction(forces)), size, self._colours)
