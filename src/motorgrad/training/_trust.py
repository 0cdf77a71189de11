"""Code that a run directory or a settings file names: none of it runs before the user consents."""

import importlib.util
from collections.abc import Mapping
from pathlib import Path

from motorgrad._consent import HOW, allow
from motorgrad._errors import NotTrusted, shown
from motorgrad.tasks import ENVIRONMENT, TASKS, Task, is_environment, make, settings_in

MAX_LISTED_NAMES = 10
"""Names in a message. Of more, and of longer ones than a message has room for, no question is asked, as it would not
show what it is about."""


def check_imports(settings: object, where: str, trust: bool = False) -> None:
    """Refuse to make the task of a stored configuration, the table `settings`, if that would import what the user has
    not named. **Raises** `NotTrusted` that says what would be imported, and `where` that was found."""
    if not isinstance(settings, Mapping) or not isinstance(settings.get("name"), str):
        return
    if settings["name"] not in TASKS and is_environment(settings["name"]):  # which `make` takes for its name
        settings = {**settings, "name": ENVIRONMENT, "env_id": settings["name"]}
    if settings["name"] not in TASKS:
        return
    names = list(dict.fromkeys(TASKS[settings["name"]].imports(settings)))
    if trust:
        allow(names)
    elif names:
        wanted = ", ".join(f"{shown(name)} ({_place(name.partition(':')[0])})" for name in names[:MAX_LISTED_NAMES])
        wanted += f" and {len(names) - MAX_LISTED_NAMES:,} more" if len(names) > MAX_LISTED_NAMES else ""
        in_full = len(names) <= MAX_LISTED_NAMES and all(shown(name) == repr(name) for name in names)
        raise NotTrusted(
            f"{where} names code: making its task {settings['name']!r} imports {wanted}, which can do anything; "
            f"nothing was imported. If you trust it: {HOW}",
            names if in_full else (),
        )


def task_named(word: str) -> Task:
    """The task that a word of the user's names: its name, the id of a Gymnasium environment, or a TOML file. **Raises**
    `ValueError` for an unknown name; `NotTrusted` where the file names code that would be imported."""
    if not word.lower().endswith(".toml"):
        return make(word)
    settings = settings_in(Path(word))
    check_imports(settings, word)
    try:
        return make(**settings)
    except ValueError as error:
        raise ValueError(f"{word}: {error}") from None


def _place(module: str) -> str:
    """Where a module would be imported from. Only its outermost package is looked up, as that imports nothing."""
    package = module.partition(".")[0]
    try:
        found = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        found = None
    # in full, as the end of a path is what tells it from others
    return "not found" if found is None else f"from {(found.origin or found.name)!r}"
