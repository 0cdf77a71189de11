"""Where a body touches, and with which force."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motorgrad.sim.scene import _turns
from motorgrad.sim.scene._layer import Layer
from motorgrad.sim.scene._pool import Pool
from motorgrad.sim.scene._shapes import arrow, ball

if TYPE_CHECKING:
    import mujoco
    import viser

    from motorgrad.sim.live import Session
    from motorgrad.sim.scene._pose import Pose

FORCE, POINT = (0.10, 0.55, 0.85), (1.0, 0.72, 0.10)
LONGEST, SHORTEST = 0.45, 0.01  # sizes of the body: what no arrow reaches; what is left out
THICK = 0.2  # sizes, of the arrow's unit mesh
ROOM, MOST = 32, 128  # contacts of all bodies: how many there is room for at first, and how many strongest are drawn


class Touch(NamedTuple):
    """Contacts that press.

    `point` `(n, 3)`: on the surface of the ground; `force` `(n, 3)` in N, on the moving part; `ground` `(n,)`: whether
    the other part is fixed to the world.
    """

    point: np.ndarray
    force: np.ndarray
    ground: np.ndarray


def touches(model: mujoco.MjModel, data: mujoco.MjData) -> Touch:
    """The contacts of a posture that press, after `mj_forward`; between two moving parts the force on the second."""
    import mujoco

    points, forces, ground = [], [], []
    wrench = np.zeros(6)
    for index in range(data.ncon):
        contact = data.contact[index]
        mujoco.mj_contactForce(model, data, index, wrench)
        if contact.exclude or wrench[0] <= 0:
            continue
        fixed = [geom >= 0 and model.body_weldid[model.geom_bodyid[geom]] == 0 for geom in contact.geom]
        frame = contact.frame.reshape(3, 3)  # its x points to the second geom, on which the force acts
        sign = -1.0 if fixed[1] else 1.0
        # MuJoCo's point is half way between the surfaces, which overlap: under a soft ground one would not see it
        points.append(contact.pos - sign * 0.5 * contact.dist * frame[0])
        forces.append(sign * wrench[:3] @ frame)
        ground.append(any(fixed))
    return Touch(np.reshape(points, (-1, 3)), np.reshape(forces, (-1, 3)), np.array(ground, bool))


class Contacts(Layer):
    """A dot at each contact, and an arrow of its force.

    Arrows grow with the force, and less and less so: a blow of ten times the weight would hide the body. One of the
    body's weight has 63 % of the greatest length.
    """

    name = "Contacts"

    def build(self, server: viser.ViserServer, session: Session) -> None:
        model = session.model
        if model is None:
            return
        gravity = float(np.linalg.norm(model.opt.gravity))
        self._weight = float(model.body_mass.sum()) * (gravity or 9.81)
        self.applies = True
        self.pools = [
            Pool(server.scene, "/contacts/points", ball(12), ROOM, shadow=False),
            Pool(server.scene, "/contacts/forces", arrow(), ROOM, shadow=False),
        ]

    def draw(self, pose: Pose) -> None:
        found = [touches(pose.model, data) for data in pose.bodies]
        point = np.concatenate([touch.point + offset for touch, offset in zip(found, pose.offset, strict=True)])
        force = np.concatenate([touch.force for touch in found])
        strongest = np.argsort(-np.linalg.norm(force, axis=1), kind="stable")[:MOST]
        point, force = point[strongest], force[strongest]
        long = LONGEST * -np.expm1(-np.linalg.norm(force, axis=1) / self._weight)
        seen = long > SHORTEST
        thick = np.minimum(THICK, 1.5 * long[seen])
        size = pose.size * np.stack([thick, thick, long[seen]], axis=1)
        dots, arrows = self.pools
        dots.show(point, _turns.still(len(point)), np.full((len(point), 3), 0.012 * pose.size), _same(POINT, point))
        arrows.show(point[seen], _turns.towards(force[seen]), size, _same(FORCE, point[seen]))


def _same(colour: tuple[float, float, float], rows: np.ndarray) -> np.ndarray:
    return np.tile(colour, (len(rows), 1))
