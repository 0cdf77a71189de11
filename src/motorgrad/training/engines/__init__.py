"""Engines of training: many seeds of one learner in step, in JAX worlds, bodies and Gymnasium environments."""

from collections.abc import Mapping, Sequence
from typing import Any

from motorgrad._program_store import keep_programs
from motorgrad.learning import Learner, SparseLearner
from motorgrad.policies import Policy
from motorgrad.tasks import BodyTask, HostTask, Task
from motorgrad.training.engines._cycle import MAX_TALLY_DECISIONS, CycleState, Mode
from motorgrad.training.engines._host import BodyStepper, HostStepper
from motorgrad.training.engines._programs import clear_programs
from motorgrad.training.engines._side_by_side import MAX_SEEDS_PER_ENGINE, SideBySide
from motorgrad.training.engines._sparse import SparseStepper
from motorgrad.training.engines._stepper import (
    Record,
    Stepper,
    check_carries,
    mean_reward,
    validate,
    validate_needs,
    without_broken,
)
from motorgrad.training.engines._transition import raw_names, state_names
from motorgrad.training.engines._world import WorldStepper

__all__ = [
    "MAX_TALLY_DECISIONS",
    "BodyStepper",
    "CycleState",
    "HostStepper",
    "Mode",
    "Record",
    "SideBySide",
    "SparseStepper",
    "Stepper",
    "WorldStepper",
    "check_carries",
    "clear_programs",
    "mean_reward",
    "raw_names",
    "state_names",
    "stepper_for",
    "training_stepper_for",
    "validate",
    "validate_needs",
    "without_broken",
]


def stepper_for(
    task: Task,
    agent: Learner,
    seeds: Sequence[int],
    mode: Mode = "learn",
    threads: int = 0,
    initial: Policy | None = None,
    numbers: Mapping[str, Any] | None = None,
    envs: int = 1,
    workers: int = 0,
    first_episode: bool = False,
) -> Stepper:
    """The engine for a task: compiled loops for worlds, `mujoco.batch` for bodies; environments are stepped one by
    one, or in worker processes (`workers`). Several `envs` can feed each learner if the dynamics run on the host.

    With `first_episode`, records count the first episode of each seed alone: its rewards, metrics, and `decisions`.
    """
    keep_programs()
    if isinstance(task, HostTask):
        kind = BodyStepper if isinstance(task, BodyTask) else HostStepper
        more = {"envs": envs, "workers": workers, "first_episode": first_episode}
        return kind(task, agent, seeds, mode, threads, initial, numbers, **more)
    engine = SparseStepper if isinstance(agent, SparseLearner) and mode == "learn" else WorldStepper
    return engine(task, agent, seeds, mode, initial, numbers, first_episode)


def training_stepper_for(
    task: Task,
    agent: Learner,
    seeds: Sequence[int],
    threads: int = 0,
    initial: Policy | None = None,
    numbers: Mapping[str, Any] | None = None,
    envs: int = 1,
    workers: int = 0,
) -> Stepper:
    """The engine for training: as `stepper_for`, or several side by side for many seeds in a body."""
    if isinstance(task, BodyTask) and len(seeds) > MAX_SEEDS_PER_ENGINE:
        return SideBySide(task, agent, seeds, threads, initial, numbers, envs)
    return stepper_for(task, agent, seeds, "learn", threads, initial, numbers, envs, workers)
