"""Muscles as tubes along their wrapped path: colour by activation, thickness by force, faded when silent."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motorgrad.sim import _muscles
from motorgrad.sim.scene import _paths, _turns
from motorgrad.sim.scene._layer import Layer
from motorgrad.sim.scene._pool import Pool
from motorgrad.sim.scene._shapes import ball, tube
from motorgrad.sim.scene._tension import tendon_tension

if TYPE_CHECKING:
    import viser

    from motorgrad.sim.live import Session
    from motorgrad.sim.scene._pose import Pose

SLICES = 12  # facets around a tube
SILENT_OPACITY = 0.45


class Muscles(Layer):
    """Every spatial tendon as a tube: rods along its path, balls where they meet.

    The pools have room for all that can wrap, so that a muscle which begins to wrap adds no mesh.
    """

    name = "Muscles"

    def build(self, server: viser.ViserServer, session: Session) -> None:
        model = session.model
        if model is None or not model.nwrap:
            return
        most, ends = _paths.most_segments(model)
        self.applies = True
        self.pools = [
            Pool(server.scene, "/muscles/tubes", tube(SLICES), most, faded=True),
            Pool(server.scene, "/muscles/joints", ball(SLICES), most + ends, faded=True),
        ]

    def draw(self, pose: Pose) -> None:
        model = pose.model
        assert model is not None
        radius = _muscles.least_width(model, pose.size / 2)
        tubes, joints = [], []
        for data, offset, activation in zip(pose.bodies, pose.offset, pose.activation, strict=True):
            run = _paths.segments(model, data)
            level = _muscles.tendon_activation(model, activation)
            thick = radius * _muscles.width(tendon_tension(model, data.actuator_force))
            colour, solid = _muscles.colour(level), np.nan_to_num(level, nan=1.0)
            fade = SILENT_OPACITY + (1 - SILENT_OPACITY) * solid
            along, of = run.end - run.start, run.tendon
            length = np.linalg.norm(along, axis=1)
            size = np.stack([thick[of], thick[of], length], axis=1)
            middle = (run.start + run.end) / 2 + offset
            tubes.append((middle, _turns.towards(along), size, colour[of], fade[of]))
            knots = np.concatenate([run.start, run.end[run.last]]) + offset
            at = np.concatenate([of, of[run.last]])
            round_ = np.repeat(thick[at, None], 3, axis=1)
            # a ball would show through a tube that one can see through: it comes as the muscle fires
            joints.append((knots, _turns.still(len(at)), round_, colour[at], np.sqrt(solid[at])))
        for pool, rows in zip(self.pools, (tubes, joints), strict=True):
            pool.show(*(np.concatenate(column) for column in zip(*rows, strict=True)))
