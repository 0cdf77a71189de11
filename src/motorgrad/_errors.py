"""Checks of arguments. Every message names the argument, the value given and what is allowed."""

import difflib
import math
import numbers
import os
import unicodedata
from collections.abc import Iterable
from typing import TypeGuard

MAX_VALUE_CHARACTERS = 100  # in a message
MAX_PATH_CHARACTERS = 1000  # of a path that a message shows whole
MAX_LISTED_NAMES = 40  # of more, only the nearest are listed
OWN = "import the module that registers your own first, as motorgrad --import MODULE COMMAND"


class NotTrusted(RuntimeError):
    """A file names code that would run, and the user has not trusted it. `names` are those that would allow it
    (`motorgrad._consent`), where the message shows all that they stand for."""

    def __init__(self, message: str, names: Iterable[str] = ()):
        super().__init__(message)
        self.names = tuple(names)


def check(condition: object, name: str, value: object, allowed: str) -> None:
    """Raise `ValueError` unless `condition` holds: the argument's `name` as the user wrote it, the `value` given, and
    what is `allowed`, in words that complete "must be …"."""
    if not condition:
        raise ValueError(f"{name} = {shown(value)}: must be {allowed}")


def check_integer(name: str, value: object, least: int, most: int | None = None, unit: str = "") -> None:
    """Raise `ValueError` unless `value` is an integer from `least` to `most`. `unit` is appended to the message."""
    bounds = f">= {least}" if most is None else f"from {least} to {most:,}"
    right = is_integer(value) and value >= least and (most is None or value <= most)
    check(right, name, value, f"an integer {bounds} {unit}".rstrip())


def check_finite(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` is a finite number."""
    check(is_number(value) and math.isfinite(value), name, value, "a finite number")


def check_positive(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` is a finite number above 0."""
    check(is_number(value) and 0.0 < value < math.inf, name, value, "a finite number > 0")


def check_not_negative(name: str, value: object) -> None:
    """Raise `ValueError` unless `value` is a finite number of at least 0."""
    check(is_number(value) and 0.0 <= value < math.inf, name, value, "a finite number >= 0")


def counted(number: int, noun: str) -> str:
    """A number with its noun, such as "1 seed" and "2,000 seeds". The plural of the noun ends in s."""
    return f"{number:,} {noun}{'s' * (number != 1)}"


def shown(value: object) -> str:
    """A value as one line of limited length, for an error message."""
    try:
        text = " ".join(repr(value).splitlines())
    except (ValueError, RecursionError):  # an integer of thousands of digits; deeply nested lists
        return f"{type(value).__name__} too large to show"
    return text if len(text) <= MAX_VALUE_CHARACTERS else f"{text[: MAX_VALUE_CHARACTERS - 1]}…"


def shown_path(path: os.PathLike[str] | str) -> str:
    """A path for an error message: whole, as its end says which file is meant, unless that fills a screen."""
    text = str(path)
    return repr(text) if len(text) <= MAX_PATH_CHARACTERS else shown(text)


def plain(text: object) -> str:
    """A text as one line for a terminal: characters that would steer it, or turn letters around, are shown as codes."""
    line = " ".join(str(text).splitlines())
    if line.isprintable():
        return line
    return "".join(c if c.isprintable() or unicodedata.category(c) == "Zs" else ascii(c)[1:-1] for c in line)


def unknown(
    kind: str, name: object, known: Iterable[str], meant: Iterable[str] = (), *, registered: bool = False
) -> ValueError:
    """The error for a name that is not among `known`. It suggests `meant`, or else the nearest known name, and where
    users may have `registered` names of their own, it says how."""
    names = sorted(known)
    if len(names) > MAX_LISTED_NAMES:
        nearest = difflib.get_close_matches(str(name), names, n=MAX_LISTED_NAMES, cutoff=0)
        listed = f"{', '.join(sorted(nearest))} and {len(names) - MAX_LISTED_NAMES} more"
    else:
        listed = ", ".join(names) or "none"
    near = list(meant) or (difflib.get_close_matches(name, names, n=1, cutoff=0.5) if isinstance(name, str) else [])
    hint = f"did you mean {' or '.join(map(repr, near))}? " if near else ""
    own = f"; {OWN}" if registered else ""
    return ValueError(f"unknown {kind} {shown(name)}: {hint}known are {listed}{own}")


def choice(name: str, value: object, allowed: Iterable[str], *, registered: bool = False) -> None:
    """Raise `ValueError` unless `value` is one of `allowed`, as `unknown` makes it."""
    allowed = tuple(allowed)
    if value not in allowed:
        raise unknown(name, value, allowed, registered=registered)


def is_integer(value: object) -> TypeGuard[int]:
    """Whether a value is a whole number of Python or NumPy. True and false are none."""
    return isinstance(value, numbers.Integral) and not isinstance(value, bool)


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is a real number of Python or NumPy. True and false are none."""
    return isinstance(value, numbers.Real) and not isinstance(value, bool)
