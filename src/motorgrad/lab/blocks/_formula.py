"""A formula of inputs, and a single function."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp

from motorgrad.lab._block import Block, Moment, Ports, Signals, Timing
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._functions import FUNCTIONS
from motorgrad.lab.blocks._grammar import RESERVED, evaluate, formula, is_condition, used
from motorgrad.lab.blocks._named import check_names
from motorgrad.lab.blocks._shaped import Elementwise

ONE_ARGUMENT = tuple(name for name, function in FUNCTIONS.items() if function.arguments == 1)


@dataclasses.dataclass(frozen=True)
class Expression(Block):
    """A formula of its inputs, element by element, such as `if(abs(u) > limit, 0, u^2)`.

    It may use numbers, `pi`, the inputs, the constants, the time `t` in seconds, `+ - * / ^`, comparisons, `and`, `or`,
    `not`, brackets and the functions abs, sign, sqrt, exp, log, log10, sin, cos, tan, asin, acos, atan, sinh, cosh,
    tanh, sigmoid, floor, ceil, round, atan2, hypot, mod, min, max, clip(u, low, high) and if(condition, then, else). A
    formula that is a condition gives a boolean; a number counts as true unless it is 0.
    """

    name: ClassVar[str] = "expression"
    category: ClassVar[str] = "mathematics"

    expression: Annotated[str, Setting("the formula")] = "u"
    reads: Annotated[tuple[str, ...], Setting("the names of the inputs")] = ("u",)
    constants: Annotated[tuple[str, ...], Setting("names of numbers that may be changed while it runs")] = ()
    numbers: Annotated[Any, Parameter("the numbers of the constants, in their order")] = 0.0
    shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

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
        timed = "t" in used(self._tree) - {*self.reads, *self.constants}
        return "continuous" if timed and super().timing == "inherited" else super().timing

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        value = evaluate(self._tree, {"t": now.time, **named_values(self.constants, self.numbers), **inputs})
        return {"y": jnp.broadcast_to(value, self.shape).astype(self.outputs["y"].dtype)}


@dataclasses.dataclass(frozen=True)
class Function(Elementwise):
    """One function, element by element. `round` goes to the nearest even number at halves."""

    name: ClassVar[str] = "function"
    category: ClassVar[str] = "mathematics"

    function: Annotated[str, Setting("which function", choices=ONE_ARGUMENT)] = "abs"

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": FUNCTIONS[self.function].apply(inputs["u"])}


def named_values(names: tuple[str, ...], values: Any) -> dict[str, Any]:
    """The entries of an array of numbers by name; one number is that of all."""
    return dict(zip(names, jnp.broadcast_to(values, (len(names),)), strict=True))
