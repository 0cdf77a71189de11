"""The bodies in view, in MuJoCo data of the page's own, placed where a snapshot tells."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import mujoco
import numpy as np

from motorgrad.bodies import actuator_levels, install_muscle_callback
from timsim.film import Outline, bounding_box
from timsim.live import Snapshot

APART = 1.6  # distance of bodies side by side, in widths of one


class Pose:
    """The bodies in view in their present posture, with forces and contacts; one for each page.

    **Arguments:** `model`, which only edits change; None for a world without one.

    **Attributes:**

    - `model`, as given.
    - `bodies`: an `MjData` for each body in view, after `mj_forward`.
    - `activation` `(bodies, nu)`: of each actuator, in [0, 1].
    - `offset` `(bodies, 3)` m: added to all positions when drawing, so that bodies stand side by side.
    - `size`: the diagonal of the box around one body, in m; `middle` `(3,)`: of that box at the start.
    - `snapshot`: the one placed last; None before.
    - `edits`: how often sizes, masses, gravity or the height of the ground have changed.
    """

    def __init__(self, model: mujoco.MjModel | None) -> None:
        self.model = model
        self.bodies: list[mujoco.MjData] = []
        self.activation = np.zeros((0, 0 if model is None else model.nu))
        self.offset = np.zeros((0, 3))
        # of the board that shows a particle's plane
        self.size = 1.4
        self.middle = np.array([0.0, 0.0, 0.55])
        self.snapshot: Snapshot | None = None
        self.edits = 0
        if model is None:
            return
        self._numbers = _edited(model)

        install_muscle_callback(model)
        self._outline = Outline(model)
        start = model.key_qpos[0] if model.nkey else model.qpos0
        low, high = bounding_box(model, start)
        self.size = float(np.linalg.norm(high - low))
        self.middle = (low + high) / 2
        self._step = _side_step(model, high - low)

    def place(self, snapshot: Snapshot) -> None:
        """Place the bodies as in `snapshot`. A body whose state is not finite stays where it was."""
        self.snapshot = snapshot
        if self.model is None:
            return

        model = self.model
        count = len(snapshot.position)
        if not np.array_equal(numbers := _edited(model), self._numbers):
            self.edits = self.edits + 1
            self._numbers = numbers
        while len(self.bodies) < count:
            self.bodies.append(mujoco.MjData(model))
        del self.bodies[count:]
        self.offset = np.arange(count)[:, None] * self._step
        self.activation = np.zeros((count, model.nu))
        for row, data in enumerate(self.bodies):
            state = (snapshot.position, snapshot.velocity, snapshot.activation, snapshot.control)
            if not all(np.all(np.isfinite(array[row])) for array in state[:3]):
                continue
            control = np.nan_to_num(state[3][row])
            data.qpos[:], data.qvel[:], data.act[:] = (array[row] for array in state[:3])
            data.ctrl[:] = control
            data.time = snapshot.seconds
            mujoco.mj_forward(model, data)
            self.activation[row] = actuator_levels(model, data.ctrl, data.act)

    @property
    def centre(self) -> np.ndarray:
        """The centre of mass of the first body, `(3,)`, as drawn."""
        return self.bodies[0].subtree_com[0] + self.offset[0] if self.bodies else self.middle

    @property
    def centres(self) -> np.ndarray:
        """The centres of mass of all bodies in view, `(bodies, 3)`, as drawn."""
        return np.array([data.subtree_com[0] for data in self.bodies]) + self.offset

    @property
    def boxes(self) -> np.ndarray:
        """The boxes around the bodies in view and what their tasks mark, `(bodies, 2, 3)`, as drawn."""
        assert self.snapshot is not None
        marks = self.snapshot.marks.reshape(len(self.bodies), -1, 4)
        found = [self._outline.box(data, marked) for data, marked in zip(self.bodies, marks, strict=True)]
        return np.array(found) + self.offset[:, None]


def _edited(model: mujoco.MjModel) -> np.ndarray:
    """The numbers of a model that may be edited and that pictures show."""
    shown = (model.geom_size, model.hfield_size, model.body_mass, model.opt.gravity)
    return np.concatenate([np.ravel(each) for each in shown])


def _side_step(model: mujoco.MjModel, extent: np.ndarray) -> np.ndarray:
    """The offset from one body to the next, across the direction of travel; none on a height field, which is at one
    place.
    """
    if np.any(model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD):
        return np.zeros(3)
    if np.any(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
        return np.array([0.0, APART * extent[1], 0.0])
    return np.array([APART * max(extent[0], extent[1]), 0.0, 0.0])
