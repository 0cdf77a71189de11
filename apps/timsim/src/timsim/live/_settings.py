"""The settings of a live run by name: what the fields of its task and of its learner declare."""

from motorgrad.learning import Learner
from motorgrad.schema import Declared, declared_at, declared_by, fields_of
from motorgrad.tasks import Task

AGENT = "agent."
TASK = "task."


def declared_setting(name: str, task: Task | None, agent: Learner | None) -> Declared:
    """What is declared of a setting of a task or a learner; nothing of others, such as those of a body."""
    if name.startswith(AGENT) and agent is not None:
        return declared_at(agent, name.removeprefix(AGENT))
    field = fields_of(type(task)).get(name.removeprefix(TASK)) if name.startswith(TASK) else None
    return Declared() if field is None else declared_by(field)
