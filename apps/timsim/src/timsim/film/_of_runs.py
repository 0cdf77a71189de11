"""Motions of evaluated runs, for films."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from timsim.film._motion import Motion

if TYPE_CHECKING:
    from motorgrad.training import Evaluation, Run


def motion_of(run: Run, outcome: Evaluation, seed: int, label: str = "", seconds: float = 10.0) -> Motion:
    """The first `seconds` of one seed's motion in an evaluation, for a film."""
    check_arguments(motion_of, locals())
    from motorgrad.bodies import actuator_levels, actuators_of, compile_model, group_places
    from motorgrad.tasks import BodyTask

    check(0 < seconds < math.inf, "seconds", seconds, "positive and finite")
    task = run.task
    if not isinstance(task, BodyTask) or outcome.position is None or outcome.control is None:
        raise ValueError(f"task {task.name!r} has no body to film")
    body = task.dynamics
    row = run.seeds.index(seed)
    frames = min(len(outcome.time), max(2, round(seconds / task.period)))
    model = compile_model(body)
    control = np.zeros((frames, model.nu))
    driven = [model.actuator(each.name).id for each in actuators_of(body)]
    control[:, driven] = np.take(outcome.control[row, :frames], group_places(body), axis=-1)
    active = None if outcome.activation is None else outcome.activation[row, :frames]
    level = actuator_levels(model, control, active)
    marks = np.zeros((frames, 0, 4)) if outcome.marks is None else outcome.marks[row, :frames]
    return Motion(model, outcome.time[:frames], outcome.position[row, :frames], level, label, marks)
