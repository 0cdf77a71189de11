"""Programs for NumPy: arrays and a list of calls in one .npz file, which `_reader.py` reads."""

import io
import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from motorgrad.export._program import Operation, Program, Untranslatable
from motorgrad.export._reader import ELEMENTWISE

NUMPY_NAMES = {
    **{"neg": "negative", "sub": "subtract", "mul": "multiply", "div": "divide", "rem": "fmod", "pow": "power"},
    **{"max": "maximum", "min": "minimum", "asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2"},
    **{"and": "bitwise_and", "or": "bitwise_or", "xor": "bitwise_xor", "not": "bitwise_not", "is_finite": "isfinite"},
    **{"eq": "equal", "ne": "not_equal", "lt": "less", "le": "less_equal", "gt": "greater", "ge": "greater_equal"},
    **{"select": "where", "convert": "asarray", "expand": "broadcast_to"},
    **{"shift_left": "left_shift", "shift_right_arithmetic": "right_shift"},
}
NUMPY_LACKS = ("erf", "erfc")
"""Functions that NumPy lacks: `traced` makes them of others."""
REDUCTIONS = ("sum", "prod", "max", "min", "any", "all")


def numpy_file(functions: Mapping[str, Program], interface: Mapping[str, Any] | None = None) -> bytes:
    """The content of an .npz file with some programs, for `read`; with it, as a table, what their numbers mean.
    **Raises** `Untranslatable` for an operation that NumPy does not have."""
    arrays: dict[str, np.ndarray] = {}
    tables: dict[tuple[str, bytes, tuple[int, ...]], str] = {}

    def array(value: np.ndarray) -> str:
        key = (value.dtype.str, value.tobytes(), value.shape)
        tables.setdefault(key, f"array{len(tables)}")
        arrays[tables[key]] = value
        return tables[key]

    serialised = {name: _serialised(program, array) for name, program in functions.items()}
    file = io.BytesIO()
    texts = {"functions": serialised} | ({} if interface is None else {"interface": interface})
    texts = {name: np.asarray(json.dumps(text)) for name, text in texts.items()}
    np.savez_compressed(file, **texts, **arrays)  # pyright: ignore[reportArgumentType]
    return file.getvalue()


def _serialised(program: Program, array: Callable[[np.ndarray], str]) -> list[Any]:
    """A program as the reader has it: inputs, calls and outputs."""
    names = {}
    steps = []
    for place, operation in enumerate(program.operations):
        names[place] = f"v{place}"
        if operation.kind == "constant":
            value = operation.attributes["value"]
            names[place] = array(value) if value.ndim else value.item()
        elif operation.kind != "input":
            function, arguments = _call(operation, [names[each] for each in operation.operands], array)
            steps.append([names[place], function, arguments, operation.dtype.name])
    inputs = {
        name: [names[place], program.operations[place].shape, program.operations[place].dtype.name]
        for name, place in program.inputs.items()
    }
    outputs = {name: names[place] for name, place in program.outputs.items()}
    for name, place in outputs.items():
        if not isinstance(place, str):
            outputs[name] = array(np.asarray(place, program.operations[program.outputs[name]].dtype))
    return [inputs, steps, outputs]


def _call(operation: Operation, given: list[Any], array: Callable[[np.ndarray], str]) -> tuple[str, list[Any]]:
    """The name of NumPy's function, and its arguments."""
    kind, attributes = operation.kind, operation.attributes
    group, _, which = kind.partition(" ")
    if kind in ("reshape", "expand"):
        return NUMPY_NAMES.get(kind, kind), [*given, list(operation.shape)]
    if kind == "take":
        return "take", [*given, array(attributes["index"])]
    if kind == "concatenate":
        return "concatenate", [given, attributes["axis"]]
    if kind == "einsum":
        return "einsum", [attributes["spec"], *given]
    if kind in ("argmax", "argmin"):
        return kind, [*given, attributes["axis"]]
    if group == "reduce" and which in REDUCTIONS:
        return which, [*given, list(attributes["axes"])]
    if group == "cumulative" and which in ("sum", "prod"):
        return f"cum{which}", [*given, attributes["axis"]]
    if NUMPY_NAMES.get(kind, kind) in ELEMENTWISE:
        return NUMPY_NAMES.get(kind, kind), given
    if kind == "pick":
        return "take", given
    raise Untranslatable(f"{kind}: NumPy has no such function; export as C")
