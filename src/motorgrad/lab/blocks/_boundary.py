"""The ports of a subsystem, seen from within."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp

from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Kind, Port
from motorgrad.lab._sink import Sink


@dataclasses.dataclass(frozen=True)
class Inlet(Block):
    """An input of the diagram that it stands in. Without a wire from outside it gives its `value`.

    In the outermost diagram numbers come in by it: `value` is a parameter like any other, to be set between ticks.
    """

    name: ClassVar[str] = "inlet"
    category: ClassVar[str] = "subsystems"

    value: Annotated[Any, Parameter("what is read where nothing leads here")] = 0.0
    shape: Annotated[tuple[int, ...], Setting("shape of the signal")] = ()
    kind: Annotated[Kind, Setting("kind of the signal", choices=("float", "int", "bool"))] = "float"

    def validate(self) -> None:
        self.check_broadcasts("value", self.shape)

    @property
    def port(self) -> Port:
        """The port that the subsystem has by it."""
        return Port(self.shape, self.kind, default=0.0)

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape, self.kind)}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": jnp.broadcast_to(self.value, self.shape).astype(self.port.dtype)}


@dataclasses.dataclass(frozen=True)
class Outlet(Sink):
    """An output of the diagram that it stands in. In the outermost diagram it is recorded."""

    name: ClassVar[str] = "outlet"
    category: ClassVar[str] = "subsystems"

    shape: Annotated[tuple[int, ...], Setting("shape of the signal")] = ()
    kind: Annotated[Kind, Setting("kind of the signal", choices=("float", "int", "bool"))] = "float"

    @property
    def port(self) -> Port:
        """The port that the subsystem has by it."""
        return Port(self.shape, self.kind)

    @property
    def inputs(self) -> Ports:
        return {"u": self.port}
