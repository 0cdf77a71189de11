"""Many simulations of one MuJoCo model behind its block."""

# pyright: reportAttributeAccessIssue=false

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from mujoco import batch as mujoco_batch

from motorgrad._errors import check
from motorgrad.lab._host import Host, HostMoment

_WARNING = mujoco.mjtWarning
# MuJoCo resets a simulation in which one of these is found, with nothing but a counter to show for it.
_BAD = slice(int(_WARNING.mjWARN_BADQPOS), int(_WARNING.mjWARN_BADCTRL) + 1)
MOST_STEPS = 100_000  # of a tick
_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)


class MujocoHost(Host):
    """One row for each seed, stepped together by `mujoco.batch`."""

    def __init__(
        self,
        model: mujoco.MjModel,
        seeds: int,
        key: int,
        actuators: Sequence[str],
        sensors: Mapping[str, slice],
        threads: int,
    ):
        self._key, self._actuators, self._sensors = key, tuple(actuators), sensors
        self._timestep, self._substeps = float(model.opt.timestep), 0
        self._batch = mujoco_batch.Batch(model, seeds, int(threads), persistent=True)
        self._control, self._bad = self._batch.bind("ctrl"), self._batch.warning[:, _BAD, 1]
        self._sources = {"sensors": "sensordata", "qpos": "qpos", "qvel": "qvel"}
        self._diverged = np.zeros(seeds, bool)
        self._reset(np.arange(seeds))

    def output(self, block: Any, inputs: dict[str, np.ndarray], now: HostMoment) -> dict[str, np.ndarray]:
        if self._substeps == 0:  # before anything moves
            self._substeps = steps_in("tick of the block", now.step, self._timestep)
        seen = self._seen
        sensors = {
            name: seen["sensors"][:, part.start] if part.stop - part.start == 1 else seen["sensors"][:, part]
            for name, part in self._sensors.items()
        }
        state = {name: seen[name] for name in ("qpos", "qvel") if seen[name].shape[1]}
        return {**sensors, **state, "diverged": self._diverged}

    def update(self, block: Any, inputs: dict[str, np.ndarray], now: HostMoment) -> None:
        for place, name in enumerate(self._actuators):
            self._control[:, place] = inputs[name]
        failed: Any = []
        try:
            self._batch.step(None, self._substeps, _STAGE)
        except mujoco_batch.SimulationError as error:
            failed = error.ids
        self._diverged = self._bad.any(axis=1)
        self._diverged[failed] = True
        back = np.flatnonzero(self._diverged | np.asarray(inputs["reset"], bool))
        self._look()
        if back.size:
            self._reset(back)

    def snapshot(self) -> dict[str, np.ndarray]:
        seen = {name: value.copy() for name, value in self._seen.items()}
        return {"state": self._batch.state.copy(), "diverged": self._diverged.copy(), **seen}

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        own = self.snapshot()
        fits = set(snapshot) == set(own) and all(np.shape(snapshot[n]) == own[n].shape for n in own)
        check(fits, "snapshot", sorted(snapshot), "one of this block for as many seeds")
        np.copyto(self._batch.state, snapshot["state"])
        self._diverged = np.array(snapshot["diverged"], bool)
        # sensors of contact read 0 until the next step, so what was seen is kept too
        self._seen = {name: np.array(snapshot[name]) for name in self._sources}
        self._bad[...] = 0

    def _reset(self, rows: np.ndarray) -> None:
        self._batch.reset(rows, self._key)
        self._bad[rows] = 0
        self._look()

    def _look(self) -> None:
        bound = {name: np.asarray(self._batch.bind(source)) for name, source in self._sources.items()}
        self._seen = {name: value.reshape(len(self._diverged), -1).copy() for name, value in bound.items()}


def steps_in(name: str, length: float, step: float) -> int:
    """How many time steps of a simulation a tick has. **Raises** `ValueError` unless they are a whole number."""
    steps = round(length / step)
    whole = 1 <= steps <= MOST_STEPS and abs(length / step - steps) <= 1e-6 * steps
    wanted = f"a whole number of the time steps of the simulation, {step:g} s, and at most {MOST_STEPS}"
    check(whole, name, length, wanted)
    return steps
