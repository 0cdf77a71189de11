"""Code that a run directory or a settings file names: none of it runs before the user consents."""

import importlib.util
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motorgrad._errors import NotTrusted
from motorgrad.tasks import TASKS, HostTask, Task

MOST = 12  # names in a message
HOW = "trust=True in Python, --trust on the command line"


def check_imports(settings: Any, where: str, trust: bool = False, words: Sequence[str] = ()) -> None:
    """Refuse to make the task of a stored configuration if that would import a module that is not imported yet.

    **Arguments:** the table `settings` of the task, with its `name`; `where` it was found; whether its user trusts it;
    the user's own `words`, which may name the module, too.

    **Raises:** `NotTrusted` that says what would be imported.
    """
    known = isinstance(settings, Mapping) and isinstance(settings.get("name"), str)
    if trust or not known or settings["name"] not in TASKS:
        return
    given = {word.rpartition("=")[2].partition(":")[0] for word in words if ":" in word}
    named = dict.fromkeys(TASKS[settings["name"]].imports(settings))
    wanted = [f"{module} ({_place(module)})" for module in named if module not in given and module not in sys.modules]
    if wanted:
        raise NotTrusted(
            f"{where} names code: making its task {settings['name']!r} imports {', '.join(wanted)}; nothing was "
            f"imported. If you trust it, import the module yourself, or say so: {HOW}"
        )


def check_pickles(task: Task, arrays: Mapping[str, np.ndarray], where: str, ours: bool) -> None:
    """Refuse to restore a state that is a pickle, unless it is `ours`: trusted, or written by this process.

    **Raises:** `NotTrusted` that says what it may call.
    """
    if ours or not isinstance(task, HostTask):
        return
    start = "physics."
    snapshot = {name.removeprefix(start): array for name, array in arrays.items() if name.startswith(start)}
    if names := task.runs(snapshot):
        more = f" and {len(names) - MOST} more" if len(names) > MOST else ""
        raise NotTrusted(
            f"{where} holds pickled environments: to continue, they are unpickled, which calls "
            f"{', '.join(names[:MOST])}{more}; nothing was run. If you trust it, say so: {HOW}"
        )


def _place(module: str) -> str:
    """Where a module would be imported from. Only its outermost package is looked up, as that imports nothing."""
    package = module.partition(".")[0]
    try:
        found = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        found = None
    return "not found" if found is None else f"from {found.origin or found.name}"
