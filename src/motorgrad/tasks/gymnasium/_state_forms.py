"""The forms in which the state of an environment is written, and what is refused before any of it is read.

A value is plain, or `{form: content}`. A stranger may have written it, so form, types, shapes and depth are checked as
a whole before anything is assigned.
"""

import base64
import math
import types
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from motorgrad._errors import check, check_integer

PLAIN = (bool, int, float, str, types.NoneType)
Stored = bool | int | float | str | None | dict[str, Any]
"""A plain value, or `{form: content}`."""
NUMBERS = "biufcSU"  # the kinds of arrays that are data
TWISTER = 624  # words of a Mersenne Twister
PHILOX = 4  # numbers that Philox draws at a time
MAX_DEPTH = 200  # of the containers in a state, below the limit of Python's own recursion


class _Form(NamedTuple):
    """A form of a stored value: the type of its content, and the entries beside it."""

    content: type | tuple[type, ...]
    more: tuple[str, ...] = ()


FORMS = {
    "scalar": _Form(list),
    "enum": _Form(str),
    "bytes": _Form(str),
    "fixed": _Form(str),
    "tuple": _Form(list),
    "met": _Form(int),
    "array": _Form(list),
    "shared": _Form(list),
    "view": _Form(list, ("of",)),
    "list": _Form(list),
    "deque": _Form(list, ("most",)),
    "set": _Form(list),
    "frozenset": _Form(list),
    "dict": _Form(list),
    "generator": _Form((dict, list)),
    "physics": _Form(dict),
    "object": _Form(str, ("fields",)),
}
"""All that a writer writes beside plain values."""


def packed(array: np.ndarray) -> list[Any]:
    """An array as type, order, shape and content."""
    order = "F" if array.flags.f_contiguous and not array.flags.c_contiguous else "C"
    return [array.dtype.str, order, array.shape, base64.b64encode(array.tobytes(order)).decode()]


def unpacked(content: list[Any]) -> np.ndarray:
    """The inverse of `packed`. **Raises** `ValueError` for a type that is no number or text, and another shape."""
    kind, order, shape, text = content
    dtype = number_type(kind)
    values = np.frombuffer(base64.b64decode(text, validate=True), dtype)
    # before memory is taken for a shape that nobody has written
    check(math.prod(shape) == values.size, "shape", shape, f"of the {values.size:,} numbers that are there")
    return np.array(values.reshape(shape, order=order), order=order)


def number_type(kind: str) -> np.dtype:
    """A type of numbers or text. Of any other, such as objects, the bytes would be addresses."""
    dtype = np.dtype(kind)
    check(dtype.kind in NUMBERS and dtype.fields is None, "dtype", kind, "one of numbers or text")
    return dtype


def check_random_state(state: Mapping[str, Any]) -> None:
    """Refuse the state of a generator of NumPy to which none comes: C code follows its positions unchecked, and what
    draws nothing but zeros may draw for ever."""
    check(isinstance(state, dict), "state of a generator", type(state).__name__, "a table")
    inner = state["state"]
    if "pos" in inner:
        check_integer("pos", inner["pos"], 0, TWISTER)
        check_twister(inner["key"])
    if "buffer_pos" in state:
        check_integer("buffer_pos", state["buffer_pos"], 0, PHILOX)
    if "inc" in inner:
        check(inner["inc"] % 2 == 1, "inc", inner["inc"], "odd")


def check_twister(key: npt.ArrayLike) -> None:
    """Refuse the words of a Mersenne Twister that stay zero for ever. Of the first, one bit alone counts."""
    words = np.asarray(key, np.uint32)
    check(words.shape == (TWISTER,), "key", words.shape, f"of {TWISTER} words")
    check(words[0] >= 2**31 or words[1:].any(), "key", "zeros", "words of which some bit is set")


def check_form(stored: object, depth: int = 0) -> None:
    """Refuse what no writer writes, before anything is read: other forms, other contents, and what is nested too deep.

    A form is `{name: content}`, some with one more entry (`FORMS`).
    """
    if type(stored) in PLAIN:
        return
    check(depth < MAX_DEPTH, "depth of the state", depth, f"less than {MAX_DEPTH}")
    check(isinstance(stored, dict) and stored, "form", type(stored).__name__, "a table with one form")
    assert isinstance(stored, dict)
    form = next(iter(stored))
    check(form in FORMS, "form", form, "a known one")
    content = stored[form]
    rest = [name for name in stored if name != form]
    check(rest == list(FORMS[form].more), form, rest, f"with {FORMS[form].more} beside it")
    check(isinstance(content, FORMS[form].content), form, type(content).__name__, "of its type")
    inner: list[Any] = []
    if form in ("tuple", "list", "deque", "set", "frozenset"):
        inner = content
    elif form == "dict":
        check(all(isinstance(pair, list) and len(pair) == 2 for pair in content), form, content, "pairs")
        inner = [item for pair in content for item in pair]
    elif form == "generator":
        inner = [content]
    elif form in ("scalar", "array", "shared"):
        _check_packed(content)
    elif form == "physics":
        for each in content.values():
            _check_packed(each)
    elif form == "view":
        check(len(content) == 4 and _are_counts(content[2]), form, content, "type, start, shape and strides")
        check(type(content[1]) is int and content[1] >= 0, "start", content[1], "a number of bytes")
        check(
            isinstance(content[3], list) and len(content[3]) == len(content[2]), "strides", content[3], "of its shape"
        )
        number_type(content[0])
        inner = [stored["of"]]
    elif form == "object":
        check(isinstance(stored["fields"], dict), "fields", stored["fields"], "a table")
        inner = list(stored["fields"].values())
    elif form == "met":
        check(content >= 0, form, content, "the number of one before")
    if form == "deque":
        check(stored["most"] is None or type(stored["most"]) is int, "most", stored["most"], "a number or none")
    for item in inner:
        check_form(item, depth + 1)


def _check_packed(content: object) -> None:
    """Refuse what is no array as `packed` writes one."""
    check(isinstance(content, list) and len(content) == 4, "array", content, "type, order, shape and content")
    assert isinstance(content, list)
    kind, order, shape, text = content
    number_type(kind)
    valid = order in ("C", "F") and _are_counts(shape) and isinstance(text, str)
    check(valid, "array", [kind, order, shape], "with an order, a shape and a text")


def _are_counts(shape: object) -> bool:
    return isinstance(shape, list) and all(type(count) is int and 0 <= count < 2**40 for count in shape)
