"""The options of a task and its learner, for the commands that take both."""

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from motorgrad._errors import check, choice
from motorgrad.learning import Learner
from motorgrad.options._configuration import Arguments, naming, pop_option
from motorgrad.options._line import HELP, HELP_ALL, flag_of, nested, read_line
from motorgrad.schema import as_hinted, default_of, fields_of, hints_of
from motorgrad.tasks import ENVIRONMENT, TASKS, Task, is_environment, settings_in
from motorgrad.training import RunDirectoryError, agent_for, agent_table, check_imports, choice_for, with_changes


def command_with_learner(
    base: type, name: str, does: str, task_name: str, given: Arguments, swept: Iterable[str] = ()
) -> tuple[Any, Arguments]:
    """The options of a command with those of a task and its learner, and the arguments left to read.

    A learner is built for its task, so the task comes first, each from the file and then from the command line.

    **Arguments:** `base`, the command's own options; the `name` of the class and what the command `does`, for the help;
    the names of settings that are `swept`.

    The options' class has the preset that the task got by itself as `choice`, or `None`.
    """
    own = given.table.get("task")
    if isinstance(own, dict):
        check_imports({**own, "name": task_name}, str(given.file), "--trust" in given.rest)
    line = read_line(base, given.rest)
    of_task = nested({path: words for path, words in line.items() if path.startswith("task.")}).get("task", {})
    of_agent = {path.removeprefix("agent."): words for path, words in line.items() if path.startswith("agent.")}
    own = {path: words for path, words in line.items() if not path.startswith(("task.", "agent."))}
    with naming(given.file):
        task = as_hinted(TASKS[task_name], given.table.get("task", {}), "task")
        task = as_hinted(type(task), of_task, "task", task) if of_task else task
        how = _of_schedule(base, {**given.table, **own})
        table = given.table.get("agent")
        named = {**(table if isinstance(table, Mapping) else {}), **of_agent, **dict.fromkeys(swept)}
        choice = None if "preset" in how else choice_for(task, named, **how)
        if choice is not None:
            how["preset"] = choice.preset
        agent = agent_for(task, table, **how)
        agent = with_changes(agent, of_agent)
    left = {key: value for key, value in given.table.items() if key not in ("task", "agent")}
    kind = _with_fields(base, name, does, task, agent)
    kind.choice = choice
    return kind, given._replace(table=left, line=own)


def _of_schedule(base: type, values: dict[str, Any]) -> dict[str, Any]:
    """The options of a command on which the learner depends: its preset, steps and environments."""
    hints = hints_of(base)
    known = {"preset", "steps", "envs"} & hints.keys() & values.keys()  # an unknown key of a file is refused later
    how = {name: as_hinted(hints[name], values[name], name) for name in known}
    return {name: value for name, value in how.items() if name == "preset" or 1 <= value < 2**32}


def changes_from_task(task: Task, agent: Learner, preset: str | None, steps: int) -> dict[str, Any]:
    """The settings in which an agent differs from the learner that goes with its task, or a preset, by path."""
    started = agent_for(task, preset=preset, steps=steps)
    own, now = (dict(_leaves(agent_table(each))) for each in (started, agent))
    return {path: value for path, value in now.items() if own.get(path) != value}


def split_task(given: Arguments) -> tuple[str | None, Arguments]:
    """The task's name, from the command line or from a file, and the other arguments.

    The file of options may be a run's own `config.toml`: its table `run` holds options. `--task FILE`, or a first word
    that ends in ".toml", names the file of a task alone.
    """
    word, rest = pop_option("task", given.rest)
    if word is None and rest and _is_file(rest[0]):
        word, *rest = rest
    if word is not None:
        check(not rest or rest[0].startswith("-"), "--task", word, f"left out, as the command names {rest[:1]}")
        check("task" not in given.table, "--task", word, f"left out, as {given.file} has a task")
        settings = settings_in(Path(word))
        name = settings.pop("name")
        table = {**given.table, "task": settings}
        return name, given._replace(file=given.file or Path(word), rest=rest, table=table)
    name = None
    if rest and not rest[0].startswith("-"):
        name, *rest = rest
        if name not in TASKS and is_environment(name):
            rest = ["--task.env-id", name, *rest]
            name = ENVIRONMENT
        choice("task", name, TASKS, registered=True)
    if given.file is None:
        return name, given._replace(rest=rest)
    try:
        named, values = _task_in_file(given.table, given.file.absolute().parent)
        settings = values.get("task")
        if name is not None and named not in (None, name) and settings:
            raise ValueError(f"task: has settings of {named!r} ({', '.join(settings)}), but the command names {name!r}")
        check(name or named or {*HELP, HELP_ALL} & set(rest), "task.name", named, "given, here or on the command line")
    except (ValueError, RunDirectoryError) as error:
        raise ValueError(f"{given.file}: {error}") from None
    return name or named, given._replace(table=values, rest=rest)


def is_task_word(word: str) -> bool:
    """Whether a first word names a task: by its name, as a file, or as the id of a Gymnasium environment."""
    return word in TASKS or _is_file(word) or is_environment(word)


def _is_file(word: str) -> bool:
    return not word.startswith("-") and word.lower().endswith(".toml")


def _task_in_file(table: dict[str, Any], folder: Path) -> tuple[str | None, dict[str, Any]]:
    """The task's name in a file of a folder, and the options there."""
    values = dict(table)
    if isinstance(values.get("run"), dict):
        run = {key: value for key, value in values.pop("run").items() if key != "initial"}
        for key in run:
            check(key not in values, key, run[key], "given once, here or in the table run")
        values |= run
    task = values.pop("task", {})
    check(isinstance(task, dict), "task", task, "a table with the task's name in it: [task] name = ...")
    named = task.get("name")
    settings = {key: value for key, value in task.items() if key != "name"}
    if named is not None:
        choice("task", named, TASKS, registered=True)
        settings = TASKS[named].in_folder(settings, folder)
    agent = values.get("agent")
    policy = agent.get("policy") if isinstance(agent, dict) else None
    if isinstance(policy, dict) and policy.get("kind") == "given":
        raise RunDirectoryError(
            "agent.policy was made in Python and is not registered: give the agent again, in Python"
        )
    return named, values | ({"task": settings} if settings else {})


def _with_fields(base: type, name: str, does: str, task: Task, agent: Learner) -> Any:
    """The options of `base` with those of a task and of a learner, whose values are the defaults."""
    fields = [
        ("task", type(task), dataclasses.field(default_factory=lambda: task)),
        ("agent", Learner, dataclasses.field(default_factory=lambda: agent)),
    ]
    goal = (type(task).__doc__ or "").partition("\n")[0]
    doc = f"{does}: {goal}\n\n{_about_all(type(task), agent, name.lower())}\n\n{_short_names(agent)}"
    return dataclasses.make_dataclass(name, fields, bases=(base,), frozen=True, namespace={"__doc__": doc})


def _about_all(task: type[Task], agent: Learner, command: str) -> str:
    """A sentence of the help on the options that it leaves out."""
    plain = (name for name, field in fields_of(task).items() if not dataclasses.is_dataclass(default_of(field)))
    known = {*agent.aliases, *fields_of(type(agent))}
    paths = [*(f"task.{name}" for name in itertools.islice(plain, 1)), "agent.kind"]
    paths += [f"agent.{name}" for name in ("decay", "learning_rate") if name in known]
    return (
        "Every setting of the task, its body and the learner is an option, too, such as "
        f"{', '.join(map(flag_of, paths))}: motorgrad {command} {task.name} --help-all lists them."
    )


def _short_names(agent: Learner) -> str:
    """The short names of a learner's settings as a sentence of the help."""
    first, *others = sorted(agent.aliases, key=lambda short: -agent.aliases[short].count("."))
    listed = ", ".join(others).replace("_", "-")
    likewise = f"; likewise {listed}" if others else ""
    return f"Short names: {flag_of(f'agent.{first}')} is {flag_of(f'agent.{agent.aliases[first]}')}{likewise}."


def _leaves(value: object, path: str = "") -> Iterator[tuple[str, Any]]:
    """The entries of nested tables, by path."""
    if isinstance(value, dict):
        for name, item in value.items():
            yield from _leaves(item, f"{path}.{name}" if path else name)
    else:
        yield path, value
