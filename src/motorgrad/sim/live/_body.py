"""The body of a run: names of its parts, its controls, pushes, and the editable numbers of its muscles."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import mujoco
import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import actuators_of, group_places, hill_actuators
from motorgrad.training import BodyStepper, Stepper

MUSCLE_FIELDS = ("actuator_gainprm", "actuator_biasprm", "actuator_lengthrange", "tendon_damping")
"""The arrays of a model that hold the editable numbers of its muscles."""


HILL_FIELDS = ("max_isometric_force", "optimal_fiber_length", "tendon_slack_length")
"""The editable numbers of a Hill-type muscle, in their order in `actuator_biasprm`."""


class MuscleNumber(NamedTuple):
    """How to read a number from a model and write it there, and whether it must be positive or only not negative."""

    get: Callable[[Any], float]
    apply: Callable[[Any, float], None]
    positive: bool = False


def muscle_numbers(model: Any) -> dict[str, MuscleNumber]:
    """The editable numbers of every muscle by name, such as `body.flexor.strength` (N), `.rest_length` (m) and
    `.damping` (N s/m).

    A muscle is an actuator on a tendon whose gain is this library's, MuJoCo's `muscle`, or a constant pull; or a
    Hill-type muscle, whose numbers have the names of `motorgrad.bodies.Hill`.
    """
    kinds, found, hill = mujoco.mjtGain, {}, hill_actuators(model)
    for i in range(model.nu):
        if model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_TENDON:
            continue
        name, gain = f"body.{model.actuator(i).name or i}", model.actuator_gaintype[i]
        tendon = int(model.actuator_trnid[i, 0])
        if hill[i]:
            for place, field in enumerate(HILL_FIELDS):
                found[f"{name}.{field}"] = _at("actuator_biasprm", (i, place), positive=True)
            continue
        if gain == kinds.mjGAIN_USER:
            found[f"{name}.strength"] = _at("actuator_gainprm", (i, 0), -1.0)
            found[f"{name}.rest_length"] = _at("actuator_gainprm", (i, 1), positive=True)
        elif gain == kinds.mjGAIN_FIXED and model.actuator_gainprm[i, 0] < 0:
            found[f"{name}.strength"] = _at("actuator_gainprm", (i, 0), -1.0)
        elif gain == kinds.mjGAIN_MUSCLE:
            found[f"{name}.strength"] = _strength(i)
            if model.actuator_lengthrange[i, 0] == 0:  # as this library makes them: the upper end is the rest length
                found[f"{name}.rest_length"] = _at("actuator_lengthrange", (i, 1), positive=True)
        else:
            continue
        first = (tendon, 0) if model.tendon_damping.ndim == 2 else (tendon,)
        found[f"{name}.damping"] = _at("tendon_damping", first)
    return found


def check_number(name: str, number: MuscleNumber, value: float) -> None:
    """Refuse a value that no muscle can have."""
    check(value > 0 if number.positive else value >= 0, name, value, "above 0" if number.positive else "at least 0")


def muscle_fields(model: Any) -> dict[str, np.ndarray]:
    """Copies of the arrays that hold the editable numbers."""
    return {name: np.array(getattr(model, name)) for name in MUSCLE_FIELDS}


def _at(field: str, place: tuple[int, ...], sign: float = 1.0, positive: bool = False) -> MuscleNumber:
    def apply(model: Any, value: float) -> None:
        getattr(model, field)[place] = sign * value

    return MuscleNumber(lambda model: sign * float(getattr(model, field)[place]), apply, positive)


def _strength(actuator: int) -> MuscleNumber:
    """The peak force of MuJoCo's muscle, given by `scale` where it is negative; the passive force has a copy."""

    def get(model: Any) -> float:
        given, scale = model.actuator_gainprm[actuator, 2:4]
        return float(given if given >= 0 else scale / max(model.actuator_acc0[actuator], mujoco.mjMINVAL))

    def apply(model: Any, value: float) -> None:
        model.actuator_gainprm[actuator, 2] = value
        if model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_MUSCLE:
            model.actuator_biasprm[actuator, 2] = value

    return MuscleNumber(get, apply)


class BodyPart:
    """The body in a learner's engine. It is empty where the engine moves no body.

    **Attributes:** `muscles`, the names of the model's actuators; `groups`, of what an action drives; `feet`, of the
    touch sensors; `numbers`, the editable numbers of the muscles.
    """

    def __init__(self, stepper: Stepper):
        self.muscles: list[str] = []
        self.groups: list[str] = []
        self.feet: list[str] = []
        self.numbers: dict[str, Any] = {}
        self.model: Any = None
        if not isinstance(stepper, BodyStepper):
            return
        batch, model = stepper.batch, stepper.batch.model
        self.model = model
        self.muscles = [model.actuator(i).name for i in range(model.nu)]
        self.groups = list(batch.groups)
        touch = mujoco.mjtSensor.mjSENS_TOUCH
        self.feet = [model.sensor(i).name for i in range(model.nsensor) if model.sensor_type[i] == touch]
        self.numbers = muscle_numbers(model)
        self._driven = [model.actuator(each.name).id for each in actuators_of(batch.body)]
        self._source = group_places(batch.body)
        limited = np.array(model.actuator_ctrllimited, bool)[:, None]
        self._limits = np.where(limited, model.actuator_ctrlrange, (-np.inf, np.inf))[self._driven].T

    def fields(self, stepper: Stepper) -> dict[str, np.ndarray]:
        """The arrays of an engine's model that edits change."""
        return muscle_fields(stepper.batch.model) if isinstance(stepper, BodyStepper) else {}

    def read(self) -> dict[str, float]:
        """The present numbers of the muscles."""
        return {name: number.get(self.model) for name, number in self.numbers.items()}

    def apply(self, values: dict[str, float], steppers: Iterable[Stepper]) -> None:
        """Write the numbers of the muscles to every engine."""
        for stepper in steppers:
            if not isinstance(stepper, BodyStepper) or not self.numbers:
                continue
            model = stepper.batch.model
            before = [np.array(getattr(model, name)) for name in MUSCLE_FIELDS]
            for name, number in self.numbers.items():
                if number.get(model) != values[name]:
                    number.apply(model, values[name])
            if any((was != getattr(model, name)).any() for name, was in zip(MUSCLE_FIELDS, before, strict=True)):
                stepper.batch.refresh_models()

    def control(self, stepper: Stepper) -> np.ndarray:
        """The control of every actuator until the next decision, `(seeds, actuators)`."""
        told = np.zeros((len(stepper.seeds), len(self.muscles)))
        if isinstance(stepper, BodyStepper):
            told[:, self._driven] = np.clip(stepper.activation[:, self._source], *self._limits)
        return told

    def push(self, body: str, force: Any, stepper: Stepper) -> None:
        """Push a part of the body until `release`."""
        if not isinstance(stepper, BodyStepper):
            raise ValueError(f"push: the task {stepper.task.name!r} has no body")
        stepper.batch.push(self.model.body(body).id, force)

    def release(self, stepper: Stepper) -> None:
        """End all pushes."""
        if isinstance(stepper, BodyStepper):
            for part in range(1, stepper.batch.model.nbody):
                stepper.batch.push(part, 0.0)
