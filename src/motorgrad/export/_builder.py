"""A function of JAX as plain operations, as they are collected by one rule for each operation of JAX."""

from collections.abc import Callable, Collection, Hashable, Sequence
from typing import Any, Protocol

import jax
import numpy as np
from jax.extend.core import Jaxpr, JaxprEqn, Literal, Var
from jaxtyping import Array
from numpy.typing import ArrayLike, DTypeLike

from motorgrad.export._program import Operation, Untranslatable

Rule = Callable[["Builder", list[int], JaxprEqn], int | list[int]]
"""From the builder, the places of the operands and the equation to the places of what it makes."""
RULES: dict[str, Rule] = {}
KEPT = ("broadcast_in_dim", "iota", "while", "scan", "cond")
"""Operations that are not computed now, though their operands are known."""


def rule(*names: str) -> Callable[[Rule], Rule]:
    """Declare the rule of operations."""

    def declared(function: Rule) -> Rule:
        RULES.update(dict.fromkeys(names, function))
        return function

    return declared


class Shaped(Protocol):
    """An array, or what stands for one."""

    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def dtype(self) -> np.dtype: ...


def aval_of(atom: Var | Literal) -> Any:
    """The shape and the type of an array in a function of JAX."""
    return atom.aval


class Builder:
    """Operations as they are collected. Equal ones are the same operation."""

    def __init__(self, lacks: Collection[str] = ()) -> None:
        self.lacks = lacks
        self.operations: list[Operation] = []
        self._places: dict[Any, int] = {}

    def given(self, name: str, like: Shaped) -> int:
        """An input."""
        dtype = np.dtype(jax.dtypes.canonicalize_dtype(like.dtype))
        return self.add("input", (), tuple(like.shape), dtype, name=name)

    def constant(self, value: ArrayLike) -> int:
        """A known array; one whose elements are all the same is a number, repeated."""
        array = np.asarray(value)
        if array.size > 1 and array.tobytes() == np.broadcast_to(array.flat[0], array.shape).tobytes():
            return self.expand(self.reshape(self.constant(array.flat[0]), (1,) * array.ndim), array.shape)
        return self.add("constant", (), array.shape, array.dtype, value=array)

    def add(
        self, kind: str, operands: tuple[int, ...], shape: tuple[int, ...], dtype: DTypeLike, /, **attributes: object
    ) -> int:
        """An operation. **Returns** its place."""
        attribute_keys = tuple((name, _key(value)) for name, value in sorted(attributes.items()))
        key = (kind, operands, shape, np.dtype(dtype), attribute_keys)
        if key not in self._places:
            self._places[key] = len(self.operations)
            whole = tuple(int(n) for n in shape)
            self.operations.append(Operation(kind, operands, whole, np.dtype(dtype), attributes))
        return self._places[key]

    def elementwise(self, kind: str, *operands: int, dtype: DTypeLike | None = None, **attributes: object) -> int:
        """An operation on each element, by default with the dtype of the last operand. Operands have the same number of
        axes, or are single numbers; an axis of length 1 is repeated."""
        shape = np.broadcast_shapes(*(self.operations[place].shape for place in operands))
        dtype = self.operations[operands[-1]].dtype if dtype is None else dtype
        return self.add(kind, operands, shape, dtype, **attributes)

    def reshape(self, place: int, shape: tuple[int, ...]) -> int:
        """The same elements in another shape."""
        operation = self.operations[place]
        if operation.shape == tuple(shape):
            return place
        if operation.kind == "constant":
            return self.constant(operation.attributes["value"].reshape(shape))
        return self.add("reshape", (place,), tuple(shape), operation.dtype)

    def expand(self, place: int, shape: tuple[int, ...]) -> int:
        """An array repeated along its axes of length 1."""
        operation = self.operations[place]
        return place if operation.shape == tuple(shape) else self.add("expand", (place,), tuple(shape), operation.dtype)

    def take(self, place: int, index: np.ndarray) -> int:
        """Elements at known places of the flat array, in the shape of `index`."""
        operation = self.operations[place]
        if operation.shape == index.shape and np.array_equal(index.ravel(), np.arange(index.size)):
            return place
        return self.add("take", (place,), index.shape, operation.dtype, index=index.astype(np.int32))

    def pick(self, place: int, index: int) -> int:
        """Elements at computed places of the flat array."""
        return self.add("pick", (place, index), self.operations[index].shape, self.operations[place].dtype)

    def known(self, place: int) -> np.ndarray | None:
        """The value of an array that depends on no input."""
        operation = self.operations[place]
        if operation.kind == "constant":
            return operation.attributes["value"]
        if operation.kind not in ("reshape", "expand"):
            return None
        inner = self.known(operation.operands[0])
        if inner is None:
            return None
        return (
            inner.reshape(operation.shape) if operation.kind == "reshape" else np.broadcast_to(inner, operation.shape)
        )

    def run(self, jaxpr: Jaxpr, constants: Sequence[Array], inputs: list[int]) -> list[int]:
        """Add the operations of a function. **Returns** the places of its outputs."""
        places: dict[Var, int] = dict(zip(jaxpr.invars, inputs, strict=True))
        places |= {variable: self.constant(value) for variable, value in zip(jaxpr.constvars, constants, strict=True)}

        def place_of(atom: Var | Literal) -> int:
            if isinstance(atom, Literal):
                return self.constant(np.asarray(atom.val, aval_of(atom).dtype))
            return places[atom]

        for equation in jaxpr.eqns:
            made = self._translated(equation, [place_of(atom) for atom in equation.invars])
            places |= dict(zip(equation.outvars, made, strict=True))
        return [place_of(atom) for atom in jaxpr.outvars]

    def _translated(self, equation: JaxprEqn, operands: list[int]) -> list[int]:
        name, parameters = equation.primitive.name, equation.params
        inner = next((parameters[key] for key in ("jaxpr", "call_jaxpr", "fun_jaxpr") if key in parameters), None)
        if inner is not None and name not in KEPT:
            closed = hasattr(inner, "consts")
            return self.run(inner.jaxpr if closed else inner, inner.consts if closed else (), operands)
        values = [value for place in operands if (value := self.known(place)) is not None]
        if name not in KEPT and len(values) == len(operands):
            return [self.constant(value) for value in _computed(equation, values)]
        if name not in RULES:
            raise Untranslatable(f"{name}: an export does not know this operation of JAX")
        made = RULES[name](self, operands, equation)
        return [made] if isinstance(made, int) else made


def _computed(equation: JaxprEqn, values: list[np.ndarray]) -> list[np.ndarray]:
    """What an equation makes of known values, in their own precision."""
    with jax.enable_x64(True):
        made = equation.primitive.bind(*map(jax.numpy.asarray, values), **equation.params)
    return [np.asarray(each) for each in (made if equation.primitive.multiple_results else [made])]


def _key(value: object) -> Hashable:
    return (value.shape, value.dtype.str, value.tobytes()) if isinstance(value, np.ndarray) else repr(value)
