"""The options of a task and its learner, for the commands that take both."""

import dataclasses
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from motorgrad._errors import check, choice
from motorgrad._settings import as_hinted, default_of, full_path
from motorgrad._tree import Part, fields_of, hints_of, options_of, parts_in
from motorgrad.learning import Agent
from motorgrad.options._configuration import HELP, HELP_ALL, Arguments, naming, parse_values, pop_option
from motorgrad.policies import IMPLIED, INITIAL
from motorgrad.tasks import ENVIRONMENT, TASKS, Task, is_environment, settings_in
from motorgrad.training import RunDirectoryError, agent_for, agent_table, check_imports, policy_settings


def command_with_learner(base: type, name: str, does: str, task_name: str, given: Arguments) -> tuple[Any, Arguments]:
    """The options of a command with those of a task and its learner, and the arguments left to parse.

    The options of a learner depend on its structure: the kinds of its parts. So the task is read first, then the
    learner's settings in the file, then the kinds on the command line.

    **Arguments:** `base`, the command's own options; the `name` of the class and what the command `does`, for the help.
    """
    own = given.table.get("task")
    if isinstance(own, dict):
        check_imports({**own, "name": task_name}, str(given.file), "--trust" in given.rest)
    blank = TASKS[task_name]()
    rest = _expand_aliases(given.rest)
    about = {"preset": _peek("preset", given, str), "steps": _peek("steps", given, float)}
    task = blank
    settings = {key: value for key, value in given.table.items() if key == "task"}
    with naming(given.file):
        if of_task := _options_of_task(rest):
            whole = _with_fields(base, name, does, blank, agent_for(blank, **about))
            draft = given._replace(table=settings, rest=of_task)
            settings = parse_values(whole, draft, f"{name.lower()} {task_name}")
        task = as_hinted(TASKS[task_name], settings.get("task", {}), "task")
        agent = agent_for(task, given.table.get("agent"), **about)
    agent, rest = _apply_kinds(agent, rest)
    table = {key: value for key, value in given.table.items() if key != "agent"}
    return _with_fields(base, name, does, task, agent), given._replace(table=table, rest=rest)


def _options_of_task(rest: list[str]) -> list[str]:
    """The options of the task with their values. The learner's own options depend on the task."""
    found = []
    within = False
    for word in rest:
        within = word.startswith("--task") if word.startswith("--") or word == "-h" else within
        found += [word] if within else []
    return found


def _peek(option: str, given: Arguments, kind: type) -> Any:
    """The value of an option of the command, on which the options of the learner depend; `None` where it is not given
    or wrong, as it is reported when all options are read."""
    words = [*given.rest, ""]
    found = [b for a, b in itertools.pairwise(words) if a == f"--{option}"]
    found += [word.partition("=")[2] for word in words if word.startswith(f"--{option}=")]
    value = found[-1] if found else given.table.get(option)
    try:
        number = None if value is None else kind(value)
    except (TypeError, ValueError):
        return None
    return number if kind is str or (number is not None and 1 <= number < 2**32) else None


def changes_from_task(task: Task, agent: Agent, preset: str | None, steps: int) -> dict[str, Any]:
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


def _with_fields(base: type, name: str, does: str, task: Task, agent: Agent) -> Any:
    """The options of `base` with those of a task and of a learner, whose values are the defaults."""
    fields = [
        ("task", type(task), dataclasses.field(default_factory=lambda: task)),
        ("agent", Agent, dataclasses.field(default_factory=lambda: agent)),
    ]
    goal = (type(task).__doc__ or "").partition("\n")[0]
    plain = (name for name, field in fields_of(type(task)).items() if not dataclasses.is_dataclass(default_of(field)))
    first = next((f"--task.{_dashed(setting)}, " for setting in plain), "")
    more = (
        "Every setting of the task, its body and the learner is an option, too, such as "
        f"{first}--agent.decay or --agent.learning-rate: motorgrad {name.lower()} {task.name} --help-all lists them."
    )
    doc = f"{does}: {goal}\n\n{more}\n\n{_short_names()}"
    return dataclasses.make_dataclass(name, fields, bases=(base,), frozen=True, namespace={"__doc__": doc})


def _short_names() -> str:
    """The short names of a learner's settings as a sentence of the help."""
    first, *others = sorted(Agent.aliases, key=lambda short: -Agent.aliases[short].count("."))
    path = _dashed(Agent.aliases[first])
    listed = ", ".join(map(_dashed, others))
    return f"Short names: --agent.{_dashed(first)} is --agent.{path}; likewise {listed}."


def _leaves(value: object, path: str = "") -> Iterator[tuple[str, Any]]:
    """The entries of nested tables, by path."""
    if isinstance(value, dict):
        for name, item in value.items():
            yield from _leaves(item, f"{path}.{name}" if path else name)
    else:
        yield path, value


def _dashed(path: str) -> str:
    return path.replace("_", "-")


def _setting_path(flag: str) -> str:
    """The path of a learner's setting that an option names."""
    return flag.removeprefix("--agent.").replace("-", "_")


def _expand_aliases(rest: list[str]) -> list[str]:
    """The arguments with short names of a learner's settings written out."""
    found = []
    for argument in rest:
        flag, equals, value = argument.partition("=")
        if flag.startswith("--agent."):
            flag = f"--agent.{_dashed(full_path(Agent, _setting_path(flag)))}"
        found.append(f"{flag}{equals}{value}")
    return found


def _apply_kinds(agent: Agent, rest: list[str]) -> tuple[Agent, list[str]]:
    """The agent with the kinds of parts that the arguments name, the outer ones first, and the other arguments.

    A number of one group of parameters, such as `--agent.learning-rate.gain 0.1`, is applied, too.
    """
    kinds: dict[str, str] = {}
    numbers: dict[str, str] = {}
    left = []
    words = list(rest)
    while words:
        argument, *words = words
        flag, equals, value = argument.partition("=")
        path = _setting_path(flag).removesuffix(".kind")
        word = value if equals else (words[0] if words else "")
        if flag.startswith("--agent.") and _names_kind(path, word, flag.endswith(".kind")):
            check(path not in kinds, flag, word, "given once")
            kinds[path] = word
        elif flag.startswith("--agent.") and word and _is_group(agent, path):
            numbers[path] = word
        else:
            left.append(argument)
            continue
        words = words if equals else words[1:]
    for path in [path for path in numbers if path.rpartition(".")[0] in kinds]:  # of the part in place of the groups
        left.append(f"--agent.{_dashed(path)}={numbers.pop(path)}")
    kinds = {**IMPLIED.get(kinds.get("policy", ""), {}), **kinds}
    for path in sorted(kinds, key=lambda path: path.count(".")):
        change = {"kind": kinds[path], **_required_values(path, kinds[path], left)}
        agent = as_hinted(Agent, {path: change} if path != "kind" else change, "agent", agent)
    for path, word in numbers.items():
        try:
            agent = as_hinted(Agent, {path: float(word)}, "agent", agent)
        except ValueError:
            raise ValueError(f"agent.{path} = {word!r}: must be a finite number of at least 0") from None
    return agent, left


def _required_values(path: str, kind: str, rest: list[str]) -> dict[str, Any]:
    """The values on the command line of those settings of a kind that have no default."""
    found: dict[str, Any] = {}
    hint = _hint_at(path)
    parts = () if hint is None else _bases_of(hint)
    for cls in (cls for part in parts for name, cls in part.kinds().items() if name == kind):
        for name, field in fields_of(cls).items():
            if default_of(field) is dataclasses.MISSING:
                flag = f"--agent.{_dashed(path)}.{_dashed(name)}"
                words = [after for word, after in itertools.pairwise([*rest, ""]) if word == flag]
                words += [word.partition("=")[2] for word in rest if word.startswith(f"{flag}=")]
                try:
                    found.update((name, float(word)) for word in words)
                except ValueError:
                    raise ValueError(f"agent.{path}.{name} = {words[-1]!r}: must be a finite number") from None
    return found


def _names_kind(path: str, word: str, explicit: bool) -> bool:
    """Whether an option at a path, with a word after it, names the kind of a part."""
    if path in ("kind", "policy"):
        return True
    hint = _hint_at(path)
    if hint is None:
        return explicit
    kinds = parts_in(hint)
    known = {name for cls in kinds for name in (*cls.kinds(), *getattr(cls, "presets", {}))} | {"none"}
    numeric = any(option in (float, int) for option in options_of(hint))
    return bool(kinds) and (word in known or not numeric)


def _hint_at(path: str) -> Any:
    """The type of the field at a path, in any kinds of the parts on the way; `None` where there is none."""
    hint: Any = Agent
    for name in path.split("."):
        fields = [hints_of(cls) for base in _bases_of(hint) for cls in (base, *base.kinds().values())]
        fields += map(policy_settings, INITIAL) if path.partition(".")[0] == "policy" and hint is Any else []
        hint = next((found[name] for found in fields if name in found), None)
        if hint is None:
            return None
    return hint


def _bases_of(hint: object) -> tuple[type[Part], ...]:
    """The bases of the parts that may stand in a field of this type."""
    return (hint,) if isinstance(hint, type) and issubclass(hint, Part) else parts_in(hint)


def _is_group(agent: Agent, path: str) -> bool:
    """Whether a path names one group of a number that is given by groups."""
    *outer, last = path.split(".")
    node: Any = agent
    for name in outer:
        node = node if isinstance(node, dict) else getattr(node, name, None)  # a group's name may have dots
    return isinstance(node, dict) and bool(last)
