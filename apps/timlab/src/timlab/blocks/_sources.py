"""Sources: constants, functions of time, noise."""

import dataclasses
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._errors import check
from motorgrad._random import normals
from motorgrad.schema import number, static
from timlab.blocks._base import OneShape, Shaped, TimeSource, check_limits
from timlab.diagram import Moment, Signals


@dataclasses.dataclass(frozen=True)
class Constant(OneShape):
    """Constant `value`, broadcast to `shape`."""

    name: ClassVar[str] = "constant"
    category: ClassVar[str] = "sources"

    value: Any = number(0.0, help="the output")
    shape: tuple[int, ...] = static((), help="shape of the signal")

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": self.filled(self.value)}


@dataclasses.dataclass(frozen=True)
class Step(TimeSource):
    """Step from `before` to `after` at time `at`."""

    name: ClassVar[str] = "step"
    category: ClassVar[str] = "sources"

    at: Any = number(1.0, unit="s", help="time of the step")
    before: Any = number(0.0, help="output before the step")
    after: Any = number(1.0, help="output from the step on")

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        jumped = now.doubled(lambda start, at: start >= at - now.blur, self.at)
        return {"y": self.filled(jnp.where(jumped, self.after, self.before))}

    def next_jump(self, now: Moment) -> Array:
        return now.doubled(lambda start, at: jnp.min(jnp.where(start >= at - now.blur, jnp.inf, at)), self.at)


@dataclasses.dataclass(frozen=True)
class Ramp(TimeSource):
    r"""Constant `initial` until time `start`, then a ramp, $y = y_0 + k\,(t - t_0)$."""

    name: ClassVar[str] = "ramp"
    category: ClassVar[str] = "sources"

    slope: Any = number(1.0, unit="1/s", help="change per second, $k$")
    start: Any = number(0.0, unit="s", help="time at which the ramp starts, $t_0$")
    initial: Any = number(0.0, help="output before the ramp, $y_0$")

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        def ramp(time: Array, slope: Array, start: Array, initial: Array) -> Array:
            return initial + slope * jnp.maximum(time - start, 0.0)

        return {"y": self.filled(now.exactly(ramp, self.slope, self.start, self.initial))}


@dataclasses.dataclass(frozen=True)
class Sine(TimeSource):
    r"""Sine wave, $y = b + a \sin(2\pi f t + \varphi)$."""

    name: ClassVar[str] = "sine"
    category: ClassVar[str] = "sources"

    amplitude: Any = number(1.0, help="peak value, $a$")
    frequency: Any = number(1.0, 0, unit="Hz", help="cycles per second, $f$")
    phase: Any = number(0.0, unit="rad", help=r"phase at time 0, $\varphi$")
    offset: Any = number(0.0, help="mean of the wave, $b$")

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        cycles = now.cycles(self.frequency)
        return {"y": self.filled(self.offset + self.amplitude * jnp.sin(2 * jnp.pi * cycles + self.phase))}


@dataclasses.dataclass(frozen=True)
class Pulse(TimeSource):
    """Pulse train: `high` for the first fraction `duty` of every cycle, `low` for the rest."""

    name: ClassVar[str] = "pulse"
    category: ClassVar[str] = "sources"

    frequency: Any = number(1.0, 0, unit="Hz", help="cycles per second")
    duty: Any = number(0.5, 0, 1, help="fraction of a cycle that is high")
    delay: Any = number(0.0, unit="s", help="start of the first cycle")
    low: Any = number(0.0, help="output between pulses")
    high: Any = number(1.0, help="output during a pulse")

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        def is_high(start: Array, frequency: Array, delay: Array, duty: Array) -> Array:
            return self._phase(now, start, frequency, delay)[0] < duty

        return {"y": self.filled(jnp.where(now.doubled(is_high, *self._times), self.high, self.low))}

    def next_jump(self, now: Moment) -> Array:
        def jump(start: Array, frequency: Array, delay: Array, duty: Array) -> Array:
            phase, margin = self._phase(now, start, frequency, delay)
            left = jnp.where(phase < duty, duty, 1.0) - phase + margin
            return start + jnp.min(jnp.where(frequency > 0, left / frequency, jnp.inf))

        return now.doubled(jump, *self._times)

    @property
    def _times(self) -> tuple[Any, Any, Any]:
        return self.frequency, self.delay, self.duty

    @staticmethod
    def _phase(now: Moment, start: Array, frequency: Array, delay: Array) -> tuple[Any, Any]:
        """The part of a cycle that has passed when the step begins, and the part that rounding may take from it: what
        misses a jump by as little counts as on it.
        """
        cycles = frequency * (start - delay)
        margin = frequency * (now.blur + 1e-15 * jnp.abs(delay)) + 1e-15 * (1 + jnp.abs(cycles))
        return (cycles % 1.0 + margin) % 1.0, margin


@dataclasses.dataclass(frozen=True)
class Chirp(TimeSource):
    r"""Sine wave with a frequency sweep from $f_0$ at time 0 to $f_1$ at time $T$, which continues after $T$.

    The frequency is $f_0 + (f_1 - f_0)\,t/T$, or with `sweep="logarithmic"` $f_0\,(f_1/f_0)^{t/T}$.
    """

    name: ClassVar[str] = "chirp"
    category: ClassVar[str] = "sources"

    amplitude: Any = number(1.0, help="amplitude of the wave")
    first: Any = number(0.1, 0, open_low=True, unit="Hz", help="frequency at the start, $f_0$")
    last: Any = number(10.0, 0, open_low=True, unit="Hz", help="frequency at the end, $f_1$")
    duration: Any = number(10.0, 0, open_low=True, unit="s", help="time from start to end, $T$")
    phase: Any = number(0.0, unit="rad", help="phase at time 0; a phase of 0 starts as a sine")
    sweep: Literal["linear", "logarithmic"] = static("linear", help="how the frequency changes over time")

    def validate(self) -> None:
        super().validate()
        different = np.all(np.not_equal(self.first, self.last))
        check(different or self.sweep == "linear", "last", self.last, "different from first in a logarithmic sweep")

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        def cycles(time: Array, first: Array, last: Array, duration: Array) -> Array:
            part = time / duration
            if self.sweep == "linear":
                passed = time * (first + 0.5 * (last - first) * part)
            else:
                rate = jnp.log(last / first)
                passed = first * duration / rate * jnp.expm1(rate * part)
            return passed % 1.0

        phase = 2 * jnp.pi * now.exactly(cycles, self.first, self.last, self.duration) + self.phase
        return {"y": self.filled(self.amplitude * jnp.sin(phase))}


@dataclasses.dataclass(frozen=True)
class UniformNoise(Shaped):
    """Independent samples from U[`low`, `high`), drawn at every evaluation and held in between."""

    name: ClassVar[str] = "uniform noise"
    category: ClassVar[str] = "sources"

    low: Any = number(-1.0, help="lower bound, inclusive")
    high: Any = number(1.0, help="upper bound, exclusive")

    def validate(self) -> None:
        super().validate()
        check_limits(self)

    @property
    def uniforms(self) -> int:
        return int(np.prod(self.shape))

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": self.low + (self.high - self.low) * now.uniforms.reshape(self.shape)}


@dataclasses.dataclass(frozen=True)
class NormalNoise(Shaped):
    r"""Independent normal samples, drawn at every evaluation and held in between.

    Their standard deviation is `deviation`, or with `per="root second"` $\sigma/\sqrt h$ for a sample period of $h$
    seconds: white noise whose integral over $T$ seconds has the standard deviation $\sigma\sqrt T$ for any sample
    period.
    """

    name: ClassVar[str] = "normal noise"
    category: ClassVar[str] = "sources"

    mean: Any = number(0.0, help="mean of the samples")
    deviation: Any = number(1.0, 0, help=r"standard deviation, $\sigma$")
    per: Literal["sample", "root second"] = static(
        "sample", help="whether the deviation is per sample or per root second"
    )

    @property
    def uniforms(self) -> int:
        return 2 * ((int(np.prod(self.shape)) + 1) // 2)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        standard = normals(now.uniforms)[: int(np.prod(self.shape))].reshape(self.shape)
        deviation = self.deviation if self.per == "sample" else self.deviation / jnp.sqrt(now.step)
        return {"y": self.mean + deviation * standard}
