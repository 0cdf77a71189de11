"""One way to refuse bad input: name the thing, the value given and what is allowed."""

import difflib
from collections.abc import Iterable
from typing import Any

LONGEST = 100  # characters of a value in a message
MOST = 40  # names in a message; of more, the nearest


def check(condition: Any, name: str, value: Any, allowed: str) -> None:
    """Raise `ValueError` unless `condition` holds.

    **Arguments:** the condition; the setting's name as the user wrote it; the value given; what is allowed, in words
    that complete "must be …".
    """
    if not condition:
        raise ValueError(f"{name} = {shown(value)}: must be {allowed}")


def shown(value: Any) -> str:
    """A value for an error message: on one line, and not longer than one."""
    try:
        text = " ".join(repr(value).splitlines())
    except (ValueError, RecursionError):  # an integer of thousands of digits; lists nested as deeply
        return f"{type(value).__name__} too large to show"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"


def unknown(kind: str, name: Any, known: Iterable[str], meant: Iterable[str] = ()) -> ValueError:
    """The error for a name that is not among `known`: it lists them, first what may be `meant` or is nearest."""
    names = sorted(known)
    if len(names) > MOST:
        nearest = difflib.get_close_matches(str(name), names, n=MOST, cutoff=0)
        listed = f"{', '.join(sorted(nearest))} and {len(names) - MOST} more"
    else:
        listed = ", ".join(names) or "none"
    near = list(meant) or (difflib.get_close_matches(name, names, n=1, cutoff=0.5) if isinstance(name, str) else [])
    hint = f"did you mean {' or '.join(map(repr, near))}? " if near else ""
    return ValueError(f"unknown {kind} {shown(name)}: {hint}known are {listed}")


def choice(name: str, value: Any, allowed: Iterable[str]) -> None:
    """Raise `ValueError` unless `value` is one of `allowed`, naming the nearest."""
    allowed = tuple(allowed)
    if value not in allowed:
        raise unknown(name, value, allowed)
