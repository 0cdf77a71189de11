"""From an evaluation to a motion that can be filmed."""

import math

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import compile_model
from motorgrad.sim import Motion
from motorgrad.tasks import BodyTask
from motorgrad.training import Evaluation, Run


def motion_of(run: Run, outcome: Evaluation, seed: int, label: str = "", seconds: float = 10.0) -> Motion:
    """The motion of one seed in an evaluation, its first `seconds`."""
    check(0 < seconds < math.inf, "seconds", seconds, "a positive time")
    task = run.task
    if not isinstance(task, BodyTask) or outcome.position is None or outcome.activation is None:
        raise ValueError(f"task {task.name!r} has no body to film")
    body, row = task.dynamics, run.seeds.index(seed)
    frames = min(len(outcome.time), max(2, round(seconds / task.period)))
    group_of = [body.groups.index(muscle.group) for muscle in body.muscles]
    activation = np.take(outcome.activation[row, :frames], group_of, axis=-1)
    return Motion(compile_model(body), outcome.time[:frames], outcome.position[row, :frames], activation, label)
