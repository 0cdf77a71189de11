"""The body in a learner's engine: what its actuators are told, its feet, pushes, and the numbers of its muscles."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from motorgrad.sim.live._muscle_settings import FIELDS, fields_of, muscle_numbers
from motorgrad.training import BodyStepper, Stepper


class BodyPart:
    """What an engine has of a body, which is nothing where it moves something else.

    **Attributes:** `muscles`, names of the model's actuators; `groups`, of what an action drives; `feet`, of the touch
    sensors; `numbers`, what can be changed of the muscles.
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
        group_of = {each.name: each.group for each in (*batch.body.muscles, *getattr(batch.body, "servos", ()))}
        self._driven = [i for i, name in enumerate(self.muscles) if name in group_of]
        self._source = [self.groups.index(group_of[self.muscles[i]]) for i in self._driven]

    def fields(self, stepper: Stepper) -> dict[str, np.ndarray]:
        """The arrays of an engine's model that edits change."""
        return fields_of(stepper.batch.model) if isinstance(stepper, BodyStepper) else {}

    def read(self) -> dict[str, float]:
        """The present numbers of the muscles."""
        return {name: number.get(self.model) for name, number in self.numbers.items()}

    def put(self, values: dict[str, float], steppers: Iterable[Stepper]) -> None:
        """Give the muscles these numbers in every engine."""
        for stepper in steppers:
            if not isinstance(stepper, BodyStepper) or not self.numbers:
                continue
            model = stepper.batch.model
            before = [np.array(getattr(model, name)) for name in FIELDS]
            for name, number in self.numbers.items():
                if number.get(model) != values[name]:
                    number.put(model, values[name])
            if any((was != getattr(model, name)).any() for name, was in zip(FIELDS, before, strict=True)):
                stepper.batch.refresh_models()

    def control(self, stepper: Stepper) -> np.ndarray:
        """What every actuator is told until the next decision, `(seeds, actuators)`."""
        told = np.zeros((len(stepper.seeds), len(self.muscles)))
        if isinstance(stepper, BodyStepper):
            told[:, self._driven] = np.clip(stepper.activation, 0, 1)[:, self._source]
        return told

    def push(self, body: str, force: Any, stepper: Stepper) -> None:
        """Push a part of the body from now on."""
        if not isinstance(stepper, BodyStepper):
            raise ValueError(f"push: the task {stepper.task.name!r} has no body")
        stepper.batch.push(self.model.body(body).id, force)

    def release(self, stepper: Stepper) -> None:
        """Push no more."""
        if isinstance(stepper, BodyStepper):
            for part in range(1, stepper.batch.model.nbody):
                stepper.batch.push(part, 0.0)
