"""A factor."""

import dataclasses
from typing import Annotated, Any, ClassVar

from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port


@dataclasses.dataclass(frozen=True)
class Gain(Block):
    r"""Multiplies, $y = k\,u$, element by element."""

    name: ClassVar[str] = "gain"
    category: ClassVar[str] = "mathematics"

    gain: Annotated[Any, Parameter("the factor $k$")] = 1.0
    shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

    def validate(self) -> None:
        self.check_broadcasts("gain", self.shape)

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape)}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self.gain * inputs["u"]}
