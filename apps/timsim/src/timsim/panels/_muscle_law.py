"""The force law of an actuator in its model: force from activation, length and velocity."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from motorgrad.bodies import HillState, hill_actuators, hill_force, read_hill, tension


class Arm(NamedTuple):
    """The moment arm of an actuator about a joint in m (of a slide: a ratio), positive where its force moves the joint
    forwards.
    """

    joint: str
    metres: float


class Law:
    """One actuator's force; for a muscle on a path its tension, positive when it pulls.

    **Arguments:** `model`, read at each call; `actuator`: its index.
    """

    def __init__(self, model: mujoco.MjModel, actuator: int) -> None:
        self._model, self._row = model, actuator
        self.pulls = model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_TENDON
        """Whether it is a muscle on a tendon path."""
        self._sign = -1.0 if self.pulls else 1.0
        self._hill = bool(hill_actuators(model)[actuator])
        self._tendon = int(model.actuator_trnid[actuator, 0]) if self.pulls else -1

    @property
    def rest_length(self) -> float:
        """The length at which the actuator is strongest, in m; NaN if the law has none."""
        model = self._model
        kind = self._model.actuator_gaintype[self._row]
        if self._hill:
            _, optimal, slack, pennation = model.actuator_biasprm[self._row, :4]
            return float(slack + optimal * np.cos(pennation))
        if kind == mujoco.mjtGain.mjGAIN_USER:
            return float(model.actuator_gainprm[self._row, 1])
        if kind == mujoco.mjtGain.mjGAIN_MUSCLE:
            low, high = model.actuator_lengthrange[self._row]
            first, last = model.actuator_gainprm[self._row, :2]
            return float(low + (1 - first) * (high - low) / max(last - first, 1e-9))
        return float("nan")

    def hill_now(self, data: mujoco.MjData) -> HillState | None:
        """Fiber and tendon of a Hill-type muscle in the current posture."""
        return read_hill(self._model, data, self._row) if self._hill else None

    @property
    def optimal(self) -> float:
        """The optimal length of a Hill-type muscle's fiber, in m."""
        return float(self._model.actuator_biasprm[self._row, 1])

    def force_now(self, data: mujoco.MjData) -> float:
        """The force in the present posture in N, including damping."""
        return self._sign * float(data.actuator_force[self._row]) + self.damping * float(
            data.actuator_velocity[self._row]
        )

    def force(self, activation: float, length: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """The force in N at these lengths in m and velocities in m/s (positive while lengthening), with damping; of a
        Hill-type muscle that of a tendon at rest."""
        model, row = self._model, self._row
        length, velocity = np.broadcast_arrays(np.asarray(length, float), np.asarray(velocity, float))
        kind = model.actuator_gaintype[row]
        prm = model.actuator_gainprm[row]
        if self._hill:
            return hill_force(model, row, activation, length, velocity)
        if kind == mujoco.mjtGain.mjGAIN_USER:
            return tension(activation, length, velocity, -prm[0], prm[1], prm[2], self.damping)
        bound = model.actuator_lengthrange[row]
        acc0 = float(model.actuator_acc0[row])
        if kind == mujoco.mjtGain.mjGAIN_MUSCLE:
            pairs = [*zip(length.ravel(), velocity.ravel(), strict=True)]
            gain = np.array([mujoco.mju_muscleGain(a, b, bound, acc0, prm[:9]) for a, b in pairs])
        else:
            gain = np.full(length.size, prm[0])
            if kind == mujoco.mjtGain.mjGAIN_AFFINE:
                gain = gain + prm[1] * length.ravel() + prm[2] * velocity.ravel()
        bias = np.zeros(length.size)
        if model.actuator_biastype[row] == mujoco.mjtBias.mjBIAS_MUSCLE:
            rest = model.actuator_biasprm[row, :9]
            bias = np.array([mujoco.mju_muscleBias(each, bound, acc0, rest) for each in length.ravel()])
        elif model.actuator_biastype[row] == mujoco.mjtBias.mjBIAS_AFFINE:
            first, second, third = model.actuator_biasprm[row, :3]
            bias = first + second * length.ravel() + third * velocity.ravel()
        return (self._sign * (gain * activation + bias)).reshape(length.shape) + self.damping * velocity

    @property
    def damping(self) -> float:
        """Damping of the whole path, in N s/m."""
        if self._tendon < 0:
            return 0.0
        return float(np.ravel(self._model.tendon_damping[self._tendon])[0])

    def moment_arms(self, data: mujoco.MjData) -> list[Arm]:
        """Every joint that the actuator acts on in the current posture, the longest moment arm first."""
        model = self._model
        dense = np.zeros((model.nu, model.nv))
        mujoco.mju_sparse2dense(dense, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
        found = []
        for freedom in np.flatnonzero(np.abs(dense[self._row]) > 1e-6):
            joint = model.joint(int(model.dof_jntid[freedom]))
            found.append(Arm(joint.name or f"joint {joint.id}", self._sign * float(dense[self._row, freedom])))
        return sorted(found, key=lambda arm: -abs(arm.metres))
