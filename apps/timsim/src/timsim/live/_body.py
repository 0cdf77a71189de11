"""The body of a run: names of its parts, its controls, pushes, and its editable numbers."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from motorgrad.bodies import actuators_of, group_places
from motorgrad.training import BodyStepper, Stepper
from timsim.live._numbers import GRAVITY, TERRAIN, editable_numbers, write_numbers


class BodyPart:
    """The body in a learner's engine. It is empty where the engine moves no body.

    **Attributes:** `muscles`, the names of the model's actuators; `groups`, of what an action drives; `feet`, of the
    touch sensors; `numbers`, which can be edited (see `editable_numbers`).
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
        self.numbers = editable_numbers(model)
        if getattr(batch.body, "planet", None) is not None:  # its gravity and its ground change with the place
            self.numbers = {name: x for name, x in self.numbers.items() if not name.startswith((GRAVITY, TERRAIN))}
        self._driven = [model.actuator(each.name).id for each in actuators_of(batch.body)]
        self._source = group_places(batch.body)
        limited = np.array(model.actuator_ctrllimited, bool)[:, None]
        self._limits = np.where(limited, model.actuator_ctrlrange, (-np.inf, np.inf))[self._driven].T

    def read(self) -> dict[str, float]:
        """The initial numbers."""
        return {name: number.get(self.model) for name, number in self.numbers.items()}

    def apply(self, values: dict[str, float], steppers: Iterable[Stepper]) -> None:
        """Write the numbers to every engine. A decision takes as long as before, whatever the time step."""
        for stepper in steppers:
            if isinstance(stepper, BodyStepper) and write_numbers(stepper.batch.model, self.numbers, values):
                batch = stepper.batch
                batch.substeps = round(batch.period / float(batch.model.opt.timestep))
                batch.refresh_models()

    def control(self, stepper: Stepper) -> np.ndarray:
        """The control of every actuator until the next decision, `(seeds, actuators)`."""
        control = np.zeros((len(stepper.seeds), len(self.muscles)))
        if isinstance(stepper, BodyStepper):
            control[:, self._driven] = np.clip(stepper.control[:, self._source], *self._limits)
        return control

    def seen(self, stepper: Stepper) -> dict[str, np.ndarray]:
        """Readings of the body that the task's state lacks, by the names of a snapshot, `(seeds, …)`: none."""
        del stepper
        return {}

    def push(self, body: str, force: tuple[float, float, float], stepper: Stepper) -> None:
        """Push a part of the body until `release`."""
        if not isinstance(stepper, BodyStepper):
            raise ValueError(f"push: the task {stepper.task.name!r} has no body")
        stepper.batch.push(self.model.body(body).id, force)

    def release(self, stepper: Stepper) -> None:
        """End all pushes."""
        if isinstance(stepper, BodyStepper):
            for part in range(1, stepper.batch.model.nbody):
                stepper.batch.push(part, 0.0)
