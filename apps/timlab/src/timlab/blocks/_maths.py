"""Mathematics: gains, sums, products, formulas, and operations on vectors."""

import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._errors import check
from motorgrad.schema import Range, count, number, static
from timlab.blocks._base import Elementwise, OneShape, Shaped, check_names
from timlab.blocks._formulas import FUNCTIONS, RESERVED, evaluate_at, formula, is_condition, names_read
from timlab.diagram import (
    Block,
    Moment,
    Port,
    Ports,
    Signals,
    Timing,
)


@dataclasses.dataclass(frozen=True)
class Gain(OneShape):
    r"""Multiply by a constant, $y = k\,u$, element by element."""

    name: ClassVar[str] = "gain"
    category: ClassVar[str] = "mathematics"

    gain: Any = number(1.0, help="the factor $k$")
    shape: tuple[int, ...] = static((), help="shape of the signals")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": self.gain * inputs["u"]}


@dataclasses.dataclass(frozen=True)
class Sum(OneShape):
    """Signed sum of the inputs `u1`, `u2`, …."""

    name: ClassVar[str] = "sum"
    category: ClassVar[str] = "mathematics"

    signs: str = static("++", help="one + or - per input")
    shape: tuple[int, ...] = static((), help="shape of the signals")

    def validate(self) -> None:
        valid = 1 <= len(self.signs) <= MAX_PORTS and set(self.signs) <= {"+", "-"}
        check(valid, "signs", self.signs, f"a string of + and -, one per input, at most {MAX_PORTS}")

    @property
    def inputs(self) -> Ports:
        return {f"u{number}": Port(self.shape) for number, _ in enumerate(self.signs, 1)}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        signed = [-u if sign == "-" else u for sign, u in zip(self.signs, inputs.values(), strict=True)]
        total = signed[0]
        for more in signed[1:]:
            total = total + more
        return {"y": total}


@dataclasses.dataclass(frozen=True)
class Product(Shaped):
    """Product of the inputs `u1`, `u2`, …, element by element; inputs with a `/` divide."""

    name: ClassVar[str] = "product"
    category: ClassVar[str] = "mathematics"

    signs: str = static("**", help="one * or / per input")

    def validate(self) -> None:
        valid = 1 <= len(self.signs) <= MAX_PORTS and set(self.signs) <= {"*", "/"}
        check(valid, "signs", self.signs, f"a string of * and /, one per input, at most {MAX_PORTS}")

    @property
    def inputs(self) -> Ports:
        return {f"u{number}": Port(self.shape) for number, _ in enumerate(self.signs, 1)}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        result = jnp.ones(self.shape)
        for sign, u in zip(self.signs, inputs.values(), strict=True):
            result = result * u if sign == "*" else result / u
        return {"y": result}


@dataclasses.dataclass(frozen=True)
class MatrixGain(Block):
    """Matrix–vector product, $y = M u$. The shape of the matrix determines the ports."""

    name: ClassVar[str] = "matrix gain"
    category: ClassVar[str] = "mathematics"

    matrix: Any = number(((1.0, 0.0), (0.0, 1.0)), help="$M$, a list of rows")

    def validate(self) -> None:
        check(np.ndim(self.matrix) == 2, "matrix", self.matrix, "a list of rows of equal length")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(np.shape(self.matrix)[1:])}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(np.shape(self.matrix)[:1])}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": self.matrix @ inputs["u"]}


ONE_ARGUMENT = tuple(name for name, function in FUNCTIONS.items() if function.arguments == 1)


@dataclasses.dataclass(frozen=True)
class Expression(Block):
    """A formula of its inputs, element by element, such as `if(abs(u) > limit, 0, u^2)`.

    A formula may use numbers, `pi`, the inputs, the constants, the time `t` in seconds, `+ - * / ^`, comparisons,
    `and`, `or`, `not`, brackets and the functions abs, sign, sqrt, exp, log, log10, sin, cos, tan, asin, acos, atan,
    sinh, cosh, tanh, sigmoid, floor, ceil, round, atan2, hypot, mod, min, max, clip(u, low, high) and if(condition,
    then, else). A formula that is a condition outputs a boolean; a number is true unless it is 0.
    """

    name: ClassVar[str] = "expression"
    category: ClassVar[str] = "mathematics"

    expression: str = static("u", help="the formula")
    reads: tuple[str, ...] = static(("u",), help="names of the inputs")
    constants: tuple[str, ...] = static((), help="names of constants that may change during a run")
    numbers: Any = number(0.0, help="values of the constants, in their order")
    shape: tuple[int, ...] = static((), help="shape of the signals")

    def validate(self) -> None:
        check_names("reads", self.reads, RESERVED)
        check_names("constants", self.constants, {*RESERVED, *self.reads})
        self.check_broadcasts("numbers", (len(self.constants),) if self.constants else ())
        formula("expression", self.expression, self._names)

    @property
    def _names(self) -> tuple[str, ...]:
        return (*self.reads, *self.constants, "t")

    @property
    def _tree(self) -> Any:
        return formula("expression", self.expression, self._names)

    @property
    def inputs(self) -> Ports:
        return {name: Port(self.shape) for name in self.reads}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape, "bool" if is_condition(self._tree) else "float")}

    @property
    def timing(self) -> Timing:
        timed = "t" in names_read(self._tree) - {*self.reads, *self.constants}
        return "continuous" if timed and super().timing == "inherited" else super().timing

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        times = {"t": (now.doubled(lambda time: time, at="time"), _inside(now))}
        value = evaluate_at(self._tree, times, named_values(self.constants, self.numbers), inputs)
        return {"y": jnp.broadcast_to(value, self.shape).astype(self.outputs["y"].dtype)}


def _inside(now: Moment) -> Array:
    """The time, moved from an end of the RK4 step into it by more than its rounding: there a jump of time alone belongs
    to the step after it.
    """

    def inside(start: Array, step: Array) -> Array:
        time = start + step
        nearly = now.blur
        return jnp.where(step > 0, jnp.maximum(time - nearly, start + nearly), time + nearly)

    return now.doubled(inside, now.within - now.begun)


@dataclasses.dataclass(frozen=True)
class Function(Elementwise):
    """A function of one argument, element by element. `round` rounds halves to the nearest even number."""

    name: ClassVar[str] = "function"
    category: ClassVar[str] = "mathematics"

    function: Literal[ONE_ARGUMENT] = static("abs", help="which function")  # type: ignore[valid-type]

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": FUNCTIONS[self.function].apply(inputs["u"])}


def named_values(names: tuple[str, ...], values: Array) -> dict[str, Any]:
    """The elements of an array of constants by name; a scalar is the value of all."""
    return dict(zip(names, jnp.broadcast_to(values, (len(names),)), strict=True))


MAX_PORTS = 1000  # of a block


@dataclasses.dataclass(frozen=True)
class Join(Block):
    """Concatenate the inputs `u1`, `u2`, …, of the given sizes, into one list."""

    name: ClassVar[str] = "join"
    category: ClassVar[str] = "vectors"

    sizes: tuple[int, ...] = static((0, 0), allowed=Range(0, kind="int"), help="length of each input, 0 for a scalar")

    def validate(self) -> None:
        _check_indices("sizes", self.sizes)

    @property
    def inputs(self) -> Ports:
        return {f"u{number}": Port((size,) if size else ()) for number, size in enumerate(self.sizes, 1)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port((sum(max(size, 1) for size in self.sizes),))}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": jnp.concatenate([jnp.atleast_1d(u) for u in inputs.values()])}


@dataclasses.dataclass(frozen=True)
class Select(Block):
    """Select elements of a list, in the given order. A single element is output as a scalar if `single`."""

    name: ClassVar[str] = "select"
    category: ClassVar[str] = "vectors"

    size: int = count(2, 1, help="length of the input")
    entries: tuple[int, ...] = static((0,), allowed=Range(0, kind="int"), help="indices of the elements, from 0")
    single: bool = static(True, help="whether a single element is output as a scalar")

    def validate(self) -> None:
        _check_indices("entries", self.entries)
        check(max(self.entries) < self.size, "entries", self.entries, f"below size = {self.size}")

    @property
    def inputs(self) -> Ports:
        return {"u": Port((self.size,))}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(() if self._one else (len(self.entries),))}

    @property
    def _one(self) -> bool:
        return self.single and len(self.entries) == 1

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        u = inputs["u"]
        return {"y": u[self.entries[0]] if self._one else jnp.stack([u[entry] for entry in self.entries])}


@dataclasses.dataclass(frozen=True)
class Reduce(Block):
    """Reduce all elements of a signal to one number. `"norm"` is the Euclidean norm."""

    name: ClassVar[str] = "reduce"
    category: ClassVar[str] = "vectors"

    how: Literal["sum", "mean", "product", "max", "min", "norm"] = static("sum", help="the reduction")
    shape: tuple[int, ...] = static((2,), help="shape of the input")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(())}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        function = {
            "sum": jnp.sum,
            "mean": jnp.mean,
            "product": jnp.prod,
            "max": jnp.max,
            "min": jnp.min,
            "norm": lambda u: jnp.sqrt(jnp.sum(u * u)),
        }[self.how]
        return {"y": function(inputs["u"])}


def _check_indices(name: str, given: Sequence[int]) -> None:
    check(1 <= len(given) <= MAX_PORTS, name, given, f"a list of 1 … {MAX_PORTS} integers from 0")
