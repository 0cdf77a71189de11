"""Values as words of a command line, still as text: the field that they are for says how they are read."""

import ast
import contextlib
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from motorgrad._errors import check
from motorgrad.schema._part import options_of


class Words(tuple[str, ...]):
    """The words that follow an option on the command line; none after a flag.

    `read(hint, where)` is the plain value that they stand for in a field of this type, as a file would have it.
    """

    def read(self, hint: Any, where: str) -> Any:
        """The plain value: a list for several words, a table for names and values in turn, else one value.

        **Raises** `ValueError` that names the place, for too many or too few words.
        """
        options = options_of(hint)
        mapping = next((option for option in options if _is_mapping(option)), None)
        rows = [option for option in options if typing.get_origin(option) is tuple]
        one = any(option is not types.NoneType and option not in rows and option is not mapping for option in options)
        if not self and bool in options:
            return True
        if len(self) == 1 and self[0].lower() == "none" and types.NoneType in options:
            return None
        if mapping is not None and (len(self) != 1 or not one):
            return self._pairs(where)
        if rows and (len(self) != 1 or not one):
            return self._row(typing.get_args(rows[0]), where)
        check(self, where, "nothing", "followed by a value")
        check(len(self) == 1, where, " ".join(self), "one value")
        return _value(self[0], options, where)

    def _pairs(self, where: str) -> dict[str, Any]:
        """Names and values in turn as a table."""
        turn = "names and values in turn"
        check(self, where, "nothing", turn)
        check(len(self) % 2 == 0, where, self[-1], f"{turn}: it has no value")
        return {name: _guess(value) for name, value in zip(self[::2], self[1::2], strict=True)}

    def _row(self, inner: tuple[Any, ...], where: str) -> list[Any]:
        """Words as a list; of rows of fixed length within it, so many words each."""
        items = inner[:1] if inner[1:] == (Ellipsis,) else inner
        length = len(typing.get_args(items[0])) if typing.get_origin(items[0]) is tuple else 0
        if length:
            check(len(self) % length == 0, where, " ".join(self), f"{length} values for each entry")
            options = options_of(typing.get_args(items[0])[0])
            values = [_value(word, options, where) for word in self]
            return [values[start : start + length] for start in range(0, len(values), length)]
        each = [items[0]] * len(self) if inner[1:] == (Ellipsis,) else [*items, *[items[-1]] * len(self)]
        return [_value(word, options_of(hint), where) for word, hint in zip(self, each, strict=False)]


def _is_mapping(option: Any) -> bool:
    origin = typing.get_origin(option)
    return isinstance(origin, type) and issubclass(origin, Mapping)


def _value(word: str, options: tuple[Any, ...], where: str) -> Any:
    """One word as a value of one of these types; the word itself where none of them reads it."""
    if types.NoneType in options and word.lower() == "none":
        return None
    for option in options:
        for choice in typing.get_args(option) if typing.get_origin(option) is typing.Literal else ():
            if str(choice) == word:
                return choice
    if bool in options and word.lower() in ("true", "false"):
        return word.lower() == "true"
    if str in options or Path in options:
        return word
    plain = word.replace(",", "")
    if int in options and plain != word and plain.isdecimal():
        check(False, where, word, f"an integer: write {plain}")
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(word)
    return word


def _guess(word: str) -> Any:
    """True, 3, 0.5, or else the word itself, where a table may have any of them."""
    try:
        value = ast.literal_eval(word.strip())
    except (ValueError, SyntaxError):
        return word
    return value if isinstance(value, bool | int | float) else word
