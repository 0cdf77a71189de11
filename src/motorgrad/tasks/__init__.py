"""Tasks: an observation, a reward and an episode's rule over a world or a body."""

from motorgrad.tasks._body_task import BodyTask
from motorgrad.tasks._finite import CallAdmission, Chain, FiniteTask, ThreeState
from motorgrad.tasks._hopper import Flight, Hopper
from motorgrad.tasks._registry import TASKS, make
from motorgrad.tasks._task import Reading, Task

__all__ = [
    "TASKS",
    "BodyTask",
    "CallAdmission",
    "Chain",
    "FiniteTask",
    "Flight",
    "Hopper",
    "Reading",
    "Task",
    "ThreeState",
    "make",
]
