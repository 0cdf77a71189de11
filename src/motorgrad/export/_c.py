"""Programs as C: one file that needs nothing but the standard mathematical functions."""

from collections.abc import Mapping, Sequence

from motorgrad._errors import check
from motorgrad.export._c_function import IDENTIFIER, CFunction
from motorgrad.export._c_numbers import CFile
from motorgrad.export._program import Program


def c_source(functions: Mapping[str, Program], name: str = "policy", about: Sequence[str] = ()) -> str:
    """The C99 source of some programs, each a function of arrays, `NAME_FUNCTION` in C.

    The file needs no other, allocates nothing and keeps nothing between two calls, so that it fits a microcontroller.
    Numbers have the precision of the program. An array that is both an input and an output is changed in place. `about`
    are lines for the comment at the top.

    **Raises:** `ValueError` for a name that C does not allow, `Untranslatable` for an operation without a C form.
    """
    for each in (name, *functions):
        check(IDENTIFIER.fullmatch(each), "name", each, "letters, digits and _, as in C")
    file = CFile()
    bodies = [CFunction(file, program).text(f"{name}_{each}") for each, program in functions.items()]
    head = [*about, "Compile as C99 or later; link with -lm."]
    parts = ["/*", *(f" * {line}".rstrip() for line in head), " */", file.preamble(), *bodies]
    return "\n".join(parts)
