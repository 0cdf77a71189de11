"""Conditions: of numbers, and of conditions."""

import dataclasses
import functools
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp

from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._functions import COMPARISONS, OPERATORS
from motorgrad.lab.blocks._shaped import Shaped
from motorgrad.lab.blocks._switch import check_count

JOINS = ("and", "or", "xor", "nand", "nor")


@dataclasses.dataclass(frozen=True)
class Compare(Shaped):
    """Whether `u1` stands in a relation to `u2` + `margin`, element by element. Without a wire, `u2` is 0."""

    name: ClassVar[str] = "compare"
    category: ClassVar[str] = "logic"

    relation: Annotated[str, Setting("the relation", choices=COMPARISONS)] = ">"
    margin: Annotated[Any, Parameter("what is added to u2")] = 0.0

    @property
    def inputs(self) -> Ports:
        return {"u1": Port(self.shape), "u2": Port(self.shape, default=0.0)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape, "bool")}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": OPERATORS[self.relation].apply(inputs["u1"], inputs["u2"] + self.margin)}


@dataclasses.dataclass(frozen=True)
class Logic(Block):
    """Joins conditions `u1`, `u2`, … element by element. `"xor"` is true where an odd number of them is."""

    name: ClassVar[str] = "logic"
    category: ClassVar[str] = "logic"

    operator: Annotated[str, Setting("how they are joined", choices=JOINS)] = "and"
    count: Annotated[int, Setting("how many inputs there are")] = 2
    shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

    def validate(self) -> None:
        check_count("count", self.count)

    @property
    def inputs(self) -> Ports:
        return {f"u{number}": Port(self.shape, "bool") for number in range(1, self.count + 1)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape, "bool")}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        join = {"and": jnp.logical_and, "or": jnp.logical_or, "xor": jnp.logical_xor}
        positive = {"nand": "and", "nor": "or"}.get(self.operator, self.operator)
        joined = functools.reduce(join[positive], inputs.values())
        return {"y": joined if positive == self.operator else ~joined}


@dataclasses.dataclass(frozen=True)
class Not(Block):
    """True where its input is false."""

    name: ClassVar[str] = "not"
    category: ClassVar[str] = "logic"

    shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, "bool")}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape, "bool")}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": ~inputs["u"]}
