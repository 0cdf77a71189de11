"""A recorded motion of one body."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad._arguments import check_arguments
from motorgrad._errors import check

if TYPE_CHECKING:
    import mujoco


NO_MARKS = np.zeros((1, 0, 4))


@dataclass(frozen=True, eq=False)
class Motion:
    """A recorded motion of one body.

    **Arguments:**

    - `model`: the MuJoCo model; pictures are made from a copy, it is never changed.
    - `time`: `(frames,)` s, increasing; the steps need not be equal.
    - `position`: `(frames, nq)`, the generalised coordinates `qpos`.
    - `activation`: `(frames, nu)` in [0, 1], one for each actuator (muscle).
    - `label`: the caption, such as "before learning"; may be empty.
    - `marks`: `(frames, marks, 4)` m, translucent balls at places such as targets: x, y, z and radius; by default none.

    **Raises:** `ValueError` where shapes disagree, the motion is empty, time does not increase, or a number is not
    finite or out of range. `TypeError` where `model` is not a `mujoco.MjModel`.

    ```py
    Motion(model, time=np.arange(100) / 50, position=position, activation=activation, label="after learning")
    ```
    """

    model: mujoco.MjModel
    time: np.ndarray
    position: np.ndarray
    activation: np.ndarray
    label: str = ""
    marks: np.ndarray = field(default_factory=lambda: NO_MARKS)

    def __post_init__(self) -> None:
        check_arguments(Motion, vars(self))
        for name in ("time", "position", "activation", "marks"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=float))
        frames, nq, nu = self.time.size, self.model.nq, self.model.nu
        _shape("time", self.time, (max(frames, 1),), "(frames,) with at least one frame")
        _shape("position", self.position, (frames, nq), f"({frames}, {nq}): (frames, nq of the model)")
        _shape("activation", self.activation, (frames, nu), f"({frames}, {nu}): (frames, actuators of the model)")
        if not self.marks.size:
            object.__setattr__(self, "marks", np.zeros((frames, 0, 4)))
        _shape("marks", self.marks, (frames, *self.marks.shape[1:2], 4), f"({frames}, marks, 4)")
        for name in ("time", "position", "activation", "marks"):
            array = getattr(self, name)
            bad = np.argwhere(~np.isfinite(array))
            if bad.size:
                where = tuple(int(index) for index in bad[0])
                check(False, f"{name}{list(where)}", float(array[where]), "a finite number")
        if frames > 1 and np.diff(self.time).min() <= 0:
            late = int(np.argmax(np.diff(self.time) <= 0)) + 1
            allowed = f"later than time[{late - 1}] = {self.time[late - 1]}"
            check(False, f"time[{late}]", float(self.time[late]), allowed)
        # rounding may exceed the limits a little
        for end in (self.activation.min(initial=0.0), self.activation.max(initial=0.0)):
            check(-1e-4 <= end <= 1 + 1e-4, "activation", float(end), "in [0, 1]")
        np.clip(self.activation, 0, 1, out=self.activation)

    @property
    def seconds(self) -> float:
        """The time from the first to the last recorded frame."""
        return float(self.time[-1] - self.time[0])


def _shape(name: str, array: np.ndarray, shape: tuple[int, ...], allowed: str) -> None:
    check(array.shape == shape, f"{name}.shape", array.shape, allowed)


def resample(motion: Motion, moments: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Interpolate a motion at other moments.

    **Arguments:** `moments`: `(n,)` s after the motion's first frame; beyond its end the last frame is repeated.

    **Returns:** `time (n,)`, `position (n, nq)`, `activation (n, nu)`, `marks (n, marks, 4)`. Positions are
    interpolated along the model's joints, so that quaternions remain rotations; marks are those of the nearest frame,
    as targets jump.
    """
    import mujoco

    model = motion.model
    time = np.clip(motion.time[0] + moments, motion.time[0], motion.time[-1])
    before = np.clip(np.searchsorted(motion.time, time, side="right") - 1, 0, max(motion.time.size - 2, 0))
    after = np.minimum(before + 1, motion.time.size - 1)
    step = np.where(after > before, motion.time[after] - motion.time[before], 1.0)
    part = (time - motion.time[before]) / step
    position = motion.position[before].copy()
    velocity: Any = np.zeros(model.nv)
    for row in np.flatnonzero(part > 1e-9):
        mujoco.mj_differentiatePos(model, velocity, 1.0, motion.position[before[row]], motion.position[after[row]])
        mujoco.mj_integratePos(model, position[row], velocity, part[row])
    activation = motion.activation[before] * (1 - part[:, None]) + motion.activation[after] * part[:, None]
    marks = motion.marks[np.where(part < 0.5, before, after)]
    return time, position, activation, marks
