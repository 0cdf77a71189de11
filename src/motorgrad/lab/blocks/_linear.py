"""Linear dynamics in continuous and discrete time: integrators, delays, lags, transfer functions, state space."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab.blocks._base import OneShape, Shaped
from motorgrad.lab.diagram import Block, Moment, Parameter, Port, Ports, Setting, Signals


@dataclasses.dataclass(frozen=True)
class _Memory(OneShape):
    initial: Annotated[Any, Parameter("$y_0$, initial output")] = 0.0
    shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, feedthrough=False)}

    def init(self, uniforms: Any) -> Any:
        return self.filled(self.initial)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": state}


@dataclasses.dataclass(frozen=True)
class Integrator(_Memory):
    r"""Integrator, $\dot y = u$ with $y(0) = y_0$."""

    name: ClassVar[str] = "integrator"
    category: ClassVar[str] = "dynamics"

    def derivative(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return inputs["u"]


@dataclasses.dataclass(frozen=True)
class UnitDelay(_Memory):
    """One-sample delay, $y_t = u_{t-1}$ with $y_0$ at first."""

    name: ClassVar[str] = "unit delay"
    category: ClassVar[str] = "dynamics"

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return inputs["u"]


METHODS = ("forward", "backward", "trapezoid")


@dataclasses.dataclass(frozen=True)
class DiscreteIntegrator(Shaped):
    r"""Discrete-time integrator with sample period $h$, starting at $y_0$; `limited` clips it, without wind-up.

    | method | rule |
    |---|---|
    | `"forward"` | $y_{t+1} = y_t + h\,u_t$ |
    | `"backward"` | $y_t = y_{t-1} + h\,u_t$ |
    | `"trapezoid"` | $y_t = y_{t-1} + h\,(u_{t-1} + u_t)/2$ |

    The integral starts at $y_0$; the latter two rules add $h\,u_0$ or $h\,u_0/2$ to it for the first output. Where
    `reset` is true, the integral is back at $y_0$ at the next evaluation.
    """

    name: ClassVar[str] = "discrete integrator"
    category: ClassVar[str] = "dynamics"

    initial: Annotated[Any, Parameter("$y_0$")] = 0.0
    low: Annotated[Any, Parameter("lower limit, if limited")] = -1.0
    high: Annotated[Any, Parameter("upper limit, if limited")] = 1.0
    method: Annotated[str, Setting("integration rule", choices=METHODS)] = "forward"
    limited: Annotated[bool, Setting("whether the integral is clipped to the limits")] = False

    def validate(self) -> None:
        super().validate()
        check(np.all(np.less(self.low, self.high)), "low", self.low, f"below high = {self.high}")

    @property
    def inputs(self) -> Ports:
        reset = Port((), "bool", feedthrough=False, default=0.0, help="restart at the initial value")
        return {"u": Port(self.shape, feedthrough=self.method != "forward"), "reset": reset}

    def _clipped(self, value: Any) -> Any:
        return jnp.clip(value, self.low, self.high) if self.limited else value

    def _current(self, state: Any, inputs: Signals, now: Moment) -> Any:
        part = {"forward": 0.0, "backward": 1.0, "trapezoid": 0.5}[self.method]
        return self._clipped(state + part * now.step * inputs["u"] if part else state)

    def init(self, uniforms: Any) -> Any:
        return self.filled(self._clipped(self.initial))

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self._current(state, inputs, now)}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        rest = {"forward": 1.0, "backward": 0.0, "trapezoid": 0.5}[self.method]
        after = self._clipped(self._current(state, inputs, now) + rest * now.step * inputs["u"])
        return jnp.where(inputs["reset"], self.init(None), after)


MOST_HELD = 2**22  # numbers in a delay's buffer


@dataclasses.dataclass(frozen=True)
class Delay(Shaped):
    """Delay of `length` samples, $y_t = u_{t-n}$, starting with `initial`: a transport delay."""

    name: ClassVar[str] = "delay"
    category: ClassVar[str] = "dynamics"

    initial: Annotated[Any, Parameter("initial output")] = 0.0
    length: Annotated[int, Setting("$n$, in samples")] = 10

    def validate(self) -> None:
        super().validate()
        most = MOST_HELD // int(np.prod(self.shape))
        check(1 <= self.length <= most, "length", self.length, f"an integer from 1 to {most}")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, feedthrough=False)}

    def init(self, uniforms: Any) -> Any:
        """A ring buffer of inputs, and the index of the oldest one."""
        return jnp.broadcast_to(self.initial, (self.length, *self.shape)) * 1.0, jnp.zeros((), jnp.int32)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        ring, oldest = state
        return {"y": ring[oldest]}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        ring, oldest = state
        return ring.at[oldest].set(inputs["u"]), (oldest + 1) % self.length


@dataclasses.dataclass(frozen=True)
class _Lag(Shaped):
    constant: Annotated[Any, Parameter(r"the time constant $\tau$", unit="s", low=0.0, open=True)] = 1.0
    gain: Annotated[Any, Parameter("$k$, the static gain")] = 1.0
    initial: Annotated[Any, Parameter("initial output")] = 0.0

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, feedthrough=False)}

    def init(self, uniforms: Any) -> Any:
        return self.filled(self.initial)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": state}


@dataclasses.dataclass(frozen=True)
class Lag(_Lag):
    r"""First-order lag in continuous time, $\tau \dot y = k\,u - y$. RK4 is stable for $\tau$ above 0.4 of its
    steps.
    """

    name: ClassVar[str] = "lag"
    category: ClassVar[str] = "dynamics"

    def derivative(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return (self.gain * inputs["u"] - state) / self.constant


@dataclasses.dataclass(frozen=True)
class DiscreteLag(_Lag):
    r"""First-order lag for an input that is held over the sample period $h$; exact, and stable for every $\tau$:
    $y_{t+1} = y_t + (1 - e^{-h/\tau})\,(k\,u_t - y_t)$.
    """

    name: ClassVar[str] = "discrete lag"
    category: ClassVar[str] = "dynamics"

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return state - jnp.expm1(-now.step / self.constant) * (self.gain * inputs["u"] - state)


HIGHEST = 20  # order of a transfer function, limited by single precision


@dataclasses.dataclass(frozen=True)
class _Rational(Block):
    """A rational transfer function in controllable canonical form."""

    numerator: Annotated[Any, Parameter("coefficients of the numerator, highest power first")] = (1.0,)
    denominator: Annotated[
        Any, Parameter("coefficients of the denominator, highest power first; the first is not 0")
    ] = (1.0, 1.0)
    shape: Annotated[tuple[int, ...], Setting("shape of the signals; each element is filtered separately")] = ()

    def validate(self) -> None:
        for name in ("numerator", "denominator"):
            check(np.ndim(getattr(self, name)) == 1, name, getattr(self, name), "a list of coefficients")
        order = len(self.denominator) - 1
        check(1 <= order <= HIGHEST, "denominator", self.denominator, f"2 … {HIGHEST + 1} coefficients")
        check(self.denominator[0] != 0, "denominator", self.denominator, "a list whose first coefficient is not 0")
        proper = len(self.numerator) <= order + 1
        check(proper, "numerator", self.numerator, f"at most {order + 1} coefficients, as many as the denominator has")

    @property
    def _direct(self) -> bool:
        return np.shape(self.numerator) == np.shape(self.denominator)

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, feedthrough=self._direct)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape)}

    def init(self, uniforms: Any) -> Any:
        return jnp.zeros((*self.shape, np.shape(self.denominator)[0] - 1))

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        below = self.denominator[1:] / self.denominator[0]
        above = self.numerator / self.denominator[0]
        if self._direct:
            return {"y": state @ (above[1:] - above[0] * below) + above[0] * inputs["u"]}
        return {"y": state[..., below.shape[0] - above.shape[0] :] @ above}

    def _advanced(self, state: Any, inputs: Signals) -> Any:
        """The next state, or its rate of change: a shift register with feedback."""
        below = self.denominator[1:] / self.denominator[0]
        enters = inputs["u"] - state @ below
        return jnp.concatenate([enters[..., None], state[..., :-1]], axis=-1)


@dataclasses.dataclass(frozen=True)
class TransferFunction(_Rational):
    r"""Transfer function in continuous time, $y = \frac{b_0 s^m + \dots + b_m}{a_0 s^n + \dots + a_n}\,u$, starting at
    rest.

    With a numerator as long as the denominator the input has feedthrough.
    """

    name: ClassVar[str] = "transfer function"
    category: ClassVar[str] = "dynamics"

    def derivative(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return self._advanced(state, inputs)


@dataclasses.dataclass(frozen=True)
class DiscreteTransferFunction(_Rational):
    r"""Transfer function in discrete time, $y = \frac{b_0 z^m + \dots + b_m}{a_0 z^n + \dots + a_n}\,u$, starting at
    rest.

    With a numerator as long as the denominator the input has feedthrough.
    """

    name: ClassVar[str] = "discrete transfer function"
    category: ClassVar[str] = "dynamics"

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return self._advanced(state, inputs)


@dataclasses.dataclass(frozen=True)
class _StateSpace(Block):
    a: Annotated[Any, Parameter("$A$, a square list of rows")] = ((-1.0,),)
    b: Annotated[Any, Parameter("$B$, one row per state; a flat list for a scalar input")] = ((1.0,),)
    c: Annotated[Any, Parameter("$C$, one column per state; a flat list for a scalar output")] = ((1.0,),)
    d: Annotated[Any, Parameter("$D$, one row per output; used if direct")] = 0.0
    initial: Annotated[Any, Parameter("initial state")] = 0.0
    direct: Annotated[bool, Setting("whether the output depends on the input within the tick, through $D$")] = False

    def validate(self) -> None:
        states = np.shape(self.a)[0] if np.ndim(self.a) == 2 else 0
        check(np.shape(self.a) == (states, states) and states, "a", self.a, "a square list of rows")
        fits = np.ndim(self.b) in (1, 2) and np.shape(self.b)[0] == states
        check(fits, "b", self.b, f"a list of {states} numbers, or {states} rows, to match a")
        fits = np.ndim(self.c) in (1, 2) and np.shape(self.c)[-1] == states
        check(fits, "c", self.c, f"a list of {states} numbers, or rows of {states}, to match a")
        check(self.direct or np.all(np.equal(self.d, 0)), "d", self.d, "0 unless direct is true")
        self.check_broadcasts("d", (*self.outputs["y"].shape, *self.inputs["u"].shape))
        self.check_broadcasts("initial", (states,))

    @property
    def inputs(self) -> Ports:
        return {"u": Port(np.shape(self.b)[1:], feedthrough=self.direct)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(np.shape(self.c)[:-1])}

    def init(self, uniforms: Any) -> Any:
        return jnp.broadcast_to(self.initial, np.shape(self.a)[:1])

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        y = self.c @ state
        if self.direct:
            u = inputs["u"]
            y = y + jnp.tensordot(jnp.broadcast_to(self.d, (*y.shape, *u.shape)), u, u.ndim)
        return {"y": y}

    def _advanced(self, state: Any, inputs: Signals) -> Any:
        return self.a @ state + jnp.tensordot(self.b, inputs["u"], inputs["u"].ndim)


@dataclasses.dataclass(frozen=True)
class StateSpace(_StateSpace):
    r"""Linear system in continuous time, $\dot x = A x + B u$, $y = C x + D u$.

    The matrices determine the shapes of the ports.
    """

    name: ClassVar[str] = "state space"
    category: ClassVar[str] = "dynamics"

    def derivative(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return self._advanced(state, inputs)


@dataclasses.dataclass(frozen=True)
class DiscreteStateSpace(_StateSpace):
    """Linear system in discrete time, $x_{t+1} = A x_t + B u_t$, $y_t = C x_t + D u_t$.

    The matrices determine the shapes of the ports.
    """

    name: ClassVar[str] = "discrete state space"
    category: ClassVar[str] = "dynamics"

    a: Annotated[Any, Parameter("$A$, a square list of rows")] = ((0.5,),)

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return self._advanced(state, inputs)
