"""Controllers with a proportional, an integral and a derivative part."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Moment, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab.blocks._shaped import Elementwise


@dataclasses.dataclass(frozen=True)
class _PID(Elementwise):
    proportional_gain: Annotated[Any, Parameter("$k_P$")] = 1.0
    integral_gain: Annotated[Any, Parameter("$k_I$", unit="1/s")] = 0.0
    derivative_gain: Annotated[Any, Parameter("$k_D$", unit="s")] = 0.0
    filter: Annotated[Any, Parameter(r"the derivative's time constant $\tau$", unit="s", low=0.0, open=True)] = 0.1
    initial: Annotated[Any, Parameter("the integral part at first")] = 0.0
    low: Annotated[Any, Parameter("the least output, if limited")] = -1.0
    high: Annotated[Any, Parameter("the greatest output, if limited")] = 1.0
    tracking: Annotated[Any, Parameter("$T$, how fast it unwinds at a limit", unit="s", low=0.0, open=True)] = 1.0
    limited: Annotated[bool, Setting("whether the output has limits")] = False

    def validate(self) -> None:
        super().validate()
        check(isinstance(self.limited, bool), "limited", self.limited, "true or false")
        check(np.all(np.less(self.low, self.high)), "low", self.low, f"below high = {self.high}")

    def init(self, uniforms: Any) -> Any:
        """The integral part, and what the derivative part remembers of the error."""
        return self.filled(self.initial) * 1.0, jnp.zeros(self.shape)

    def _limited(self, value: Any) -> Any:
        return jnp.clip(value, self.low, self.high) if self.limited else value


@dataclasses.dataclass(frozen=True)
class PID(_PID):
    r"""A controller in continuous time; `u` is the error $e$, reference less measurement.

    $y = \mathrm{clip}(v)$ with $v = k_P e + I + k_D\,(e - f)/\tau$, where $\tau \dot f = e - f$ is the filter of the
    derivative and $\dot I = k_I e + (y - v)/T$ does not wind up at a limit. It starts with $f = 0$. It wants $\tau$ and
    the tracking time $T$ above 0.4 RK4 steps.
    """

    name: ClassVar[str] = "PID controller"
    category: ClassVar[str] = "dynamics"

    def _wanted(self, state: Any, error: Any) -> Any:
        integral, filtered = state
        return self.proportional_gain * error + integral + self.derivative_gain * (error - filtered) / self.filter

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self._limited(self._wanted(state, inputs["u"]))}

    def derivative(self, state: Any, inputs: Signals, now: Moment) -> Any:
        error = inputs["u"]
        wanted = self._wanted(state, error)
        back = (self._limited(wanted) - wanted) / self.tracking
        return self.integral_gain * error + back, (error - state[1]) / self.filter


@dataclasses.dataclass(frozen=True)
class DiscretePID(_PID):
    r"""A controller that is evaluated once in a sample period $h$; `u` is the error $e$, reference less measurement.

    $y = \mathrm{clip}(v)$ with $v_t = k_P e_t + I_t + D_t$, where the derivative is that of a filtered error, stable
    for every $\tau$: $D_t = (\tau D_{t-1} + k_D\,(e_t - e_{t-1}))/(\tau + h)$ from $e_{-1} = D_{-1} = 0$, and
    $I_{t+1} = I_t + h\,k_I e_t + \min(1, h/T)\,(y_t - v_t)$ does not wind up at a limit.
    """

    name: ClassVar[str] = "discrete PID controller"
    category: ClassVar[str] = "dynamics"

    def init(self, uniforms: Any) -> Any:
        return *super().init(uniforms), jnp.zeros(self.shape)

    def _parts(self, state: Any, error: Any, now: Moment) -> tuple[Any, Any]:
        """The output before its limits, and its derivative part."""
        integral, before, slope = state
        slope = (self.filter * slope + self.derivative_gain * (error - before)) / (self.filter + now.step)
        return self.proportional_gain * error + integral + slope, slope

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self._limited(self._parts(state, inputs["u"], now)[0])}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        error = inputs["u"]
        wanted, slope = self._parts(state, error, now)
        back = jnp.minimum(1.0, now.step / self.tracking) * (self._limited(wanted) - wanted)
        return state[0] + now.step * self.integral_gain * error + back, error, slope
