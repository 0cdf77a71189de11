"""Control: PID controllers, and nonlinear functions without and with memory."""

import dataclasses
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._errors import check
from motorgrad.schema import number, static
from timlab.blocks._base import Elementwise, check_limits
from timlab.diagram import Moment, Signals


@dataclasses.dataclass(frozen=True)
class _PID(Elementwise):
    proportional_gain: Any = number(1.0, help="gain of the error, $k_P$")
    integral_gain: Any = number(0.0, unit="1/s", help="gain of the integral, $k_I$")
    derivative_gain: Any = number(0.0, unit="s", help="gain of the derivative, $k_D$")
    filter: Any = number(0.1, 0, open_low=True, unit="s", help=r"$\tau$, time constant of the derivative's filter")
    initial: Any = number(0.0, help="initial integral part")
    low: Any = number(-1.0, help="lower limit of the output, if limited")
    high: Any = number(1.0, help="upper limit of the output, if limited")
    tracking: Any = number(1.0, 0, open_low=True, unit="s", help="$T$, time constant of the anti-windup")
    limited: bool = static(False, help="whether the output is clipped to the limits")

    def validate(self) -> None:
        super().validate()
        check_limits(self)

    def init(self, uniforms: Array) -> PyTree[Array]:
        """The integral part, and what the derivative part remembers of the error."""
        return self.filled(self.initial) * 1.0, jnp.zeros(self.shape)

    def _clipped(self, value: Array) -> Array:
        return jnp.clip(value, self.low, self.high) if self.limited else value

    def _correction(self, wanted: Array) -> Array:
        """How far the limits lead an integral back; what does not integrate does not wind up."""
        return jnp.where(self.integral_gain == 0, 0.0, self._clipped(wanted) - wanted)


@dataclasses.dataclass(frozen=True)
class PID(_PID):
    r"""PID controller in continuous time; `u` is the error $e$, reference minus measurement.

    $y = \mathrm{clip}(v)$ with $v = k_P e + I + k_D\,(e - f)/\tau$, where $\tau \dot f = e - f$ filters the derivative
    and $\dot I = k_I e + (y - v)/T$ avoids wind-up at a limit. Where $k_I = 0$, $I$ stays as it is. The filter starts
    at $f = 0$. RK4 is stable for $\tau$ and the tracking time $T$ above 0.4 of its steps.
    """

    name: ClassVar[str] = "PID controller"
    category: ClassVar[str] = "dynamics"

    def _unclipped(self, state: PyTree[Array], error: Array) -> Array:
        integral, filtered = state
        return self.proportional_gain * error + integral + self.derivative_gain * (error - filtered) / self.filter

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": self._clipped(self._unclipped(state, inputs["u"]))}

    def derivative(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        error = inputs["u"]
        wanted = self._unclipped(state, error)
        correction = self._correction(wanted) / self.tracking
        return self.integral_gain * error + correction, (error - state[1]) / self.filter


@dataclasses.dataclass(frozen=True)
class DiscretePID(_PID):
    r"""PID controller in discrete time with sample period $h$; `u` is the error $e$, reference minus measurement.

    $y = \mathrm{clip}(v)$ with $v_t = k_P e_t + I_t + D_t$. The derivative is that of a filtered error, stable for
    every $\tau$: $D_t = (\tau D_{t-1} + k_D\,(e_t - e_{t-1}))/(\tau + h)$ from $e_{-1} = D_{-1} = 0$. The integral
    $I_{t+1} = I_t + h\,k_I e_t + \min(1, h/T)\,(y_t - v_t)$ avoids wind-up at a limit; where $k_I = 0$, it stays as it
    is.
    """

    name: ClassVar[str] = "discrete PID controller"
    category: ClassVar[str] = "dynamics"

    def init(self, uniforms: Array) -> PyTree[Array]:
        return *super().init(uniforms), jnp.zeros(self.shape)

    def _parts(self, state: PyTree[Array], error: Array, now: Moment) -> tuple[Any, Any]:
        """The output before clipping, and its derivative part."""
        integral, before, slope = state
        slope = (self.filter * slope + self.derivative_gain * (error - before)) / (self.filter + now.step)
        return self.proportional_gain * error + integral + slope, slope

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": self._clipped(self._parts(state, inputs["u"], now)[0])}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        error = inputs["u"]
        wanted, slope = self._parts(state, error, now)
        correction = jnp.minimum(1.0, now.step / self.tracking) * self._correction(wanted)
        return state[0] + now.step * self.integral_gain * error + correction, error, slope


@dataclasses.dataclass(frozen=True)
class _Between(Elementwise):
    low: Any = number(-1.0, help="lower limit")
    high: Any = number(1.0, help="upper limit")

    def validate(self) -> None:
        super().validate()
        check_limits(self)

    def crossings(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Array:
        return self._levels(inputs["u"]).ravel()

    def _levels(self, u: Array) -> Any:
        """How far the input is above `high` and below `low`."""
        return jnp.stack([self.filled(u - self.high), self.filled(self.low - u)])


@dataclasses.dataclass(frozen=True)
class Saturation(_Between):
    """Clip the input to `low` … `high`."""

    name: ClassVar[str] = "saturation"
    category: ClassVar[str] = "nonlinear"

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        over, under = now.sides(self._levels(inputs["u"]))
        return {"y": jnp.where(over, self.high, jnp.where(under, self.low, inputs["u"]))}


@dataclasses.dataclass(frozen=True)
class DeadZone(_Between):
    """Zero between `low` and `high`; outside, the distance to the nearer limit, with its sign."""

    name: ClassVar[str] = "dead zone"
    category: ClassVar[str] = "nonlinear"

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        over, under = now.sides(self._levels(inputs["u"]))
        inside = jnp.where(over, self.high, jnp.where(under, self.low, inputs["u"]))
        return {"y": inputs["u"] - inside}


@dataclasses.dataclass(frozen=True)
class Quantiser(Elementwise):
    r"""Round to the nearest multiple of the interval $q$, $y = q \lfloor u/q \rceil$; halves to the even multiple."""

    name: ClassVar[str] = "quantiser"
    category: ClassVar[str] = "nonlinear"

    interval: Any = number(0.1, 0, open_low=True, help="distance between levels, $q$")

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": self.interval * jnp.round(inputs["u"] / self.interval)}


@dataclasses.dataclass(frozen=True)
class Relay(Elementwise):
    """Relay with hysteresis: switches on at an input of at least `high`, off at an input of at most `low`, and stays in
    between.

    A solver that adapts its steps switches it at the instant. Where it would switch without end, as at `low` = `high`,
    its output is the mean that keeps the input at the threshold (Filippov, 1988). Otherwise it is evaluated once at
    each of its ticks.
    """

    name: ClassVar[str] = "relay"
    category: ClassVar[str] = "nonlinear"

    low: Any = number(-0.5, help="input at which it switches off")
    high: Any = number(0.5, help="input at which it switches on")
    off: Any = number(0.0, help="output while off")
    on: Any = number(1.0, help="output while on")
    begins_on: bool = static(False, help="whether it is initially on")

    def validate(self) -> None:
        super().validate()
        check(np.all(np.less_equal(self.low, self.high)), "low", self.low, f"at most high = {self.high}")

    def init(self, uniforms: Array) -> PyTree[Array]:
        return jnp.full(self.shape, self.begins_on)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        on = state if now.above is not None else now.unless_held(self.update(state, inputs, now), state)
        return {"y": now.between(jnp.where(on, self.on, self.off), jnp.where(on, self.off, self.on))}

    @property
    def slides(self) -> slice:
        return slice(None)

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return (inputs["u"] >= self.high) | (state & (inputs["u"] > self.low))

    def crossings(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Array:
        """How far the input is behind the threshold at which it switches next."""
        u = inputs["u"]
        below = self.low - u
        # without hysteresis it is on at the threshold itself: it must not wait there for the other threshold
        below = jnp.where((self.low == self.high) & (u == self.low), -jnp.finfo(below.dtype).tiny, below)
        return jnp.where(state, below, u - self.high).ravel()

    def crossed(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return state ^ now.rising.reshape(self.shape)


class _Follower(Elementwise):
    """Its state is its last output."""

    initial: Any

    def init(self, uniforms: Array) -> PyTree[Array]:
        return self.filled(self.initial)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": self.update(state, inputs, now)}


@dataclasses.dataclass(frozen=True)
class Backlash(_Follower):
    """Mechanical play: the output moves only when the input is more than half of `width` away from it."""

    name: ClassVar[str] = "backlash"
    category: ClassVar[str] = "nonlinear"

    width: Any = number(1.0, 0, help="width of the play")
    initial: Any = number(0.0, help="initial output")

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return jnp.clip(state, inputs["u"] - self.width / 2, inputs["u"] + self.width / 2)


@dataclasses.dataclass(frozen=True)
class RateLimit(_Follower):
    """Follow the input with a limited rate of change. The first evaluation starts from `initial`."""

    name: ClassVar[str] = "rate limit"
    category: ClassVar[str] = "nonlinear"

    rise: Any = number(1.0, 0, unit="1/s", help="largest rate of increase")
    fall: Any = number(1.0, 0, unit="1/s", help="largest rate of decrease")
    initial: Any = number(0.0, help="initial output")

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return jnp.clip(inputs["u"], state - now.step * self.fall, state + now.step * self.rise)
