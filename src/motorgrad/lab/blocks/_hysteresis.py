"""Nonlinear functions with memory: a relay, play, and a limited rate."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Moment, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab.blocks._shaped import Elementwise


@dataclasses.dataclass(frozen=True)
class Relay(Elementwise):
    """Switches on where its input is at least `high`, and off where it is at most `low`; in between it stays.

    It is evaluated once at each of its ticks.
    """

    name: ClassVar[str] = "relay"
    category: ClassVar[str] = "nonlinear"

    low: Annotated[Any, Parameter("where it switches off")] = -0.5
    high: Annotated[Any, Parameter("where it switches on")] = 0.5
    off: Annotated[Any, Parameter("what it gives while off")] = 0.0
    on: Annotated[Any, Parameter("what it gives while on")] = 1.0
    begins_on: Annotated[bool, Setting("whether it is on at first")] = False

    def validate(self) -> None:
        super().validate()
        check(np.all(np.less_equal(self.low, self.high)), "low", self.low, f"at most high = {self.high}")
        check(isinstance(self.begins_on, bool), "begins_on", self.begins_on, "true or false")

    def init(self, uniforms: Any) -> Any:
        return jnp.full(self.shape, self.begins_on)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": jnp.where(self.update(state, inputs, now), self.on, self.off)}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return (inputs["u"] >= self.high) | (state & (inputs["u"] > self.low))


@dataclasses.dataclass(frozen=True)
class Backlash(Elementwise):
    """Follows its input as a part with play does: it moves only where the input is half of `width` away from it."""

    name: ClassVar[str] = "backlash"
    category: ClassVar[str] = "nonlinear"

    width: Annotated[Any, Parameter("the play", low=0.0)] = 1.0
    initial: Annotated[Any, Parameter("where it is at first")] = 0.0

    def init(self, uniforms: Any) -> Any:
        return self.filled(self.initial)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self.update(state, inputs, now)}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return jnp.clip(state, inputs["u"] - self.width / 2, inputs["u"] + self.width / 2)


@dataclasses.dataclass(frozen=True)
class RateLimit(Elementwise):
    """Follows its input no faster than `rise` and `fall`. At its first evaluation it moves from `initial`."""

    name: ClassVar[str] = "rate limit"
    category: ClassVar[str] = "nonlinear"

    rise: Annotated[Any, Parameter("how fast it may rise", unit="1/s", low=0.0)] = 1.0
    fall: Annotated[Any, Parameter("how fast it may fall", unit="1/s", low=0.0)] = 1.0
    initial: Annotated[Any, Parameter("where it is at first")] = 0.0

    def init(self, uniforms: Any) -> Any:
        return self.filled(self.initial)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self.update(state, inputs, now)}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return jnp.clip(inputs["u"], state - now.step * self.fall, state + now.step * self.rise)
