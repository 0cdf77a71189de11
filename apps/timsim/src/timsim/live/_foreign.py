"""Show Gymnasium environments: their MuJoCo body, or their rendered picture while somebody looks."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

import copy
import time
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from motorgrad.tasks import EnvironmentPictures, Gymnasium, Task, make_environment, physics_of, renders
from motorgrad.training import Stepper
from timsim.live._body import BodyPart


class Picture(NamedTuple):
    """The picture of an environment `(height, width, 3)`, uint8, or None and, in one line, why there is none; and how
    many seconds it took.
    """

    pixels: np.ndarray | None
    problem: str
    seconds: float


def appearance_of(task: Task) -> tuple[Any, bool]:
    """The MuJoCo model of a Gymnasium environment, or None; and whether it has a picture of its own instead."""
    if not isinstance(task, Gymnasium):
        return None, False
    environment = make_environment(task.env_id, task.kwargs or {})
    try:
        physics = physics_of(environment)
        return (None, renders(environment)) if physics is None else (copy.copy(physics[0]), False)
    finally:
        environment.close()


class ForeignBody(BodyPart):
    """The body that MuJoCo moves in the Gymnasium environment of a learner. Its numbers cannot be edited."""

    def __init__(self, stepper: Stepper):
        super().__init__(stepper)
        self.model, _ = _physics(stepper)
        self.muscles = [self.model.actuator(i).name or f"actuator {i}" for i in range(self.model.nu)]

    def seen(self, stepper: Stepper) -> dict[str, np.ndarray]:
        _, data = _physics(stepper)
        found = {"position": data.qpos, "velocity": data.qvel, "activation": data.act}
        return {name: np.array(values)[None] for name, values in found.items()}

    def control(self, stepper: Stepper) -> np.ndarray:
        return np.array(_physics(stepper)[1].ctrl)[None]

    def push(self, body: str, force: tuple[float, float, float], stepper: Stepper) -> None:
        model, data = _physics(stepper)
        data.xfrc_applied[model.body(body).id, :3] = force

    def release(self, stepper: Stepper) -> None:
        _physics(stepper)[1].xfrc_applied[:] = 0

    def apply(self, values: dict[str, float], steppers: Iterable[Stepper]) -> None:
        del values, steppers


def body_in(stepper: Stepper) -> BodyPart:
    """The body in a learner's engine."""
    foreign = isinstance(stepper.task, Gymnasium) and physics_of(_environment(stepper)) is not None
    return ForeignBody(stepper) if foreign else BodyPart(stepper)


def picture_of(pictures: EnvironmentPictures, stepper: Stepper) -> Picture:
    """The picture of a learner's environment, or why there is none."""
    pixels = None
    problem = ""
    start = time.perf_counter()
    try:
        pixels = pictures.of(_environment(stepper))
    except Exception as error:  # an environment's own code may raise anything
        problem = " ".join(f"{type(error).__name__}: {error}".split())[:200]
    return Picture(pixels, problem, time.perf_counter() - start)


def _environment(stepper: Stepper) -> Any:
    engine: Any = stepper
    return engine.batch.environments[0]


def _physics(stepper: Stepper) -> tuple[Any, Any]:
    found = physics_of(_environment(stepper))
    assert found is not None
    return found
