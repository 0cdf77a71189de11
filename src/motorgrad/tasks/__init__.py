"""Tasks: an observation, a reward and an episode's rule over a world or a body."""

from motorgrad.tasks._body_task import BodyTask
from motorgrad.tasks._finite import CallAdmission, Chain, FiniteTask, ThreeState
from motorgrad.tasks._gymnasium import EnvironmentMemory, Gymnasium, from_gymnasium
from motorgrad.tasks._gymnasium_batch import EnvironmentBatch, EnvironmentState
from motorgrad.tasks._hopper import Flight, Hopper
from motorgrad.tasks._host_task import HostBatch, HostTask
from motorgrad.tasks._registry import TASKS, make
from motorgrad.tasks._task import Reading, Task

__all__ = [
    "TASKS",
    "BodyTask",
    "CallAdmission",
    "Chain",
    "EnvironmentBatch",
    "EnvironmentMemory",
    "EnvironmentState",
    "FiniteTask",
    "Flight",
    "Gymnasium",
    "Hopper",
    "HostBatch",
    "HostTask",
    "Reading",
    "Task",
    "ThreeState",
    "from_gymnasium",
    "make",
]
