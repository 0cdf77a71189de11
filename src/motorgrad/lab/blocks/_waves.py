"""Waves: sine, pulses, and a sine whose frequency sweeps."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Moment, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab.blocks._shaped import ROUNDING, TimeSource


@dataclasses.dataclass(frozen=True)
class Sine(TimeSource):
    r"""A sine wave, $y = b + a \sin(2\pi f t + \varphi)$."""

    name: ClassVar[str] = "sine"
    category: ClassVar[str] = "sources"

    amplitude: Annotated[Any, Parameter("$a$")] = 1.0
    frequency: Annotated[Any, Parameter("$f$", unit="Hz", low=0.0)] = 1.0
    phase: Annotated[Any, Parameter(r"$\varphi$", unit="rad")] = 0.0
    offset: Annotated[Any, Parameter("$b$")] = 0.0

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        cycles = self.frequency * now.time % 1.0
        return {"y": self.filled(self.offset + self.amplitude * jnp.sin(2 * jnp.pi * cycles + self.phase))}


@dataclasses.dataclass(frozen=True)
class Pulse(TimeSource):
    """Gives `high` for a part `duty` of every cycle from its beginning, else `low`."""

    name: ClassVar[str] = "pulse"
    category: ClassVar[str] = "sources"

    frequency: Annotated[Any, Parameter("cycles in a second", unit="Hz", low=0.0)] = 1.0
    duty: Annotated[Any, Parameter("the part of a cycle that is high", low=0.0, high=1.0)] = 0.5
    delay: Annotated[Any, Parameter("when a cycle begins", unit="s")] = 0.0
    low: Annotated[Any, Parameter("what it gives in between")] = 0.0
    high: Annotated[Any, Parameter("what it gives in a pulse")] = 1.0

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        cycles = self.frequency * (now.time - self.delay)
        within = (cycles + 2 * ROUNDING * (1 + jnp.abs(cycles))) % 1.0 < self.duty
        return {"y": self.filled(jnp.where(within, self.high, self.low))}


@dataclasses.dataclass(frozen=True)
class Chirp(TimeSource):
    r"""A sine wave whose frequency goes from $f_0$ at the time 0 to $f_1$ at the time $T$, and on in the same way.

    The frequency is $f_0 + (f_1 - f_0)\,t/T$, or with `sweep="logarithmic"` $f_0\,(f_1/f_0)^{t/T}$.
    """

    name: ClassVar[str] = "chirp"
    category: ClassVar[str] = "sources"

    amplitude: Annotated[Any, Parameter("the wave's amplitude")] = 1.0
    first: Annotated[Any, Parameter("$f_0$", unit="Hz", low=0.0, open=True)] = 0.1
    last: Annotated[Any, Parameter("$f_1$", unit="Hz", low=0.0, open=True)] = 10.0
    duration: Annotated[Any, Parameter("$T$", unit="s", low=0.0, open=True)] = 10.0
    phase: Annotated[Any, Parameter("at the time 0; at 0 it begins as a sine", unit="rad")] = 0.0
    sweep: Annotated[str, Setting("how the frequency goes", choices=("linear", "logarithmic"))] = "linear"

    def validate(self) -> None:
        super().validate()
        different = np.all(np.not_equal(self.first, self.last))
        check(different or self.sweep == "linear", "last", self.last, "other than first in a logarithmic sweep")

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        part = now.time / self.duration
        if self.sweep == "linear":
            cycles = now.time * (self.first + 0.5 * (self.last - self.first) * part)
        else:
            rate = jnp.log(self.last / self.first)
            cycles = self.first * self.duration / rate * jnp.expm1(rate * part)
        return {"y": self.filled(self.amplitude * jnp.sin(2 * jnp.pi * (cycles % 1.0) + self.phase))}
