"""The physics of a body on a planet, in a local frame that is levelled anew as it goes."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.bodies import BodyBatch
from motorgrad.sim.planet._body import PLANET, OnPlanet
from motorgrad.sim.planet._frame import Frame, quaternion


class PlanetBatch(BodyBatch):
    """The simulation of one body on a planet.

    It is a `BodyBatch` of one seed, for the ground is laid around one body. At the beginning of a `step` gravity is
    turned so that it points down at the body's first part. Where that part has gone too far from the middle of the
    patch, the local frame is levelled under it, the patch is laid anew, and all poses and velocities are turned with
    the frame: the body's motion over the planet stays as it was. Local x and y go on, as if the planet rolled away
    under a plane.

    **Arguments** and attributes are those of `BodyBatch`, for one `OnPlanet`; and

    - `laid`: how often a patch was laid.

    **Raises:** `ValueError` for another body, or more seeds than one.
    """

    def __init__(self, body: OnPlanet, seeds: int = 1, substeps: int = 10, threads: int = 1):
        check(isinstance(body, OnPlanet) and not isinstance(body, Sequence), "body", body, "one OnPlanet")
        check(seeds == 1, "seeds", seeds, "1: the ground of a planet is laid around one body")
        self.laid = 0
        self._ground, self._ellipsoid = body.planet.ground, body.planet.ellipsoid
        self._frame: Frame | None = None
        super().__init__(body, 1, substeps, threads)

    def _bind(self) -> None:
        super()._bind()
        model = self.model
        self._down = float(np.linalg.norm(model.opt.gravity))
        planet = model.joint(PLANET)
        self._pose = slice(int(planet.qposadr[0]), int(planet.qposadr[0]) + 7)
        free = [i for i in range(model.njnt) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_FREE and i != planet.id]
        self._places = [int(model.jnt_qposadr[i]) for i in free]
        self._speeds = [int(model.jnt_dofadr[i]) for i in free]
        self._qpos, self._qvel, self._mocap, self._pushes, self._guess = (
            self._batch.bind(name)[0] for name in ("qpos", "qvel", "mocap_pos", "xfrc_applied", "qacc_warmstart")
        )

    @property
    def frame(self) -> Frame:
        """The local frame."""
        return Frame.of_pose(self._qpos[self._pose])

    @property
    def place(self) -> Float[np.ndarray, " 3"]:
        """Where the body's first part is, in the planet's coordinates, m."""
        return self.frame.to_planet(self._root)

    @property
    def _root(self) -> Float[np.ndarray, " 3"]:
        return self._qpos[self._places[0] : self._places[0] + 3].copy()

    def step(self, activation: Any) -> None:
        """Advance by one decision; as `BodyBatch.step`."""
        if np.isfinite(self._root).all():
            self.settle()
        super().step(activation)

    def settle(self) -> None:
        """Level the frame under the body if it has gone far, see to the patch, and turn gravity."""
        frame, root = self.frame, self._root
        planet = self.body.planet
        if np.hypot(*(root - frame.foot(self._ellipsoid))[:2]) > planet.travel * planet.patch:
            self._carry(frame, frame.levelled(self._ellipsoid, root))
        self._lay()

    def reset(self, rows: Any = None) -> None:
        """Put the body to its start; as `BodyBatch.reset`."""
        self._lay(self.body.planet.start)
        super().reset(rows)
        self._lay()

    def restore(self, snapshot: Any) -> None:
        """Go back to a snapshot; as `BodyBatch.restore`."""
        super().restore(snapshot)
        self._lay()

    def _lay(self, frame: Frame | None = None) -> None:
        """See to it that the patch and gravity are those of a frame, by default the present one."""
        root = np.zeros(3) if frame is not None else self._root
        frame = frame or self.frame
        model, old = self.model, self._frame
        if old is None or not all(np.array_equal(a, b) for a, b in zip(old, frame, strict=True)):
            self._frame, self._middle = frame, self._ground.lay(model, frame)
            self.laid += 1
        model.opt.gravity[:] = -self._down * frame.up(self._ellipsoid, root)
        self.refresh_models()
        self._mocap[...] = self._middle

    def _carry(self, old: Frame, new: Frame) -> None:
        """Turn all that moves from one frame's coordinates to another's."""
        turn, shift = old.move_to(new)
        turned = quaternion(turn)
        for place, speed in zip(self._places, self._speeds, strict=True):
            position, attitude = self._qpos[place : place + 3], self._qpos[place + 3 : place + 7]
            position[:] = turn @ position + shift
            product = np.empty(4)
            mujoco.mju_mulQuat(product, turned, attitude.copy())
            attitude[:] = product
            # a free joint turns about its own axes, which turn with it
            for linear in (self._qvel[speed : speed + 3], self._guess[speed : speed + 3]):
                linear[:] = turn @ linear
        for three in (self._pushes[..., :3], self._pushes[..., 3:]):
            three[:] = three @ turn.T
        self._qpos[self._pose] = new.pose
        self._qvel[int(self.model.joint(PLANET).dofadr[0]) :][:6] = 0.0
