"""The words of a command line as a table of settings, whose values are still words."""

import types
import typing
from collections.abc import Sequence
from typing import Any

from motorgrad._errors import check, unknown
from motorgrad.schema import Words, declared_by, fields_of, hints_of, options_of

HELP = {"-h", "--help"}
HELP_ALL = "--help-all"


def positional_of(cls: type) -> dict[str, str]:
    """The fields of a command that are words without a name, in order, with what the help shows for them."""
    declared = {name: declared_by(field).positional for name, field in fields_of(cls).items()}
    return {name: shown for name, shown in declared.items() if shown}


def flag_of(path: str) -> str:
    """The option that names the setting at a path: `--agent.learning-rate`."""
    return f"--{path.replace('_', '-')}"


def is_flag(word: str) -> bool:
    """Whether a word names an option; `-0.5` and `-` are values."""
    return word.startswith("--") and len(word) > 2


def read_line(cls: type, words: Sequence[str]) -> dict[str, Any]:
    """The words of a command line by field of the command `cls`, as `Words`.

    An option takes as many words as its field needs: none for a flag, all up to the next option for a list, else one.
    A setting within another, such as `--task.body.load-mass`, takes all, and stands under its whole path.

    **Raises** `ValueError` for an option that is given twice, and for a word that belongs to none.
    """
    fields = fields_of(cls)
    hints = hints_of(cls)
    found: dict[str, Any] = {}
    loose = []
    left = [word for word in words if word not in {*HELP, HELP_ALL}]
    while left:
        word = left.pop(0)
        if not is_flag(word):
            loose.append(word)
            continue
        flag, equals, value = word.partition("=")
        path = flag[2:].replace("-", "_")
        outer, dot, name = path.rpartition(".")
        # without a value, as another setting may begin with "no"
        off = name.startswith("no_") and not equals and (bool(dot) or (path not in fields and name[3:] in fields))
        if off and (not dot or not left or is_flag(left[0])):
            path = f"{outer}{dot}{name[3:]}"
            taken = ["false"]
        else:
            taken = [value] if equals else _taken(left, _room(hints.get(path)))
        check(path not in found, flag, " ".join(taken), "given once")
        found[path] = Words(taken)
    return {**found, **_placed(cls, loose, hints)}


def _room(hint: Any) -> int | None:
    """How many words an option with a field of this type takes: none, one, or, as `None`, all that there are."""
    if hint is None:
        return None
    options = options_of(hint)
    if bool in options and set(options) <= {bool, types.NoneType}:
        return 0
    return None if any(typing.get_origin(option) is tuple for option in options) else 1


def _taken(left: list[str], room: int | None) -> list[str]:
    """The next words that an option takes, out of those that are left."""
    end = next((place for place, word in enumerate(left) if is_flag(word)), len(left))
    end = end if room is None else min(room, end)
    taken = left[:end]
    del left[:end]
    return taken


def _placed(cls: type, loose: list[str], hints: dict[str, Any]) -> dict[str, Words]:
    """The words without a name by field: one for each, and the rest for one that takes many."""
    found = {}
    names = list(positional_of(cls))
    for name in names:
        room = _room(hints[name])
        taken = loose if room is None else loose[:room]
        loose = loose[len(taken) :]
        if taken:
            found[name] = Words(taken)
    if loose:
        raise unknown("word", loose[0], [flag_of(name) for name in fields_of(cls)])
    return found


def nested(line: dict[str, Any]) -> dict[str, Any]:
    """The table with paths as tables within tables."""
    found: dict[str, Any] = {}
    for path, words in line.items():
        *outer, last = path.split(".")
        node = found
        for name in outer:
            node = node.setdefault(name, {})
        node[last] = words
    return found
