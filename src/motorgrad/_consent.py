"""What the user has named: code that a file names runs only if its user named it, too, or trusts the file.

A name is allowed as a whole, such as `"module:Name-v0"`. That a module is loaded, or can be found, is no consent.
"""

from collections.abc import Iterable

HOW = "trust=True in Python, --trust on the command line, or mg.tasks.from_gymnasium with its id"

_ALLOWED: set[str] = set()


def allow(names: Iterable[str]) -> None:
    """Let code of these names run in this process."""
    _ALLOWED.update(names)


def allow_words(words: Iterable[str]) -> None:
    """Let code run that the words of a command line name: a word, or the value of an option `--name=value`."""
    for word in words:
        allow((word, word.partition("=")[2]) if word.startswith("--") else (word,))


def allowed() -> tuple[str, ...]:
    """All names that are allowed here, for a process that works for this one."""
    return tuple(sorted(_ALLOWED))


def is_allowed(name: str) -> bool:
    """Whether the user has named it in this process."""
    return name in _ALLOWED
