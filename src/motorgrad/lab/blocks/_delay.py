"""What was some time ago."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._shaped import Shaped

MOST = 2**22  # numbers that a delay may hold


@dataclasses.dataclass(frozen=True)
class Delay(Shaped):
    r"""Gives what it was given `length` evaluations ago, $y_t = u_{t-n}$, and `initial` before: a transport delay."""

    name: ClassVar[str] = "delay"
    category: ClassVar[str] = "dynamics"

    initial: Annotated[Any, Parameter("what it gives at first")] = 0.0
    length: Annotated[int, Setting("$n$, in evaluations of its own")] = 10

    def validate(self) -> None:
        super().validate()
        whole = isinstance(self.length, int) and not isinstance(self.length, bool)
        most = MOST // int(np.prod(self.shape))
        check(whole and 1 <= self.length <= most, "length", self.length, f"a whole number in 1 … {most}")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, feedthrough=False)}

    def init(self, uniforms: Any) -> Any:
        """What came in, in a ring, and where in it the oldest is."""
        return jnp.broadcast_to(self.initial, (self.length, *self.shape)) * 1.0, jnp.zeros((), jnp.int32)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        ring, oldest = state
        return {"y": ring[oldest]}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        ring, oldest = state
        return ring.at[oldest].set(inputs["u"]), (oldest + 1) % self.length
