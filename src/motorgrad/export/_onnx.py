"""Programs as ONNX models."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from motorgrad._extras import missing
from motorgrad.export._program import Operation, Program, Untranslatable

# what runtimes of the last years read
OPSET = 18
IR = 9
NODES = {
    **{"neg": "Neg", "abs": "Abs", "sign": "Sign", "floor": "Floor", "ceil": "Ceil", "rint": "Round", "exp": "Exp"},
    **{"log": "Log", "sqrt": "Sqrt", "sin": "Sin", "cos": "Cos", "tan": "Tan", "asin": "Asin", "acos": "Acos"},
    **{"atan": "Atan", "sinh": "Sinh", "cosh": "Cosh", "tanh": "Tanh", "erf": "Erf", "not": "Not", "add": "Add"},
    **{"sub": "Sub", "mul": "Mul", "div": "Div", "pow": "Pow", "max": "Max", "min": "Min", "and": "And", "or": "Or"},
    **{"xor": "Xor", "eq": "Equal", "lt": "Less", "le": "LessOrEqual", "gt": "Greater", "ge": "GreaterOrEqual"},
    **{"select": "Where"},
}
REDUCTIONS = {"sum": "ReduceSum", "prod": "ReduceProd", "max": "ReduceMax", "min": "ReduceMin"}
ONNX_LACKS = ("erfc", "expm1", "log1p")
"""Functions that ONNX lacks: `traced` makes them of others."""


def onnx_model(
    program: Program, name: str = "policy", about: str = "", interface: Mapping[str, Any] | None = None
) -> Any:
    """A program as an ONNX model, an `onnx.ModelProto`, of this `name` and `about` this; `interface`, a table of what
    its numbers mean, is in its metadata. **Raises** `RuntimeError` without the package onnx, `Untranslatable` for an
    operation that ONNX does not have."""
    try:
        import onnx  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise missing("an ONNX model needs", "onnx", "onnx") from None
    model = _Graph(onnx, program).model(name, about)
    if interface is not None:
        onnx.helper.set_model_props(model, {"interface": json.dumps(interface)})
    return model


class _Graph:
    """The nodes of a program as they are collected."""

    def __init__(self, onnx: Any, program: Program):
        self.onnx, self.program = onnx, program
        self._nodes: list[Any] = []
        self._constants: dict[Any, tuple[str, Any]] = {}
        self._fresh = 0

    def model(self, name: str, about: str) -> Any:
        helper, operations = self.onnx.helper, self.program.operations
        names = {place: each for each, place in self.program.inputs.items()}
        for place, operation in enumerate(operations):
            if operation.kind == "constant":
                names[place] = self._constant(operation.attributes["value"])
            elif operation.kind != "input":
                names[place] = self._made(operation, [names[each] for each in operation.operands])
        for each, place in self.program.outputs.items():
            self._nodes.append(helper.make_node("Identity", [names[place]], [each]))

        def described(ports: dict[str, int]) -> list[Any]:
            return [
                helper.make_tensor_value_info(each, self._type(operations[place].dtype), operations[place].shape)
                for each, place in ports.items()
            ]

        constants = [tensor for _, tensor in self._constants.values()]
        outputs = described(self.program.outputs)
        graph = helper.make_graph(self._nodes, name, described(self.program.inputs), outputs, constants, about)
        opsets = [helper.make_opsetid("", OPSET)]
        model = helper.make_model(graph, opset_imports=opsets, ir_version=IR, producer_name="motorgrad")
        self.onnx.checker.check_model(model, full_check=True)
        return model

    def _type(self, dtype: np.dtype) -> int:
        return self.onnx.helper.np_dtype_to_tensor_dtype(dtype)

    def _constant(self, value: ArrayLike, dtype: DTypeLike | None = None) -> str:
        array = np.asarray(value, dtype)
        key = (array.dtype.str, array.shape, array.tobytes())
        if key not in self._constants:
            name = f"constant_{len(self._constants)}"
            whole = np.ascontiguousarray(array).reshape(array.shape)
            self._constants[key] = name, self.onnx.numpy_helper.from_array(whole, name)
        return self._constants[key][0]

    def _node(self, kind: str, *given: str, **attributes: object) -> str:
        self._fresh += 1
        made = f"value_{self._fresh}"
        self._nodes.append(self.onnx.helper.make_node(kind, list(given), [made], made, **attributes))
        return made

    def _cast(self, given: str, dtype: DTypeLike) -> str:
        return self._node("Cast", given, to=self._type(np.dtype(dtype)))

    def _made(self, operation: Operation, given: list[str]) -> str:
        kind, attributes, dtype = operation.kind, operation.attributes, operation.dtype
        group, _, which = kind.partition(" ")
        of = self.program.operations[operation.operands[0]].dtype
        if kind in ("reshape", "expand"):
            return self._node(kind.capitalize(), given[0], self._constant(operation.shape, np.int64))
        if kind == "take":
            return self._gathered(given[0], self._constant(attributes["index"], np.int64))
        if kind == "pick":
            return self._gathered(given[0], given[1])
        if kind == "concatenate":
            return self._node("Concat", *given, axis=attributes["axis"])
        if kind == "einsum":
            return self._node("Einsum", *given, equation=attributes["spec"])
        if kind in ("argmax", "argmin"):
            node = "ArgMax" if kind == "argmax" else "ArgMin"
            return self._cast(self._node(node, given[0], axis=attributes["axis"], keepdims=0), dtype)
        if group == "reduce":
            return self._reduced(which, given[0], attributes["axes"], dtype)
        if kind == "cumulative sum":
            return self._node("CumSum", given[0], self._constant(attributes["axis"], np.int64))
        if kind == "convert":
            return self._cast(given[0], dtype)
        if kind == "ne":
            return self._node("Not", self._node("Equal", *given))
        if kind == "is_finite":
            return self._node("Not", self._node("Or", self._node("IsInf", *given), self._node("IsNaN", *given)))
        if kind == "rem":
            return self._node("Mod", *given, fmod=1)
        if kind in ("and", "or", "xor", "not") and of.kind != "b":
            raise Untranslatable(f"{kind} of {of} numbers: not in ONNX's version {OPSET}; export as C or NumPy")
        if kind in NODES:
            return self._node(NODES[kind], *given)
        raise Untranslatable(f"{kind}: ONNX has no such node; export as C or NumPy")

    def _gathered(self, source: str, index: str) -> str:
        """Elements of the flat array."""
        return self._node("Gather", self._node("Reshape", source, self._constant([-1], np.int64)), index, axis=0)

    def _reduced(self, which: str, given: str, axes: tuple[int, ...], dtype: np.dtype) -> str:
        if which in ("any", "all"):  # of numbers: ONNX reduces no truth values
            numbers = self._reduced("max" if which == "any" else "min", self._cast(given, np.int32), axes, dtype)
            return self._cast(numbers, bool)
        return self._node(REDUCTIONS[which], given, self._constant(axes, np.int64), keepdims=0)
