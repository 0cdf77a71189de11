"""Trainings that start from a run, and what its policies bring along."""

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from motorgrad._errors import check
from motorgrad._interface import Interface
from motorgrad.learning import Agent
from motorgrad.policies import Policy
from motorgrad.tasks import Task
from motorgrad.training._run import Run, saved_agent
from motorgrad.training.engines import check_carries
from motorgrad.training.store import RunWarning


def continued(
    run: Run, task: Task, agent: Agent | Mapping[str, Any] | None, seeds: int | Sequence[int] | None
) -> tuple[Agent | Mapping[str, Any], int | Sequence[int], Policy]:
    """The learner, seeds and initial policies of a training that continues a run: the run's, unless others are given.

    **Raises:** `ValueError` for a sweep, and for a task with other observations or actions; `RunDirectoryError` where
    the run's learner was made in Python.
    """
    check(not run.settings, "initial", run, "a run of one setting: run.split()[0]")
    policies = run.whole_policies
    check_carries(task, policies, "initial")
    if agent is None:
        agent = saved_agent(task, run.config["agent"], "initial: the learner of the run")
    return agent, run.seeds if seeds is None else seeds, policies


def interface_of(task: Task, policy: Policy) -> Interface | None:
    """What observations and actions of a policy mean on a task; `None`, with a warning, where the task does not say."""
    try:
        return task.interface(policy.actions)  # type: ignore[arg-type]
    except ValueError as error:
        message = f"{error}: its policies act in this task alone, and start others without it"
        warnings.warn(message, RunWarning, stacklevel=2)
        return None
