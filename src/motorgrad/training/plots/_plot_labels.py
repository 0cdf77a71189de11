"""Labels that distinguish several runs."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

MAX_LABEL_SETTINGS = 3  # beyond that the folders say more
MAX_VALUE_CHARACTERS = 24


def labels_of(configs: Sequence[Mapping[str, Any]], paths: Sequence[Path | None]) -> list[str]:
    """A different label for each run: the settings in which they differ, where that is enough; else their folders, of
    which a single run has the name. Paths are shortened to the ends that distinguish them."""
    folders = _folders(configs, paths)
    if len(configs) == 1:
        return folders
    settings = [_flat(config) for config in configs]
    keys = _differing(settings)
    if not keys or len(keys) > MAX_LABEL_SETTINGS:
        return folders
    texts = [", ".join(_setting_text(key, keys, each[key]) for key in keys if key in each) for each in settings]
    if len(set(texts)) == len(texts) and all(texts):
        return texts
    return [f"{folder} ({text})" if text else folder for folder, text in zip(folders, texts, strict=True)]


def folders_of(paths: Sequence[Path]) -> list[str]:
    """The shortest end of each path that distinguishes it from the others; equal paths are numbered."""
    parts = [Path(os.path.abspath(path)).parts[1:] for path in paths]

    def end(mine: tuple[str, ...]) -> str:
        for length in range(1, len(mine)):
            if sum(other[-length:] == mine[-length:] for other in parts) == 1:
                return "/".join(mine[-length:])
        return "/".join(mine)

    return _numbered([end(mine) for mine in parts])


def _folders(configs: Sequence[Mapping[str, Any]], paths: Sequence[Path | None]) -> list[str]:
    known = iter(folders_of([path for path in paths if path is not None]))
    names = [
        next(known) if path is not None else str(config["task"]["name"])
        for config, path in zip(configs, paths, strict=True)
    ]
    return _numbered(names)


def _numbered(names: list[str]) -> list[str]:
    """The names, numbered where they occur more than once."""
    return [
        name if names.count(name) == 1 else f"{name} {names[: place + 1].count(name)}"
        for place, name in enumerate(names)
    ]


def _flat(config: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of task and learner by their dotted names, without the fingerprint of the initial learner."""

    def walk(value: object, where: str) -> Iterator[tuple[str, Any]]:
        if isinstance(value, Mapping):
            for name, inner in value.items():
                yield from walk(inner, f"{where}.{name}")
        else:
            yield where, value

    found = [pair for part in ("task", "agent") for pair in walk(config[part], part)]
    return {name: value for name, value in found if name != "agent.initial"}


def _differing(settings: Sequence[Mapping[str, Any]]) -> list[str]:
    """The settings whose values differ among runs with the same kinds of parts around them: runs of two tasks differ in
    the task's name, but not in every setting of the tasks, and learners in the kind of their trace, but not in its
    settings."""
    differing = []
    for key in dict.fromkeys(key for each in settings for key in each):
        groups: dict[tuple[Any, ...], set[str]] = {}
        for each in settings:
            groups.setdefault(_kinds(key, each), set()).add(repr(each.get(key)))
        if any(len(values) > 1 for values in groups.values()):
            differing.append(key)
    return differing


def _kinds(key: str, settings: Mapping[str, Any]) -> tuple[Any, ...]:
    """The kinds of the tables that contain a setting."""
    parts = key.split(".")
    depth = len(parts) - 1 if _is_kind(key) else len(parts)
    places = [".".join(parts[:length]) for length in range(1, depth)]
    task = None if key == "task.name" else settings["task.name"]
    return (task, *(settings.get(f"{place}.kind") for place in places))


def _is_kind(key: str) -> bool:
    return key == "task.name" or key.endswith(".kind")


def _setting_text(key: str, keys: Sequence[str], value: object) -> str:
    """A setting as text: `penalty 0.3`; for a kind, its name. Equal names are preceded by that of their table."""
    text = str(value) if len(str(value)) <= MAX_VALUE_CHARACTERS else f"{str(value)[: MAX_VALUE_CHARACTERS - 1]}…"
    if _is_kind(key):
        return text.rpartition(".")[2]
    *tables, name = key.split(".")
    if sum(other.split(".")[-1] == name for other in keys) > 1:
        name = f"{tables[-1]} {name}"
    return f"{name.replace('_', ' ')} {text}"
