"""Checks of the arguments of a public function by its own annotations, before anything is done with them.

    def still(motion: Motion, frame: int, path: Path | str | None = None) -> np.ndarray:
        check_arguments(still, locals())

Numbers of NumPy are numbers; true and false are none. A text is no sequence of texts. What an annotation says of the
contents of a sequence or an array is left to the function.
"""

import ast
import functools
import inspect
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeGuard

import numpy as np

from motorgrad._errors import check, is_integer, is_number

# what comes in many forms: the function finds out itself whether it will do
_ANYTHING = {"Any", "ArrayLike", "Body", "ColorType", "object"}


class _Kind(NamedTuple):
    """What an argument may be, in `words`, and whether a value `fits`."""

    words: str
    fits: Callable[[object], bool]


def check_arguments(function: Callable[..., Any], given: Mapping[str, Any], only: Iterable[str] | None = None) -> None:
    """Raise `ValueError`, in one line, for the first argument that is not of a kind that its annotation says.

    **Arguments:** the `function`, or a class; what it was `given`, by name: its `locals()` at first, or the fields of a
    dataclass, `vars(self)`; which to look at `only`, where a function takes more than its annotations say.
    """
    for name, kinds in _kinds_of(function).items():
        if only is not None and name not in only:
            continue
        if not any(kind.fits(given[name]) for kind in kinds):
            *others, last = (kind.words for kind in kinds)
            check(False, name, given[name], f"{', '.join(others)} or {last}" if others else last)


@functools.cache
def _kinds_of(function: Callable[..., Any]) -> dict[str, list[_Kind]]:
    """The kinds of each argument whose annotation says them."""
    found = {}
    names = vars(sys.modules[function.__module__])
    for name, parameter in inspect.signature(function).parameters.items():
        several = parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        if several or parameter.annotation is parameter.empty:
            continue
        kinds = _kinds(parameter.annotation, names)
        known = [kind for kind in kinds if kind is not None]
        if len(known) == len(kinds):
            found[name] = known
    return found


def _kinds(annotation: object, names: Mapping[str, Any]) -> list[_Kind | None]:
    """The alternatives of an annotation, which may be a text; None for one that may be anything."""
    text = annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)
    found = []
    for each in _split(text):
        head = re.split(r"[\[(]", each)[0].rpartition(".")[2]
        known = names.get(head)
        if head in _PLAIN:
            found.append(_PLAIN[head])
        elif head == "tuple" and set(inner := each.partition("[")[2][:-1].split(", ")) == {"float"}:
            found.append(_numbers(len(inner)))
        elif head == "Literal":
            found.append(_among(ast.literal_eval(each.partition("[")[2][:-1])))
        elif known is None or isinstance(known, type):
            anything = head in _ANYTHING or getattr(known, "_is_protocol", False)
            found.append(None if anything else _of_class(head))
        else:  # the name of an annotation
            found += _kinds(known, names)
    return found


def _split(text: str) -> list[str]:
    """The alternatives of an annotation in words, which `|` outside brackets and quotes separates."""
    pieces = [""]
    depth = 0
    for character in text.strip("'\""):
        depth += (character in "[(") - (character in "])")
        if character == "|" and not depth:
            pieces.append("")
        else:
            pieces[-1] += character
    return [piece.strip(" '\"") for piece in pieces]


def _of_class(name: str) -> _Kind:
    """An instance of a class by its name, as it may be imported for type checkers alone."""
    article = "an" if name.startswith(("A", "E", "I", "O", "Mj")) else "a"
    return _Kind(f"{article} {name}", lambda value: name in {each.__name__ for each in type(value).__mro__})


def _among(options: object) -> _Kind:
    """A value of the type of the options. The function says which are meant, and suggests the nearest."""
    allowed = options if isinstance(options, tuple) else (options,)
    return _Kind(" or ".join(map(repr, allowed)), lambda value: type(value) in map(type, allowed))


def _numbers(count: int) -> _Kind:
    def fits(value: object) -> bool:
        return _is_sequence(value) and len(value) == count and all(map(is_number, value))

    return _Kind(f"{count} numbers", fits)


def _is_sequence(value: object) -> TypeGuard[Collection[object]]:
    return isinstance(value, Sequence | np.ndarray | set | frozenset) and not isinstance(value, str | bytes)


def _is_array(value: object) -> bool:
    """Whether NumPy can make an array of numbers of it."""
    try:
        return np.asarray(value).dtype.kind in "biuf"
    except (TypeError, ValueError):
        return False


_ARRAY = _Kind("an array of numbers", _is_array)
_PATH = _Kind("a path", lambda value: isinstance(value, os.PathLike))
_PLAIN = {
    "Array": _ARRAY,
    "Callable": _Kind("a function", callable),
    "Float": _ARRAY,
    "Int": _ARRAY,
    "Iterable": _Kind("a sequence", lambda value: isinstance(value, Iterable) and not isinstance(value, str | bytes)),
    "Mapping": _Kind("a table", lambda value: isinstance(value, Mapping)),
    "None": _Kind("None", lambda value: value is None),
    "Path": _PATH,
    "PathLike": _PATH,
    "Sequence": _Kind("a sequence", _is_sequence),
    "bool": _Kind("True or False", lambda value: isinstance(value, bool | np.bool_)),
    "float": _Kind("a number", is_number),
    "int": _Kind("an integer", is_integer),
    "list": _Kind("a sequence", _is_sequence),
    "ndarray": _ARRAY,
    "str": _Kind("a text", lambda value: isinstance(value, str)),
    "type": _Kind("a class", lambda value: isinstance(value, type)),
}
