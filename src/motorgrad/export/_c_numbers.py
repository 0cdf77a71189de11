"""Types and numbers in C, and what the functions of a file share."""

from typing import Any

import numpy as np

from motorgrad.export._program import Untranslatable

TYPES = {
    "f4": "float",
    "f8": "double",
    "i4": "int32_t",
    "u4": "uint32_t",
    "i8": "int64_t",
    "u8": "uint64_t",
    "b1": "bool",
}

HELPERS = {
    "max": "static inline {type} max_{name}({type} a, {type} b) {{ return a > b{nan} ? a : b; }}",
    "min": "static inline {type} min_{name}({type} a, {type} b) {{ return a < b{nan} ? a : b; }}",
    "sign": "static inline {type} sign_{name}({type} a) {{ return a > 0 ? 1 : a < 0 ? -1 : a; }}",
    "bitcast": "static inline {type} as_{name}({other} a) {{ {type} b; memcpy(&b, &a, sizeof b); return b; }}",
}


def literal(number: np.number | np.bool_ | int) -> str:
    """A number in C, without loss."""
    dtype = np.dtype(type(number))
    if dtype.kind == "b":
        return "true" if number else "false"
    if dtype.kind in "iu":
        if dtype.kind == "i" and number == np.iinfo(dtype.str).min:
            return f"INT{dtype.itemsize * 8}_MIN"
        return f"{int(number)}" + {"u4": "u", "u8": "ull", "i8": "ll"}.get(dtype.str[1:], "")
    if np.isnan(number):
        return "NAN"
    if np.isinf(number):
        return "INFINITY" if number > 0 else "(-INFINITY)"
    text = f"{float(number):.{9 if dtype.itemsize == 4 else 17}g}"
    text = text if any(sign in text for sign in ".e") else f"{text}.0"
    text += "f" * (dtype.itemsize == 4)
    return f"({text})" if text.startswith("-") else text


def limit(dtype: np.dtype, which: str) -> str:
    """What every number is above, or below."""
    if dtype.kind == "f":
        return "(-INFINITY)" if which == "max" else "INFINITY"
    return literal(np.iinfo(dtype).min if which == "max" else np.iinfo(dtype).max) if dtype.kind != "b" else "false"


def smallest(array: np.ndarray) -> np.dtype:
    """The smallest type of integers that holds a table of places or numbers."""
    low, high = (int(array.min()), int(array.max())) if array.size else (0, 0)
    return next(
        np.dtype(kind) for kind in ("i1", "i2", "i4") if np.iinfo(kind).min <= low and high <= np.iinfo(kind).max
    )


def type_of(dtype: np.dtype) -> str:
    """The type of numbers in C. **Raises** `Untranslatable` for one without a form."""
    small = {"i1": "int8_t", "i2": "int16_t", "u1": "uint8_t", "u2": "uint16_t"}
    found = ({**TYPES, **small}).get(dtype.str[1:])
    if found is None:
        raise Untranslatable(f"{dtype}: has no form in C; known are {', '.join(TYPES)}")
    return found


class CFile:
    """What the functions of a file share: constant arrays, each written once, and helpers."""

    def __init__(self) -> None:
        self._tables: dict[Any, tuple[str, str]] = {}
        self._helpers: dict[str, str] = {}

    def preamble(self) -> str:
        """Includes, helpers and constants. Call it after the text of all functions."""
        includes = ["math", "stdbool", "stdint", "string"]
        lines = [f"#include <{each}.h>" for each in includes]
        return "\n".join([*lines, "", *self._helpers.values(), *(text for _, text in self._tables.values()), ""])

    def table(self, array: np.ndarray) -> str:
        """The name of a constant array."""
        kind = array.dtype if array.dtype.kind != "i" or array.dtype.itemsize > 4 else smallest(array)
        key = (kind.str, array.tobytes(), array.dtype.str)
        if key not in self._tables:
            name = f"k{len(self._tables)}"
            numbers = [literal(number) for number in array.ravel()]
            rows = [", ".join(numbers[start : start + 8]) for start in range(0, len(numbers), 8)]
            text = f"static const {type_of(kind)} {name}[{array.size}] = {{\n    " + ",\n    ".join(rows) + "};"
            self._tables[key] = name, text
        return self._tables[key][0]

    def helper(self, kind: str, dtype: np.dtype, other: np.dtype | None = None) -> str:
        """The name of a helper for numbers of this type."""
        made = f"{'as' if kind == 'bitcast' else kind}_{type_of(dtype)}"
        source = "" if other is None else type_of(other)
        self._helpers[made] = HELPERS[kind].format(
            type=type_of(dtype), name=type_of(dtype), other=source, nan=" || a != a" * (dtype.kind == "f")
        )
        return made
