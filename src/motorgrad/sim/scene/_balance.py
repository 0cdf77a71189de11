"""Centre of mass and support polygon."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.sim.scene import _turns
from motorgrad.sim.scene._contacts import touches
from motorgrad.sim.scene._layer import Layer
from motorgrad.sim.scene._pool import Pool
from motorgrad.sim.scene._shapes import ball, rod
from motorgrad.sim.scene._support import margin, support_polygon

if TYPE_CHECKING:
    import viser

    from motorgrad.sim.live import Session
    from motorgrad.sim.scene._pose import Pose

STANDS, FALLS, MASS = (0.10, 0.62, 0.40), (0.85, 0.35, 0.10), (0.98, 0.80, 0.16)
CORNERS = 24  # of a polygon are filled; the outline has room for more
LIFT = 0.004  # sizes above the ground, so that the polygon is not in it


class Balance(Layer):
    """The centre of mass, the point under it, and the polygon between the contacts with the ground.

    Green where the point is inside the polygon, so that the body would stand still; orange where it is not.
    """

    name = "Centre of mass and support"

    def __init__(self, shown: bool = False) -> None:
        super().__init__(shown)
        self._fills: list[Any] = []

    def build(self, server: viser.ViserServer, session: Session) -> None:
        model = session.model
        if model is None or not model.body_mass.any():
            return
        gravity = np.array(model.opt.gravity)
        length = np.linalg.norm(gravity)
        self._up = -gravity / length if length > 0 else np.array([0.0, 0.0, 1.0])
        self._scene = server.scene
        self.applies = True
        self.pools = [
            Pool(server.scene, "/balance/balls", ball(), 4, shadow=False),
            Pool(server.scene, "/balance/lines", rod(), 16, shadow=False),
        ]

    def switch(self, shown: bool) -> None:
        super().switch(shown)
        for fill in self._fills:
            fill.visible = shown

    def draw(self, pose: Pose) -> None:
        size, up = pose.size, self._up
        balls, lines = [], []
        for row, (data, offset) in enumerate(zip(pose.bodies, pose.offset, strict=True)):
            touch = touches(pose.model, data)
            feet = touch.point[touch.ground]
            polygon = support_polygon(feet, up)
            mass = data.subtree_com[0]
            stands = margin(polygon, mass, up) >= 0
            colour = STANDS if stands else FALLS
            corners = polygon + LIFT * size * up
            # under the mass, as high as the polygon is on the whole; without one, the mass alone is shown
            level = np.mean(corners @ up) if len(corners) else mass @ up
            foot = mass + (level - mass @ up) * up
            balls += [(mass + offset, 0.028 * size, MASS), (foot + offset, 0.014 * size, colour)]
            rims = np.stack([corners, np.roll(corners, -1, axis=0)], 1) if len(corners) > 1 else np.empty((0, 2, 3))
            lines += [(rim + offset, 0.005 * size, colour) for rim in rims]
            lines.append((np.stack([mass, foot]) + offset, 0.003 * size, MASS))
            self._fill(row, corners + offset, colour)
        for fill in self._fills[len(pose.bodies) :]:
            fill.visible = False
        place, radius, colours = (np.array(column) for column in zip(*balls, strict=True))
        self.pools[0].show(place, _turns.still(len(place)), np.repeat(radius[:, None], 3, axis=1), colours)
        ends, radius, colours = (np.array(column) for column in zip(*lines, strict=True))
        along = ends[:, 1] - ends[:, 0]
        sizes = np.stack([radius, radius, np.linalg.norm(along, axis=1)], axis=1)
        self.pools[1].show(ends.mean(1), _turns.towards(along), sizes, colours)

    def _fill(self, row: int, corners: np.ndarray, colour: tuple[float, float, float]) -> None:
        """Fill a body's polygon: a fan of as many triangles as ever, those not needed without area."""
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
