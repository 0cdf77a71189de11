"""What is to be simulated: a learner of a task, or a bare MuJoCo model."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)

import dataclasses
from typing import Any

import mujoco

from motorgrad._errors import check
from motorgrad.bodies import compile_model
from motorgrad.learning import Agent
from motorgrad.policies import Policy
from motorgrad.tasks import BodyTask, Task
from motorgrad.training import check_training


@dataclasses.dataclass(frozen=True, eq=False)
class Setup:
    """What a worker simulates; it crosses to its process whole.

    - `name`: the title of the page.
    - `task`, `agent`, `seed`: the learner; `task` None for a bare model.
    - `initial`: the policy to begin from, along a leading axis of one, or None for the agent's own; `memory`, what the
      task remembered when it had been learnt.
    - `frozen`: whether to begin without learning.
    - `model`: of the body in view, with the page's cameras; None for worlds in JAX.
    """

    name: str
    task: Task | None = None
    agent: Agent | None = None
    seed: int = 0
    initial: Policy | None = None
    memory: Any = None
    frozen: bool = False
    model: mujoco.MjModel | None = None


def learner(task: Task | str | None, agent: Any = None, seed: int = 0, **rest: Any) -> Setup:
    """The set-up of a learner.

    **Arguments:** `task` and `agent` as `motorgrad.train` takes them; `seed`; the others as of `Setup`.

    **Raises** `ValueError` for what does not fit together.
    """
    check(task is not None, "task", task, "a task, or the name of one")
    asked = check_training(task, agent, seeds=[seed])  # type: ignore[arg-type]
    if "model" not in rest and isinstance(asked.task, BodyTask):
        rest["model"] = compile_model(asked.task.dynamics)
    return Setup(asked.task.name, asked.task, asked.agent, seed, **rest)
