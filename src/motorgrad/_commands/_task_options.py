"""A task and its learner among a command's options."""

import dataclasses
from typing import Any

from motorgrad._commands._configuration import Given, take
from motorgrad._errors import check, choice
from motorgrad.policies import INITIAL
from motorgrad.tasks import TASKS
from motorgrad.training import AgentSettings, RunDirectoryError, settings_for, settings_in

DEFAULTS = {field.name: field.default for field in dataclasses.fields(AgentSettings)}


def with_learner(base: type, name: str, does: str, task: Any, policy: dict[str, str] | None = None) -> Any:
    """The options of `base` with those of a task and of the learner that goes with it, and with a policy.

    **Arguments:** the class's `name`, which begins its help; what it `does`.
    """
    parts = {"task": task, "agent": settings_for(task, **(policy or {}))}
    fields = [(key, type(part), dataclasses.field(default_factory=lambda p=part: p)) for key, part in parts.items()]
    doc = f"{does}: {(type(task).__doc__ or '').partition(chr(10))[0]}"
    return dataclasses.make_dataclass(name, fields, bases=(base,), frozen=True, namespace={"__doc__": doc})


def policy_of(given: Given) -> dict[str, str]:
    """The initial policy that is asked for, as a setting; nothing where none is, or none that there is."""
    agent = given.table.get("agent")
    filed = agent.get("policy") if isinstance(agent, dict) else None
    asked = take("agent.policy", given.rest)[0] or filed
    return {"policy": asked} if isinstance(asked, str) and asked in INITIAL else {}


def task_of(given: Given) -> tuple[str | None, Given]:
    """The task's name, from the command line or from the file, and what else is given.

    The file may be a run's own `config.toml`: its table `run` holds options.
    """
    name, rest = None, given.rest
    if rest and not rest[0].startswith("-"):
        name, *rest = rest
        choice("task", name, TASKS)
    if given.file is None:
        return name, given._replace(rest=rest)
    try:
        named, values = _read(given.table)
        settings = values.get("task")
        if name is not None and named not in (None, name) and settings:
            raise ValueError(f"task: has settings of {named!r} ({', '.join(settings)}), but {name!r} is to be learnt")
        check(name or named or {"-h", "--help"} & set(rest), "task.name", named, "given, here or on the command line")
    except (ValueError, RunDirectoryError) as error:
        raise ValueError(f"{given.file}: {error}") from None
    return name or named, given._replace(table=values, rest=rest)


def _read(table: dict[str, Any]) -> tuple[str | None, dict[str, Any]]:
    """The task's name in a file, and the options there."""
    values = dict(table)
    if isinstance(values.get("run"), dict):
        run = {key: value for key, value in values.pop("run").items() if key != "initial"}
        for key in run:
            check(key not in values, key, run[key], "given once, here or in the table run")
        values |= run
    task = values.pop("task", {})
    check(isinstance(task, dict), "task", task, "a table with the task's name in it: [task] name = ...")
    named, settings = task.get("name"), {key: value for key, value in task.items() if key != "name"}
    if named is not None:
        choice("task", named, TASKS)
    if isinstance(agent := values.get("agent"), dict) and isinstance(agent.get("policy"), dict):
        settings_in(agent, "agent")
    if isinstance(agent, dict) and {name for name, value in DEFAULTS.items() if value is not None} <= agent.keys():
        values["agent"] = {**DEFAULTS, **agent}  # all is said: TOML has no word for what is None
    return named, values | ({"task": settings} if settings else {})
