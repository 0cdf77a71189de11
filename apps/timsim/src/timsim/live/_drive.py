"""Orders that drive the actuators of a model without a learner: by a pattern, or by what was recorded."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import mujoco
import numpy as np

from motorgrad._errors import check
from timsim.live._messages import Intervention, Subject, View

PATTERNS = ("constant", "sine", "burst", "noise")
MAX_FREQUENCY = 100.0  # Hz


class Driving(Intervention):
    """An order that drives some actuators until another order replaces it.

    **Attributes:** `actuators`: their numbers in the model.
    """

    actuators: tuple[int, ...]

    def shares(self, seconds: float) -> np.ndarray:
        """The controls `(actuators,)`, as shares in [0, 1] of their ranges, so many seconds after the order."""
        raise NotImplementedError

    def without(self, actuators: tuple[int, ...]) -> Driving | None:
        """The same for the other actuators; None where there are none."""
        kept = [place for place, each in enumerate(self.actuators) if each not in actuators]
        if len(kept) == len(self.actuators):
            return self
        return self._of(kept) if kept else None

    def _of(self, places: list[int]) -> Driving:
        """The same for some of the actuators, by their places."""
        own: Any = self
        return dataclasses.replace(own, actuators=tuple(self.actuators[place] for place in places))

    def check(self, session: View) -> None:
        check(session.task is None, "drive", session.name, "left to the learner, which moves this body")
        known = self.actuators and all(0 <= each < len(session.muscles) for each in self.actuators)
        check(known, "actuators", self.actuators, f"of the {len(session.muscles)} of the model, at least one")

    def apply(self, subject: Subject) -> str:
        drive: Any = getattr(subject, "drive", None)
        if drive is None:
            raise ValueError("drive: the learner moves this body")
        drive(self)
        return f"{len(self.actuators)} actuators are driven: {self}"


@dataclasses.dataclass(frozen=True)
class Drive(Driving):
    """Drive actuators by a pattern.

    **Arguments:**

    - `actuators`: their numbers in the model.
    - `pattern`: `"constant"`; `"sine"`, from 0 to the amplitude and back; `"burst"`, the amplitude in the first half of
      each period; or `"noise"`, for each actuator its own, between random values that change at the frequency.
    - `amplitude`: the greatest control, as a share of the actuator's range, in [0, 1].
    - `frequency` (Hz): of the pattern, up to 100.
    """

    actuators: tuple[int, ...]
    pattern: Literal["constant", "sine", "burst", "noise"] = "constant"
    amplitude: float = 0.5
    frequency: float = 1.0

    def __post_init__(self) -> None:
        check(self.pattern in PATTERNS, "pattern", self.pattern, f"one of {', '.join(PATTERNS)}")
        check(0 <= self.amplitude <= 1, "amplitude", self.amplitude, "in [0, 1]")
        check(
            0 < self.frequency <= MAX_FREQUENCY, "frequency", self.frequency, f"above 0, at most {MAX_FREQUENCY:g} Hz"
        )

    def shares(self, seconds: float) -> np.ndarray:
        turns = seconds * self.frequency
        if self.pattern == "noise":
            whole, part = divmod(turns, 1.0)
            before, after = (self._random(int(whole) + ahead) for ahead in (0, 1))
            return self.amplitude * (before + part * (after - before))
        level = {"constant": 1.0, "sine": 0.5 - 0.5 * np.cos(2 * np.pi * turns), "burst": float(turns % 1.0 < 0.5)}
        return np.full(len(self.actuators), self.amplitude * level[self.pattern])

    def _random(self, number: int) -> np.ndarray:
        """Values that depend on the number and on the actuators alone, so that a run can be repeated."""
        return np.random.default_rng(number).random(max(self.actuators) + 1)[list(self.actuators)]

    def __str__(self) -> str:
        pace = "" if self.pattern == "constant" else f" of {self.frequency:g} Hz"
        return f"{self.pattern}{pace}, amplitude {self.amplitude:g}"


@dataclasses.dataclass(frozen=True, eq=False)
class DriveRecorded(Driving):
    """Drive actuators by recorded controls or activations, in a loop.

    **Arguments:** `actuators`: their numbers in the model; `time` `(n,)` s, increasing; `values` `(n, actuators)` in
    [0, 1], as shares of their ranges.
    """

    actuators: tuple[int, ...]
    time: np.ndarray
    values: np.ndarray

    def __post_init__(self) -> None:
        n = len(self.time)
        m = len(self.actuators)
        check(self.values.shape == (n, m) and n > 0, "values.shape", self.values.shape, f"({n}, {m}), at least one row")
        check(np.all(np.diff(self.time) > 0), "time", "not increasing", "increasing")
        low = float(self.values.min())
        high = float(self.values.max())
        check(-1e-3 <= low <= high <= 1 + 1e-3, "values", f"{low:g} to {high:g}", "in [0, 1]")

    def shares(self, seconds: float) -> np.ndarray:
        span = float(self.time[-1] - self.time[0])
        at = self.time[0] + (seconds % span if span > 0 else 0.0)
        return np.array([np.interp(at, self.time, column) for column in self.values.T])

    def _of(self, places: list[int]) -> Driving:
        chosen = tuple(self.actuators[place] for place in places)
        return DriveRecorded(chosen, self.time, self.values[:, places])

    def __str__(self) -> str:
        return f"recorded, {self.time[-1] - self.time[0]:.4g} s"


def control_limits(model: mujoco.MjModel) -> np.ndarray:
    """The range `(nu, 2)` of each actuator's control: its own; 0 to 1 for a muscle without one, otherwise −1 to 1."""
    muscle = (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_MUSCLE) | (
        model.actuator_gaintype == mujoco.mjtGain.mjGAIN_USER
    )
    without = np.stack([np.where(muscle, 0.0, -1.0), np.ones(model.nu)], axis=1)
    own = (model.actuator_ctrllimited > 0) & (np.ptp(model.actuator_ctrlrange, axis=1) > 0)
    return np.where(own[:, None], model.actuator_ctrlrange, without)
