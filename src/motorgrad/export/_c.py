"""Programs as C: one file that needs nothing but the standard mathematical functions."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motorgrad._errors import check
from motorgrad.export._c_function import IDENTIFIER, CFunction
from motorgrad.export._c_numbers import literal, smallest, type_of
from motorgrad.export._program import Program

HELPERS = {
    "max": "static inline {type} max_{name}({type} a, {type} b) {{ return a > b{nan} ? a : b; }}",
    "min": "static inline {type} min_{name}({type} a, {type} b) {{ return a < b{nan} ? a : b; }}",
    "sign": "static inline {type} sign_{name}({type} a) {{ return a > 0 ? 1 : a < 0 ? -1 : a; }}",
    "bitcast": "static inline {type} as_{name}({other} a) {{ {type} b; memcpy(&b, &a, sizeof b); return b; }}",
}


def c_source(functions: Mapping[str, Program], name: str = "policy", about: Sequence[str] = ()) -> str:
    """The C99 source of some programs, each a function of arrays.

    The file needs no other, allocates nothing and keeps nothing between two calls, so that it fits a microcontroller.
    Numbers have the precision of the program. An array that is both an input and an output is changed in place.

    **Arguments:**

    - `functions`: by name. `NAME_FUNCTION` is the name in C.
    - `name`: what the names in C begin with.
    - `about`: lines for the comment at the top.

    **Raises:** `ValueError` for a name that C does not allow, `Untranslatable` for an operation without a C form.
    """
    for each in (name, *functions):
        check(IDENTIFIER.fullmatch(each), "name", each, "letters, digits and _, as in C")
    file = CFile()
    bodies = [file.function(f"{name}_{each}", program) for each, program in functions.items()]
    head = [*about, "Compile as C99 or later; link with -lm."]
    parts = ["/*", *(f" * {line}".rstrip() for line in head), " */", file.preamble(), *bodies]
    return "\n".join(parts)


class CFile:
    """What the functions of a file share: constant arrays, each written once, and helpers."""

    def __init__(self) -> None:
        self._tables: dict[Any, tuple[str, str]] = {}
        self._helpers: dict[str, str] = {}

    def function(self, name: str, program: Program) -> str:
        """The text of a function. Call it for all functions before `preamble`."""
        return CFunction(self, program).text(name)

    def preamble(self) -> str:
        """Includes, helpers and constants."""
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
