"""A number that stays."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp

from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port


@dataclasses.dataclass(frozen=True)
class Constant(Block):
    """Gives its `value`, broadcast to `shape`."""

    name: ClassVar[str] = "constant"
    category: ClassVar[str] = "sources"

    value: Annotated[Any, Parameter("what it gives")] = 0.0
    shape: Annotated[tuple[int, ...], Setting("shape of the signal")] = ()

    def validate(self) -> None:
        self.check_broadcasts("value", self.shape)

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape)}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": jnp.broadcast_to(self.value, self.shape)}
