"""Products of signals: element by element, and by a matrix."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._shaped import Shaped


@dataclasses.dataclass(frozen=True)
class Product(Shaped):
    """Multiplies its inputs `u1`, `u2`, … element by element, or divides by those with a `/`."""

    name: ClassVar[str] = "product"
    category: ClassVar[str] = "mathematics"

    signs: Annotated[str, Setting("a * or / for each input")] = "**"

    def validate(self) -> None:
        valid = isinstance(self.signs, str) and self.signs and set(self.signs) <= {"*", "/"}
        check(valid, "signs", self.signs, "a text of * and /, one for each input")

    @property
    def inputs(self) -> Ports:
        return {f"u{number}": Port(self.shape) for number, _ in enumerate(self.signs, 1)}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        result = jnp.ones(self.shape)
        for sign, u in zip(self.signs, inputs.values(), strict=True):
            result = result * u if sign == "*" else result / u
        return {"y": result}


@dataclasses.dataclass(frozen=True)
class MatrixGain(Block):
    """Multiplies a vector by a matrix from the left, $y = M u$. The matrix's shape is that of the ports."""

    name: ClassVar[str] = "matrix gain"
    category: ClassVar[str] = "mathematics"

    matrix: Annotated[Any, Parameter("$M$, a list of rows")] = ((1.0, 0.0), (0.0, 1.0))

    def validate(self) -> None:
        check(np.ndim(self.matrix) == 2, "matrix", self.matrix, "a list of rows of one length")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(np.shape(self.matrix)[1:])}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(np.shape(self.matrix)[:1])}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self.matrix @ inputs["u"]}
