"""The settings of a live run by name: what the fields of its task and of its learner declare."""

import dataclasses

from motorgrad.learning import Learner
from motorgrad.schema import Declared, declared_at, declared_by, fields_of, numbers_of
from motorgrad.tasks import Task

AGENT = "agent."
TASK = "task."
SKIPPED = ("action_period", "time_limit")
"""Numbers of tasks that do not change what is rewarded."""


def declared_setting(name: str, task: Task | None, agent: Learner | None) -> Declared:
    """What is declared of a setting of a task or a learner; nothing of others, such as those of a body."""
    if name.startswith(AGENT) and agent is not None:
        return declared_at(agent, name.removeprefix(AGENT))
    field = fields_of(type(task)).get(name.removeprefix(TASK)) if name.startswith(TASK) else None
    return Declared() if field is None else declared_by(field)


def agent_numbers(agent: Learner) -> dict[str, float]:
    """The numbers of a learner that can be changed while it runs, by name."""
    found = {path: value for path, value in numbers_of(agent.hyperparameters).items() if declared_at(agent, path).live}
    return {f"{AGENT}{path}": value for path, value in found.items() if isinstance(value, float)}


def task_numbers(task: Task) -> dict[str, float]:
    """The numbers of a task that can be changed while it runs, by name."""
    fields = [field.name for field in dataclasses.fields(task)] if dataclasses.is_dataclass(task) else []
    values = {name: getattr(task, name) for name in fields if name not in SKIPPED}
    return {f"{TASK}{name}": value for name, value in values.items() if isinstance(value, float)}
