"""How words of the command line are read where tyro's own way is too narrow, or hard to read in the help."""

import ast
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from motorgrad._settings import as_hinted

PLAIN: dict[object, str] = {int: "INT", float: "FLOAT", str: "STR", Path: "PATH"}
REGISTRY = ConstructorRegistry()
"""Reads `1e5` as the integer that it is."""


@REGISTRY.primitive_rule
def _integers(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[int] | None:
    if info.type is not int:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="INT",
        instance_from_str=lambda words: _whole(words[0]),
        is_instance=lambda value: isinstance(value, int) and not isinstance(value, bool),
        str_from_instance=lambda value: [str(value)],
    )


def shown_as(hint: object, default: object) -> str | None:
    """What the help shows for a value; `None` to use tyro's own text.

    A default of `None` is not among the values shown, as it is what leaving out the option gives.
    """
    for about in getattr(hint, "__metadata__", ()):
        if getattr(about, "metavar", None):
            return about.metavar
    options = _options(hint)
    for option in options:
        if typing.get_origin(option) is tuple and typing.get_args(option)[1:] == (Ellipsis,):
            kind = typing.get_args(option)[0]
            return f"{PLAIN[kind]} ..." if kind in PLAIN else None
    if default is not None or type(None) not in options or any(map(_is_table, options)):
        return None
    given = [_word(option) for option in options if option is not type(None)]
    return "|".join(given) if all(given) else None  # type: ignore[arg-type]


def _word(option: object) -> str | None:
    """What the help shows for a value of one word."""
    if typing.get_origin(option) is typing.Literal:
        return "{" + ",".join(map(str, typing.get_args(option))) + "}"
    return PLAIN.get(option)


def reader(hint: object) -> tuple[Any, ...]:
    """How names and values in turn are read as a table; nothing for any other kind of value."""
    options = _options(hint)
    tables = [option for option in options if _is_table(option)]
    if not tables:
        return ()
    single = float in options
    spec: PrimitiveConstructorSpec[Any] = PrimitiveConstructorSpec(
        nargs="*",
        metavar="FLOAT | NAME VALUE ..." if single else "NAME VALUE ...",
        instance_from_str=lambda words: _table(tables[0], type(None) in options, single, words),
        is_instance=lambda value: value is None or isinstance(value, Mapping | float),
        str_from_instance=_words,
    )
    return (spec,)


def _options(hint: object) -> tuple[Any, ...]:
    """The types that a value may have."""
    hint = typing.get_args(hint)[0] if typing.get_origin(hint) is typing.Annotated else hint
    return typing.get_args(hint) if typing.get_origin(hint) in (typing.Union, types.UnionType) else (hint,)


def _is_table(option: object) -> bool:
    origin = typing.get_origin(option)
    return isinstance(origin, type) and issubclass(origin, Mapping)


def _whole(word: str) -> int:
    try:
        return as_hinted(int, _number(word), "")
    except ValueError:
        plain = word.replace(",", "")
        hint = f": write {plain}" if plain != word and plain.isdecimal() else ""
        raise ValueError(f"{word!r} is not an integer{hint}") from None


def _number(word: str) -> int | float:
    try:
        return int(word)
    except ValueError:
        return float(word)


def _words(table: Mapping[str, Any] | float | None) -> list[str]:
    if not isinstance(table, Mapping):
        return [str(table)]
    return [str(word) for pair in table.items() for word in pair]


def _table(hint: object, optional: bool, single: bool, words: list[str]) -> Any:
    if optional and words in (["None"], ["none"]):
        return None
    if single and len(words) == 1:
        try:
            return as_hinted(float, _value(words[0]), "")
        except ValueError:
            raise ValueError(f"{words[0]!r} must be a finite number, or names and numbers in turn") from None
    if not words or len(words) % 2:
        last = f"{words[-1]!r} has no value" if words else "nothing is given"
        raise ValueError(f"{last}; must be names and values in turn")
    return as_hinted(hint, {name: _value(value) for name, value in zip(words[::2], words[1::2], strict=True)}, "")


def _value(word: str) -> Any:
    """True, 3, 0.5, or else the word itself."""
    try:
        value = ast.literal_eval(word.strip())
    except (ValueError, SyntaxError):
        return word
    return value if isinstance(value, bool | int | float) else word
