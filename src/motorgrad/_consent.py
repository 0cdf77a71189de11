"""What the user has named: code that a file names runs only if its user named it, too, or trusts the file.

A name is allowed as a whole, such as `"module:Name-v0"`. That a module is loaded, or can be found, is no consent.
"""

import os
from collections.abc import Iterable

HOW = "trust=True in Python, --trust on the command line, or mg.tasks.from_gymnasium with its id"

_ALLOWED: set[str] = set()


def allow(names: Iterable[str]) -> None:
    """Let code of these names run in this process."""
    _ALLOWED.update(names)


def allow_words(words: Iterable[str]) -> None:
    """Let code run that the words of a command line name: a word, or the value of an option `--name=value`. A word that
    is a path names a file, and no code, whatever a stranger has called it."""
    for word in words:
        said = (word, word.partition("=")[2]) if word.startswith("--") else (word,)
        allow(name for name in said if not os.path.lexists(name))


def allowed() -> tuple[str, ...]:
    """All names that are allowed here, for a process that works for this one."""
    return tuple(sorted(_ALLOWED))


def is_allowed(name: str) -> bool:
    """Whether the user has named it in this process."""
    return name in _ALLOWED
