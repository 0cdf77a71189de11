"""A stored motion as the subject of a run: it can be played, paused, set to any moment and viewed at any speed."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from typing import Any

import mujoco
import numpy as np

from timsim.film import resample
from timsim.live._bare_model import DECISION, BareModel
from timsim.live._drive import Driving, control_limits
from timsim.live._setup import Setup


class MotionPlayer(BareModel):
    """A model that plays a motion in a loop; nothing is simulated.

    Velocities are those of the motion, so that muscles have the forces of their lengths, velocities and activations.

    **Attributes:** `horizon`: the decision of the last frame, to which a page can go at once.
    """

    def __init__(self, setup: Setup):
        motion: Any = setup.motion
        self._frames = max(2, round(motion.seconds / DECISION) + 1)
        self.horizon = self._frames - 1
        moments = np.linspace(0.0, motion.seconds, self._frames)
        _, self._position, self._activation, _ = resample(motion, moments)
        super().__init__(setup)
        self.period = motion.seconds / self.horizon if motion.seconds > 0 else DECISION
        model = self.model
        self._velocity = np.zeros((self._frames, model.nv))
        for row in range(self.horizon):
            ends = self._position[row], self._position[row + 1]
            mujoco.mj_differentiatePos(model, self._velocity[row], self.period, *ends)
        self._velocity[-1] = self._velocity[-2]
        low, high = control_limits(model).T
        self._control = low + self._activation * (high - low)
        last = model.actuator_actadr + model.actuator_actnum - 1
        self._active = np.flatnonzero(model.actuator_actadr >= 0)
        self._places = last[self._active]
        self._place()

    def advance(self, ticks: int) -> None:
        self.tick += ticks
        self._place()

    def push(self, body: str, force: tuple[float, float, float], seconds: float) -> None:
        self._recorded("push")

    def control(self, actuator: int, value: float) -> None:
        self._recorded("control")

    def drive(self, order: Driving) -> None:
        self._recorded("drive")

    def begin_again(self) -> None:
        super().begin_again()
        if hasattr(self, "_places"):
            self._place()

    def _recorded(self, what: str) -> None:
        raise ValueError(f"{what}: the motion was recorded, so nothing moves this body otherwise")

    def _place(self) -> None:
        """Place the body as at this decision."""
        data = self._data
        row = self.tick % self._frames
        data.qpos[:] = self._position[row]
        data.qvel[:] = self._velocity[row]
        data.ctrl[:] = self._control[row]
        data.act[self._places] = self._activation[row][self._active]
        data.time = self.tick * self.period
        mujoco.mj_forward(self.model, data)
