"""The tasks by name, loaded from `motorgrad._task_table`."""

import importlib
import re
from pathlib import Path
from typing import Any

from motorgrad._arguments import check_arguments
from motorgrad._consent import allow
from motorgrad._errors import choice
from motorgrad._files import read_toml
from motorgrad._program_store import keep_programs
from motorgrad._task_table import TASK_TABLE, Entry
from motorgrad.schema import build
from motorgrad.tasks._task import Task

COMPOSED = "composed"
"""The task that a file describes if it names none."""
ENVIRONMENT = "gymnasium"
"""The task that the id of a Gymnasium environment stands for."""


def _load(entry: Entry) -> type[Task]:
    module, _, name = entry.place.partition(":")
    return getattr(importlib.import_module(f"motorgrad.tasks.{module}"), name)


TASKS: dict[str, type[Task]] = {name: _load(entry) for name, entry in TASK_TABLE.items()}
"""The class of every task, by name. You may add your own."""


def make(name: str, **settings: object) -> Task:
    """Make the task called `name`, with settings that override its defaults.

    Pass a body's settings as a table: `make("hopper", penalty=0.2, body={"load_mass": 3.0})`. The id of a Gymnasium
    environment is a name, too: `make("Pendulum-v1", repeat=2)`. One with a module, `module:Name-v0`, imports it.

    **Raises:** `ValueError` for an unknown name or setting, suggesting the nearest known one, and for invalid values.
    """
    keep_programs()
    if is_environment(name) and name not in TASKS:
        allow([name])
        return build(TASKS[ENVIRONMENT], {"env_id": name, **settings}, ENVIRONMENT)
    choice("task", name, TASKS, registered=True)
    return build(TASKS[name], settings, name)


def is_environment(word: object) -> bool:
    """Whether a word is the id of a Gymnasium environment: `Name-v0` or `module:Name-v0`."""
    return isinstance(word, str) and re.fullmatch(r"(\S+:)?\S+-v\d+", word) is not None


def load(path: Path | str) -> Task:
    """The task that a TOML file describes: a composed one, or the one that its `name` says.

    Paths in the file are meant from where the file is.

    **Raises:** `ValueError` that names the file.

    ```py
    task = mg.tasks.load("reach.toml")
    ```
    """
    check_arguments(load, locals())
    path = Path(path)
    settings = settings_in(path)
    try:
        return make(settings.pop("name"), **settings)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def settings_in(path: Path) -> dict[str, Any]:
    """The settings of the task in a file, with its name."""
    settings = read_toml(path)
    try:
        name = settings.setdefault("name", COMPOSED)
        choice("name", name, TASKS, registered=True)
        return {"name": name, **TASKS[name].in_folder(settings, path.absolute().parent)}
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
