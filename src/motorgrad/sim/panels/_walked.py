"""What a hexapod's last decisions say of its gait."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import mujoco

    from motorgrad.bodies import Gait, HexapodReading
    from motorgrad.sim.live import Trail

LEAST = 2.0  # s, for a gait to be measured


def is_hexapod(model: mujoco.MjModel | None) -> bool:
    """Whether a model has the sensors that a gait is measured with."""
    from motorgrad.bodies import LEGS

    if model is None:
        return False
    known = {model.sensor(index).name for index in range(model.nsensor)}
    wanted = {f"{kind}_{leg}" for kind in ("lateral", "vertical", "contact") for leg in LEGS}
    return known >= wanted | {"position", "forward", "velocity", "rotation", "upward"}


class Walked:
    """The sensors of the last decisions, computed anew from positions and velocities, each decision once.

    **Arguments:** `model`; `period` of a decision, s; `feet`, the names of a trail's contacts.
    """

    def __init__(self, model: mujoco.MjModel, period: float, feet: list[str]) -> None:
        import mujoco

        from motorgrad.bodies import LEGS, install_muscle_callback

        if np.any(model.actuator_gaintype == mujoco.mjtGain.mjGAIN_USER):
            install_muscle_callback()
        self._model, self._data, self._period = model, mujoco.MjData(model), period
        self._feet = [feet.index(f"contact_{leg}") for leg in LEGS]
        self._known: dict[int, np.ndarray] = {}

    def contacts(self, trail: Trail) -> np.ndarray:
        """Which feet are on the ground, `(n, 6)`, legs in the order of `motorgrad.bodies.LEGS`."""
        from motorgrad.bodies import TOUCH, debounced

        return debounced(trail.contacts[:, self._feet] > TOUCH, self._period)

    def gait(self, trail: Trail) -> Gait | None:
        """The gait of the last unbroken stretch; None where that is too short."""
        from motorgrad.bodies import measure_gait

        breaks = np.flatnonzero((np.diff(trail.decision) != 1) | (np.diff(trail.seconds) <= 0)) + 1
        first = int(breaks[-1]) if len(breaks) else 0
        if (len(trail.decision) - first) * self._period < LEAST:
            return None
        return measure_gait(self._reading(trail, first), self._period)

    def _reading(self, trail: Trail, first: int) -> HexapodReading:
        from motorgrad.bodies import BodyState, read_hexapod

        rows = range(first, len(trail.decision))
        sensed = {row: self._sensed(trail, row) for row in rows}
        self._known = {int(trail.decision[row]): values for row, values in sensed.items()}
        table = np.stack([sensed[row] for row in rows])[:, None]  # one seed
        sensors: dict[str, Any] = {}
        for index in range(self._model.nsensor):
            sensor = self._model.sensor(index)
            start, size = int(sensor.adr[0]), int(sensor.dim[0])
            sensors[sensor.name] = table[..., start] if size == 1 else table[..., start : start + size]
        state = BodyState(trail.position[first:, None], trail.velocity[first:, None], sensors)
        return read_hexapod(state)._replace(contact=trail.contacts[first:, None, self._feet])

    def _sensed(self, trail: Trail, row: int) -> np.ndarray:
        """The sensors that positions and velocities determine."""
        import mujoco

        kept = self._known.get(int(trail.decision[row]))
        if kept is not None:
            return kept
        self._data.qpos[:], self._data.qvel[:] = trail.position[row], trail.velocity[row]
        mujoco.mj_step1(self._model, self._data)
        return self._data.sensordata.copy()
