"""What many blocks have in common: one shape, to which their parameters are broadcast."""

import dataclasses
from typing import Annotated, ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from motorgrad.lab._block import Block, Ports
from motorgrad.lab._parameter import Setting, parameters_of
from motorgrad.lab._port import Port

ROUNDING = 2.5e-7  # of a time: a tick that is on an edge, but for so small a part, counts as on it


@dataclasses.dataclass(frozen=True)
class Shaped(Block):
    """A block with one output `y`; every parameter is a number, or an array that broadcasts to `shape`."""

    shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = dataclasses.field(default=(), kw_only=True)

    def validate(self) -> None:
        for name in parameters_of(type(self)):
            self.check_broadcasts(name, self.shape)

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape)}

    def filled(self, value: Array) -> Array:
        """A value in every place of the shape."""
        return jnp.broadcast_to(value, self.shape)


@dataclasses.dataclass(frozen=True)
class Elementwise(Shaped):
    """A block whose output `y` has the shape of its input `u`."""

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}


@dataclasses.dataclass(frozen=True)
class TimeSource(Shaped):
    """A source whose output follows from the time alone."""

    timed: ClassVar[bool] = True
