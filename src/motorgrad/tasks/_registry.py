"""The tasks by name, loaded from `motorgrad._task_table`."""

import importlib
from typing import Any

from motorgrad._errors import unknown
from motorgrad._settings import build
from motorgrad._task_table import TASK_TABLE, Entry
from motorgrad.tasks._task import Task


def _load(entry: Entry) -> type[Task]:
    module, _, name = entry.place.partition(":")
    return getattr(importlib.import_module(f"motorgrad.tasks.{module}"), name)


TASKS: dict[str, type[Task]] = {name: _load(entry) for name, entry in TASK_TABLE.items()}
"""The class of every task, by name. You may add your own."""


def make(name: str, **settings: Any) -> Task:
    """Make the task called `name`, with settings that override its defaults.

    Pass a body's settings as a table: `make("hopper", penalty=0.2, body={"load_mass": 3.0})`.

    **Raises:** `ValueError` for an unknown name or setting, suggesting the nearest known one, and for invalid values.
    """
    if name not in TASKS:
        raise unknown("task", name, TASKS)
    return build(TASKS[name], settings, name)
