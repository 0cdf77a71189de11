"""Contacts and their forces, the centre of mass, and the support polygon."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
import viser
from scipy.spatial import ConvexHull, QhullError

from timsim.live import Session
from timsim.scene._geometry import arrow, ball, quaternions_from_z, rod
from timsim.scene._layer import Layer, MeshPool
from timsim.scene._pose import Pose

FORCE = (0.10, 0.55, 0.85)
POINT = (1.0, 0.72, 0.10)
# limits of an arrow's length, in sizes of the body; a shorter one is omitted
MAX_ARROW_LENGTH = 0.45
MIN_ARROW_LENGTH = 0.01
THICK = 0.2  # of an arrow's unit mesh, in sizes of the body
# contacts of all bodies: initial room, and how many of the strongest are drawn
ROOM = 32
MAX_DRAWN_CONTACTS = 128


class Touch(NamedTuple):
    """Contacts under pressure.

    `point` `(n, 3)`: on the surface of the ground; `force` `(n, 3)` in N, on the moving part; `ground` `(n,)`: whether
    the other part is fixed to the world.
    """

    point: np.ndarray
    force: np.ndarray
    ground: np.ndarray


def touches(model: mujoco.MjModel, data: mujoco.MjData) -> Touch:
    """The contacts under pressure, after `mj_forward`; between two moving parts, `force` acts on the second."""
    points = []
    forces = []
    ground = []
    wrench = np.zeros(6)
    for index in range(data.ncon):
        contact = data.contact[index]
        mujoco.mj_contactForce(model, data, index, wrench)
        if contact.exclude or wrench[0] <= 0:
            continue
        fixed = [geom >= 0 and model.body_weldid[model.geom_bodyid[geom]] == 0 for geom in contact.geom]
        frame = contact.frame.reshape(3, 3)  # x points to the second geom, on which the force acts
        sign = -1.0 if fixed[1] else 1.0
        # MuJoCo's point lies halfway between the overlapping surfaces, where a soft ground would hide it
        points.append(contact.pos - sign * 0.5 * contact.dist * frame[0])
        forces.append(sign * wrench[:3] @ frame)
        ground.append(any(fixed))
    return Touch(np.reshape(points, (-1, 3)), np.reshape(forces, (-1, 3)), np.array(ground, bool))


class Contacts(Layer):
    """Draws a dot at each contact and an arrow of its force.

    The length of an arrow saturates with the force, as a blow of ten times the weight would hide the body: the body's
    weight gives 63 % of the greatest length.
    """

    name = "Contacts"

    def build(self, server: viser.ViserServer, session: Session) -> None:
        model = session.model
        if model is None:
            return
        self.applies = True
        self.pools = [
            MeshPool(server.scene, "/contacts/points", ball(12), ROOM, shadow=False),
            MeshPool(server.scene, "/contacts/forces", arrow(), ROOM, shadow=False),
        ]

    def draw(self, pose: Pose) -> None:
        model = pose.model
        assert model is not None
        weight = float(model.body_mass.sum()) * (float(np.linalg.norm(model.opt.gravity)) or 9.81)
        found = [touches(model, data) for data in pose.bodies]
        point = np.concatenate([touch.point + offset for touch, offset in zip(found, pose.offset, strict=True)])
        force = np.concatenate([touch.force for touch in found])
        strongest = np.argsort(-np.linalg.norm(force, axis=1), kind="stable")[:MAX_DRAWN_CONTACTS]
        point = point[strongest]
        force = force[strongest]
        long = MAX_ARROW_LENGTH * -np.expm1(-np.linalg.norm(force, axis=1) / weight)
        seen = long > MIN_ARROW_LENGTH
        thick = np.minimum(THICK, 1.5 * long[seen])
        size = pose.size * np.stack([thick, thick, long[seen]], axis=1)
        dots, arrows = self.pools
        dots.show_balls(point, 0.012 * pose.size, POINT)
        arrows.show(point[seen], quaternions_from_z(force[seen]), size, np.tile(FORCE, (len(size), 1)))


def weight_arrow(size: float) -> float:
    """The length in m of the arrow of a force as large as the body's weight, of a body of `size` m."""
    return MAX_ARROW_LENGTH * -float(np.expm1(-1)) * size


def support_polygon(points: np.ndarray, up: np.ndarray) -> np.ndarray:
    """The corners of the smallest convex polygon around points, seen along `up`.

    **Arguments:** `points` `(n, 3)`: where the body rests; `up` `(3,)`: away from gravity.

    **Returns:** rows of `points`, `(corners, 3)`, anticlockwise as seen from above; the two ends of collinear points,
    none without points.
    """
    points = np.asarray(points, float).reshape(-1, 3)
    flat = points @ level_axes(up).T
    if len(points) > 2:
        try:
            return points[ConvexHull(flat).vertices]
        except QhullError:  # collinear
            pass
    if len(points) < 2:
        return points
    along = flat[np.argmax(np.linalg.norm(flat - flat[0], axis=1))] - flat[0]
    place = flat @ along
    return points[[np.argmin(place), np.argmax(place)]] if np.ptp(place) > 0 else points[:1]


def stability_margin(polygon: np.ndarray, point: np.ndarray, up: np.ndarray) -> float:
    """How far, in m, the point `(3,)` is inside the polygon `(corners, 3)`, seen along `up`; negative outside.

    This is the stability margin of legged locomotion (McGhee and Frank, 1968). It is -infinity without a polygon.
    """
    if not len(polygon):
        return -np.inf
    axes = level_axes(up)
    corners = polygon @ axes.T
    place = axes @ point
    if len(corners) == 1:
        return -float(np.linalg.norm(place - corners[0]))
    edges = np.roll(corners, -1, axis=0) - corners
    from_corner = place - corners
    length = np.maximum(np.sum(edges**2, 1), 1e-18)
    near = corners + np.clip(np.sum(from_corner * edges, 1) / length, 0, 1)[:, None] * edges
    distance = float(np.linalg.norm(place - near, axis=1).min())
    inside = len(corners) > 2 and np.all(edges[:, 0] * from_corner[:, 1] - edges[:, 1] * from_corner[:, 0] >= 0)
    return distance if inside else -distance


def level_axes(up: np.ndarray) -> np.ndarray:
    """Two axes perpendicular to `up`, as rows `(2, 3)`, that form a right-handed system with it."""
    up = np.asarray(up, float) / np.linalg.norm(up)
    first = np.cross(np.eye(3)[np.argmin(np.abs(up))], up)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)])


STANDS = (0.10, 0.62, 0.40)
FALLS = (0.85, 0.35, 0.10)
MASS = (0.98, 0.80, 0.16)
CORNERS = 24  # of a polygon that are filled; the outline has room for more
LIFT = 0.004  # of the polygon above the ground, in sizes of the body


class Balance(Layer):
    """Draws the centre of mass, its projection onto the ground, and the support polygon between the contacts.

    The polygon is green where the projection is inside, so that the body would stand still, and orange elsewhere.
    """

    name = "Centre of mass and support"

    initially_shown = False

    def __init__(self) -> None:
        super().__init__()
        self._fills: list[Any] = []

    def build(self, server: viser.ViserServer, session: Session) -> None:
        model = session.model
        if model is None or not model.body_mass.any():
            return
        self._scene = server.scene
        self.applies = True
        self.pools = [
            MeshPool(server.scene, "/balance/balls", ball(), 4, shadow=False),
            MeshPool(server.scene, "/balance/lines", rod(), 16, shadow=False),
        ]

    def switch(self, shown: bool) -> None:
        super().switch(shown)
        for fill in self._fills:
            fill.visible = shown

    def draw(self, pose: Pose) -> None:
        assert pose.model is not None
        gravity = np.array(pose.model.opt.gravity)
        length = float(np.linalg.norm(gravity))
        size = pose.size
        up = -gravity / length if length > 0 else np.array([0.0, 0.0, 1.0])
        balls = []
        lines = []
        for row, (data, offset) in enumerate(zip(pose.bodies, pose.offset, strict=True)):
            touch = touches(pose.model, data)
            feet = touch.point[touch.ground]
            polygon = support_polygon(feet, up)
            mass = data.subtree_com[0]
            stands = stability_margin(polygon, mass, up) >= 0
            colour = STANDS if stands else FALLS
            corners = polygon + LIFT * size * up
            # the projection at the polygon's mean height; without a polygon only the mass is shown
            level = np.mean(corners @ up) if len(corners) else mass @ up
            foot = mass + (level - mass @ up) * up
            balls += [(mass + offset, 0.028 * size, MASS), (foot + offset, 0.014 * size, colour)]
            rims = np.stack([corners, np.roll(corners, -1, axis=0)], 1) if len(corners) > 1 else np.empty((0, 2, 3))
            lines += [(rim + offset, 0.005 * size, colour) for rim in rims]
            lines.append((np.stack([mass, foot]) + offset, 0.003 * size, MASS))
            self._fill(row, corners + offset, colour)
        for fill in self._fills[len(pose.bodies) :]:
            fill.visible = False
        self.pools[0].show_balls(*(np.array(column) for column in zip(*balls, strict=True)))
        ends, radius, colours = (np.array(column) for column in zip(*lines, strict=True))
        self.pools[1].show_rods(ends[:, 0], ends[:, 1], radius, colours)

    def _fill(self, row: int, corners: np.ndarray, colour: tuple[float, float, float]) -> None:
        """Fill a body's polygon with a fan of constantly many triangles; unused ones have no area."""
        if row == len(self._fills):
            fan = np.stack([np.zeros(CORNERS - 2, int), np.arange(1, CORNERS - 1), np.arange(2, CORNERS)], 1)
            fill = self._scene.add_mesh_simple(
                f"/balance/support/{row}", np.zeros((CORNERS, 3)), fan, opacity=0.35, side="double", cast_shadow=False
            )
            self._fills.append(fill)
        fill = self._fills[row]
        fill.visible = len(corners) > 2
        if len(corners) > 2:
            fill.vertices = corners[np.minimum(np.arange(CORNERS), len(corners) - 1)].astype(np.float32)
            fill.color = tuple(round(255 * part) for part in colour)
