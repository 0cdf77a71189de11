"""What a model has beside its body: sites and the axes of joints."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motorgrad.sim.scene import _turns
from motorgrad.sim.scene._layer import Layer
from motorgrad.sim.scene._pool import Pool
from motorgrad.sim.scene._shapes import arrow, ball

if TYPE_CHECKING:
    import viser

    from motorgrad.sim.live import Session
    from motorgrad.sim.scene._pose import Pose

SITE, HINGE, SLIDE = (0.55, 0.25, 0.75), (0.10, 0.35, 0.85), (0.95, 0.55, 0.10)


class Sites(Layer):
    """Every site as a small ball: where muscles begin and end, and where sensors are."""

    name = "Sites"

    def __init__(self, shown: bool = False) -> None:
        super().__init__(shown)

    def build(self, server: viser.ViserServer, session: Session) -> None:
        if session.model is not None and session.model.nsite:
            self.applies = True
            self.pools = [Pool(server.scene, "/sites", ball(12), session.model.nsite, shadow=False)]

    def draw(self, pose: Pose) -> None:
        place = np.concatenate([data.site_xpos + at for data, at in zip(pose.bodies, pose.offset, strict=True)])
        count = len(place)
        size = np.full((count, 3), 0.014 * pose.size)
        self.pools[0].show(place, _turns.still(count), size, np.tile(SITE, (count, 1)))


class JointAxes(Layer):
    """An arrow through each hinge, about which it turns by the right hand, and along each slide."""

    name = "Joint axes"

    def __init__(self, shown: bool = False) -> None:
        super().__init__(shown)

    def build(self, server: viser.ViserServer, session: Session) -> None:
        import mujoco

        model = session.model
        if model is None:
            return
        kinds = mujoco.mjtJoint
        self._joints = np.flatnonzero(np.isin(model.jnt_type, (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE)))
        if self._joints.size:
            slides = model.jnt_type[self._joints] == kinds.mjJNT_SLIDE
            self._colours = np.where(slides[:, None], SLIDE, HINGE)
            self.applies = True
            self.pools = [Pool(server.scene, "/joints", arrow(), self._joints.size, shadow=False)]

    def draw(self, pose: Pose) -> None:
        at = self._joints
        axes = np.concatenate([data.xaxis[at] for data in pose.bodies])
        anchors = np.concatenate([data.xanchor[at] + by for data, by in zip(pose.bodies, pose.offset, strict=True)])
        long = 0.13 * pose.size
        colours = np.tile(self._colours, (len(pose.bodies), 1))
        turn, size = _turns.towards(axes), np.full((len(axes), 3), long)
        self.pools[0].show(anchors - axes * long / 2, turn, size, colours)
