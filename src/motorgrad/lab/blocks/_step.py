"""A jump, and a slope."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp

from motorgrad.lab._block import Moment, Signals
from motorgrad.lab._parameter import Parameter
from motorgrad.lab.blocks._shaped import ROUNDING, TimeSource


@dataclasses.dataclass(frozen=True)
class Step(TimeSource):
    """Gives `before`, and from the time `at` on `after`."""

    name: ClassVar[str] = "step"
    category: ClassVar[str] = "sources"

    at: Annotated[Any, Parameter("when it jumps", unit="s")] = 1.0
    before: Annotated[Any, Parameter("what it gives at first")] = 0.0
    after: Annotated[Any, Parameter("what it gives from then on")] = 1.0

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        there = now.time >= self.at - ROUNDING * jnp.abs(self.at)
        return {"y": self.filled(jnp.where(there, self.after, self.before))}


@dataclasses.dataclass(frozen=True)
class Ramp(TimeSource):
    r"""Gives `initial` until the time `start`, and then rises, $y = y_0 + k\,(t - t_0)$."""

    name: ClassVar[str] = "ramp"
    category: ClassVar[str] = "sources"

    slope: Annotated[Any, Parameter("$k$", unit="1/s")] = 1.0
    start: Annotated[Any, Parameter("$t_0$", unit="s")] = 0.0
    initial: Annotated[Any, Parameter("$y_0$")] = 0.0

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self.filled(self.initial + self.slope * jnp.maximum(now.time - self.start, 0.0))}
