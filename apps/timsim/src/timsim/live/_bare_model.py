"""A bare MuJoCo model as the subject of a run, driven by controls that are set by hand."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from collections.abc import Mapping
from typing import Any, NoReturn

import mujoco
import numpy as np
from jaxtyping import PyTree

from motorgrad._errors import check
from motorgrad.bodies import install_muscle_callback
from motorgrad.policies import Policy
from timsim.live._drive import Driving, control_limits
from timsim.live._numbers import check_number, editable_numbers, write_numbers
from timsim.live._replies import Ready
from timsim.live._setup import Setup
from timsim.live._snapshot import Sample, Sizes, Tally

DECISION = 0.01  # s of simulated time, or one physics step where that is longer
STATE = mujoco.mjtState.mjSTATE_INTEGRATION
BAD = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADCTRL) + 1)


class BareModel:
    """A model without a learner. The user sets its controls; one decision is several physics steps.

    It starts in the keyframe of its setup, by default the first that it has.
    """

    frozen = False
    diverged = horizon = 0

    def __init__(self, setup: Setup):
        self.labels = [setup.label]
        self.model: Any = setup.model
        install_muscle_callback(self.model)
        self._data: Any = mujoco.MjData(self.model)
        self._key = setup.key if self.model.nkey else -1
        self.tick = self._pushed_until = 0
        self.substeps = max(1, round(DECISION / self.model.opt.timestep))
        self.period = self.substeps * self.model.opt.timestep
        self._numbers = editable_numbers(self.model)
        self.settings = {name: number.get(self.model) for name, number in self._numbers.items()}
        sensors = [self.model.sensor(i) for i in range(self.model.nsensor)]
        feet = [each for each in sensors if each.type[0] == mujoco.mjtSensor.mjSENS_TOUCH]
        self._feet = [(each.name, int(each.adr[0])) for each in feet]
        self._limits = control_limits(self.model)
        self._drives: tuple[tuple[int, Driving], ...] = ()
        """What drives actuators, each with the decision since when."""
        self.begin_again()

    def about(self) -> Ready:
        m = self.model
        room = int(np.clip(20 / self.period, 200, 4000))
        sizes = Sizes(m.nq, m.nv, m.na, m.nu, 0, 0, 0, len(self._feet), room, 0, 0)
        muscles = [m.actuator(i).name or f"actuator {i}" for i in range(m.nu)]
        return Ready(sizes, self.period, self.settings, [], [], muscles, [name for name, _ in self._feet], [])

    def advance(self, ticks: int) -> None:
        for _ in range(ticks):
            for since, each in self._drives:
                rows = list(each.actuators)
                low, high = self._limits[rows].T
                self._data.ctrl[rows] = low + each.shares((self.tick - since) * self.period) * (high - low)
            mujoco.mj_step(self.model, self._data, self.substeps)
            self.tick += 1
            if self.tick == self._pushed_until:
                self._data.xfrc_applied[:] = 0
            if self._data.warning.number[BAD].any():  # diverged, and reset by MuJoCo to its reference pose
                self._data.warning.number[:] = 0
                self.diverged += 1
                self._to_start()

    def step(self) -> Sample:
        self.advance(1)
        return self.sample()

    def sample(self) -> Sample:
        d = self._data
        nothing = np.zeros((1, 0))
        unknown = np.full(1, np.nan)
        seen = {"position": d.qpos, "velocity": d.qvel, "activation": d.act, "control": d.ctrl}
        sample = {name: np.array(values)[None] for name, values in seen.items()}
        sample["contacts"] = np.array([[d.sensordata[place] for _, place in self._feet]])
        absent = ("observation", "memory", "action", "probability", "parameters", "fixed", "marks")
        sample |= dict.fromkeys(absent, nothing)
        return sample | dict.fromkeys(("reward", "baseline", "gradient_norm"), unknown)

    def tally(self) -> list[Tally]:
        return [Tally(np.full(1, np.nan), np.zeros(1))]

    @property
    def state(self) -> Any:
        physics = np.empty(mujoco.mj_stateSize(self.model, STATE))
        mujoco.mj_getState(self.model, self._data, physics, STATE)
        return {
            "tick": np.array(self.tick),
            "physics": physics,
            "sensors": np.array(self._data.sensordata),
            "pushed": np.array(self._pushed_until),
            "settings": dict(self.settings),
            "drives": self._drives,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        mujoco.mj_setState(self.model, self._data, state["physics"], STATE)
        np.copyto(self._data.sensordata, state["sensors"])
        self.tick = int(state["tick"])
        self._pushed_until = int(state["pushed"])
        self._drives = state["drives"]
        self._apply(state["settings"])

    def begin_again(self) -> None:
        self.tick = self._pushed_until = 0
        self._drives = ()
        mujoco.mj_resetData(self.model, self._data)
        self._to_start()

    def edit(self, name: str, value: float) -> None:
        check_number(name, self._numbers[name], value, self.period)
        self._apply({**self.settings, name: value})

    def push(self, body: str, force: tuple[float, float, float], seconds: float) -> None:
        self._data.xfrc_applied[:] = 0
        self._data.xfrc_applied[self.model.body(body).id, :3] = force
        self._pushed_until = self.tick + max(1, round(seconds / self.period))

    def control(self, actuator: int, value: float) -> None:
        low, high = self.model.actuator_ctrlrange[actuator]
        limited = bool(self.model.actuator_ctrllimited[actuator])
        check(not limited or low <= value <= high, "control", value, f"from {low:g} to {high:g}")
        self._released((actuator,))
        self._data.ctrl[actuator] = value

    def drive(self, order: Driving) -> None:
        """Let an order drive actuators from now on, in place of their current drive."""
        self._released(order.actuators)
        self._drives = (*self._drives, (self.tick, order))

    def _released(self, actuators: tuple[int, ...]) -> None:
        """Stop driving actuators."""
        left = ((since, each.without(actuators)) for since, each in self._drives)
        self._drives = tuple((since, each) for since, each in left if each is not None)

    def freeze(self, on: bool) -> None:
        self._refuse("freeze")

    def compare(self, on: bool) -> None:
        self._refuse("compare")

    def save(self, path: str) -> None:
        self._refuse("save")

    def read_policy(self, path: str, seed: int | None) -> tuple[Any, Any]:
        self._refuse("load")

    def set_policy(self, policy: Policy, memory: PyTree) -> None:
        self._refuse("load")

    def picture(self) -> NoReturn:
        self._refuse("look")

    def _refuse(self, what: str) -> NoReturn:
        raise ValueError(f"{what}: this model has no learner")

    def _apply(self, settings: dict[str, float]) -> None:
        if write_numbers(self.model, self._numbers, settings):
            self.substeps = round(self.period / self.model.opt.timestep)
        self.settings = dict(settings)

    def _to_start(self) -> None:
        if self._key >= 0:
            mujoco.mj_resetDataKeyframe(self.model, self._data, self._key)
        mujoco.mj_forward(self.model, self._data)
