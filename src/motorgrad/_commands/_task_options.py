"""A task and its learner among the options of a command."""

import dataclasses
from typing import Any

from motorgrad._commands._configuration import Given, fill
from motorgrad._errors import check, choice
from motorgrad._settings import as_hinted
from motorgrad._tree import Part, hints_of, options_of, parts_in
from motorgrad.learning import Agent
from motorgrad.policies import IMPLIED
from motorgrad.tasks import TASKS, Task
from motorgrad.training import RunDirectoryError, agent_for, agent_in


def with_learner(base: type, name: str, does: str, task: Task, agent: Agent) -> Any:
    """The options of `base` with those of a task and of a learner.

    **Arguments:** the class's `name`, which begins its help; what it `does`; the task and the agent, whose values are
    the defaults.
    """
    parts = {"task": task, "agent": agent}
    fields = [(key, type(part), dataclasses.field(default_factory=lambda p=part: p)) for key, part in parts.items()]
    short = ", ".join(f"--agent.{_dashed(name)} for --agent.{_dashed(path)}" for name, path in Agent.aliases.items())
    doc = f"{does}: {(type(task).__doc__ or '').partition(chr(10))[0]}\n\nShort names: {short}."
    return dataclasses.make_dataclass(name, fields, bases=(base,), frozen=True, namespace={"__doc__": doc})


def learner_command(base: type, name: str, does: str, task_name: str, given: Given) -> tuple[Any, Given]:
    """The options of a command with those of the task and the learner that are asked for, and what is left to parse.

    The options of a learner depend on its structure: the kinds of its parts. So the task comes first, then the file's
    settings of the learner, then the kinds on the command line.
    """
    prog = f"{name.lower()} {task_name}"
    about_task = any(argument.startswith("--task") for argument in given.rest)
    draft = given._replace(
        table={key: value for key, value in given.table.items() if key == "task"}, rest=given.rest if about_task else []
    )
    blank = TASKS[task_name]()
    rest = _unaliased(given.rest)
    whole = with_learner(base, name, does, blank, _with_kinds(agent_for(blank), rest)[0])
    asked = (
        fill(whole, draft._replace(rest=_unaliased(draft.rest)), prog).get("task", {})
        if about_task
        else draft.table.get("task", {})
    )
    task = as_hinted(TASKS[task_name], asked, "task")
    values = dict(given.table)
    try:
        agent = agent_for(task, values.pop("agent", None))
    except ValueError as error:
        raise ValueError(f"{given.file}: {error}" if given.file else str(error)) from None
    agent, rest = _with_kinds(agent, rest)
    return with_learner(base, name, does, task, agent), given._replace(table=values, rest=rest)


def changes_of(task: Task, agent: Agent) -> dict[str, Any]:
    """The settings in which an agent differs from the learner that goes with its task, by path."""
    own, now = (dict(_flat("", _table(each))) for each in (agent_for(task), agent))
    return {path: value for path, value in now.items() if own.get(path) != value}


def _table(agent: Agent) -> dict[str, Any]:
    from motorgrad.training import agent_table

    return agent_table(agent)


def _flat(path: str, value: Any) -> Any:
    if isinstance(value, dict):
        for name, item in value.items():
            yield from _flat(f"{path}.{name}" if path else name, item)
    else:
        yield path, value


def _dashed(path: str) -> str:
    return path.replace("_", "-")


def _unaliased(rest: list[str]) -> list[str]:
    """The arguments with short names of a learner's settings written out."""
    found = []
    for argument in rest:
        flag, equals, value = argument.partition("=")
        name = flag.removeprefix("--agent.").replace("-", "_")
        if flag.startswith("--agent.") and name in Agent.aliases:
            flag = f"--agent.{_dashed(Agent.aliases[name])}"
        found.append(f"{flag}{equals}{value}")
    return found


def _with_kinds(agent: Agent, rest: list[str]) -> tuple[Agent, list[str]]:
    """The agent with the kinds of parts that the arguments ask for, the outer ones first, and the other arguments."""
    asked: dict[str, str] = {}
    left, words = [], list(rest)
    while words:
        argument, *words = words
        flag, equals, value = argument.partition("=")
        path = flag.removeprefix("--agent.").replace("-", "_").removesuffix(".kind")
        word = value if equals else (words[0] if words else "")
        if flag.startswith("--agent.") and _chooses(agent, path, word, flag.endswith(".kind")):
            check(path not in asked, flag, word, "given once")
            asked[path] = word
            words = words if equals else words[1:]
        elif flag.startswith("--agent.") and _is_group(agent, path) and word:
            asked[path] = word
            words = words if equals else words[1:]
        else:
            left.append(argument)
    asked = {**IMPLIED.get(asked.get("policy", ""), {}), **asked}
    for path in sorted(asked, key=lambda path: path.count(".")):
        change: Any = float(asked[path]) if _is_group(agent, path) else asked[path]
        agent = as_hinted(Agent, {path: change}, "agent", agent)
    return agent, left


def _chooses(agent: Agent, path: str, word: str, kind: bool) -> bool:
    """Whether an argument names the kind of a part."""
    if path in ("kind", "policy"):
        return True
    node: Any = Agent
    hint: Any = None
    for name in path.split("."):
        fields = [hints_of(cls) for cls in _classes(node)]
        hint = next((found[name] for found in fields if name in found), None)
        if hint is None:
            return kind
        node = hint
    kinds = parts_in(hint)
    known = {name for cls in kinds for name in (*cls.kinds(), *getattr(cls, "presets", {}))} | {"none"}
    numeric = any(option in (float, int) for option in options_of(hint))
    return bool(kinds) and (word in known or not numeric)


def _classes(hint: Any) -> list[type]:
    """The parts that may stand in a field of this type."""
    bases = parts_in(hint) if not isinstance(hint, type) or not issubclass(hint, Part) else (hint,)
    return [cls for base in bases for cls in (base, *base.kinds().values())]


def _is_group(agent: Agent, path: str) -> bool:
    """Whether a path names one group of a number that is given by groups."""
    *outer, last = path.split(".")
    node: Any = agent
    for name in outer:
        node = getattr(node, name, None)
    return isinstance(node, dict) and bool(last)


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
    agent = values.get("agent")
    if isinstance(agent, dict) and isinstance(agent.get("policy"), dict) and agent["policy"].get("kind") == "given":
        agent_in(as_hinted(TASKS[str(named)], settings, "task"), agent, "agent")  # refused by name
    return named, values | ({"task": settings} if settings else {})
