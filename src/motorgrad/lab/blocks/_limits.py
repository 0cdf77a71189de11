"""Nonlinear functions without memory: limits, dead zones, steps."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Moment, Signals
from motorgrad.lab._parameter import Parameter
from motorgrad.lab.blocks._shaped import Elementwise


@dataclasses.dataclass(frozen=True)
class _Between(Elementwise):
    low: Annotated[Any, Parameter("the lower end")] = -1.0
    high: Annotated[Any, Parameter("the upper end")] = 1.0

    def validate(self) -> None:
        super().validate()
        check(np.all(np.less(self.low, self.high)), "low", self.low, f"below high = {self.high}")


@dataclasses.dataclass(frozen=True)
class Saturation(_Between):
    """Keeps its input within `low` and `high`."""

    name: ClassVar[str] = "saturation"
    category: ClassVar[str] = "nonlinear"

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": jnp.clip(inputs["u"], self.low, self.high)}


@dataclasses.dataclass(frozen=True)
class DeadZone(_Between):
    """Gives 0 between `low` and `high`, and beyond them how far the input is beyond."""

    name: ClassVar[str] = "dead zone"
    category: ClassVar[str] = "nonlinear"

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": inputs["u"] - jnp.clip(inputs["u"], self.low, self.high)}


@dataclasses.dataclass(frozen=True)
class Quantiser(Elementwise):
    r"""Rounds to the nearest multiple of the interval $q$, $y = q \lfloor u/q \rceil$; a half to the even multiple."""

    name: ClassVar[str] = "quantiser"
    category: ClassVar[str] = "nonlinear"

    interval: Annotated[Any, Parameter("$q$", low=0.0, open=True)] = 0.1

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self.interval * jnp.round(inputs["u"] / self.interval)}
