"""Policies on a body watched without learning, on whatever ground."""

from collections.abc import Sequence
from typing import Literal

import jax
import numpy as np

from motorgrad.experiments._workspace import Workspace
from motorgrad.learning import Agent
from motorgrad.policies import Policy
from motorgrad.tasks import Task
from motorgrad.training import stepper_of

FRESH = 500_000_000
"""Added to the numbers of rows, so that nothing is judged on the random numbers that it learnt from."""
SETTLING = 2.0  # s


def watched(
    work: Workspace, policies: Policy, task: Task, seconds: float, mode: Literal["sample", "mode"], names: Sequence[str]
) -> dict[str, np.ndarray]:
    """The mean of each named reading over `seconds`, after the two first, for each of the `policies` along their
    leading axis, `(policies,)`."""
    count = len(jax.tree.leaves(policies)[0])
    agent = Agent(jax.tree.map(lambda leaf: leaf[0], policies))
    stepper = stepper_of(task, agent, [FRESH + row for row in range(count)], mode, work.threads)
    stepper.use(policies)
    stepper.advance(round(SETTLING / task.period))
    stepper.harvest()
    stepper.advance(round(seconds / task.period))
    record = stepper.harvest()
    return {name: np.asarray(record[name], float) for name in names}
