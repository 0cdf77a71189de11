"""Linear dynamics in continuous and discrete time: integrators, delays, lags, transfer functions, state space."""

import dataclasses
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._errors import check
from motorgrad.schema import count, number, static
from timlab.blocks._base import OneShape, Shaped, check_limits
from timlab.diagram import Block, Moment, Port, Ports, Signals, Timing


@dataclasses.dataclass(frozen=True)
class _Memory(OneShape):
    initial: Any = number(0.0, help="$y_0$, initial output")
    shape: tuple[int, ...] = static((), help="shape of the signals")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, feedthrough=False)}

    def init(self, uniforms: Array) -> PyTree[Array]:
        return self.filled(self.initial)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": state}


@dataclasses.dataclass(frozen=True)
class Integrator(_Memory):
    r"""Integrator, $\dot y = u$ with $y(0) = y_0$.

    A solver that adapts its steps resets and limits at the instant; with RK4, resets happen at ticks. Where resets
    would follow each other without end, it rests where they lead to, until the condition would change without it.

        height = Integrator(1.0)
        speed = Integrator(reset="rising", external=True)  # reset: height <= 0; initial: -0.8 * speed
    """

    name: ClassVar[str] = "integrator"
    category: ClassVar[str] = "dynamics"

    low: Any = number(-1.0, help="lower limit, if limited")
    high: Any = number(1.0, help="upper limit, if limited")
    limited: bool = static(
        False,
        help="whether $y$ stays within the limits. At a limit it rests until $u$ points inside, without wind-up",
    )
    reset: Literal["none", "rising", "falling", "either"] = static(
        "none",
        help="which changes of the input `reset` restart the integral, at $y_0$, or if `external` at the input "
        "`initial`, which may depend on $y$ itself. Before the first tick the condition counts as false",
    )
    external: bool = static(False, help="whether a reset restarts at the input initial")

    def validate(self) -> None:
        super().validate()
        check_limits(self)

    @property
    def inputs(self) -> Ports:
        reset = Port((), "bool", feedthrough=False, default=0.0, help="the condition whose changes restart it")
        initial = Port(self.shape, feedthrough=False, help="the value after a reset")
        more = {"reset": reset} if self.reset != "none" else {}
        return {**super().inputs, **more, **({"initial": initial} if self.external and more else {})}

    def _clipped(self, value: Array) -> Array:
        return jnp.clip(value, self.low, self.high) if self.limited else value

    def init(self, uniforms: Array) -> PyTree[Array]:
        return self._clipped(self.filled(self.initial))

    def crossings(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Array:
        u = inputs["u"]
        levels = [state - self.high, self.low - state, u] if self.limited else []
        condition = [jnp.where(inputs["reset"], 1.0, -1.0)] if self.reset != "none" else []
        return jnp.concatenate(
            [jnp.zeros(0), *(self.filled(each).ravel() for each in levels), *map(jnp.ravel, condition)]
        )

    @property
    def slides(self) -> slice:
        return slice(-1, None) if self.reset != "none" else slice(0, 0)

    @property
    def falls(self) -> bool:
        return self.reset == "falling"

    def derivative(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        u = inputs["u"]
        if not self.limited:
            return u
        sides = now.sides(self.crossings(state, inputs, now))
        top, bottom, rises = sides[: 3 * state.size].reshape(3, *self.shape)
        return jnp.where((top & rises) | (bottom & ~rises), 0.0, u)

    def crossed(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        state = self._clipped(state)
        if self.reset == "none":
            return state
        assert now.turned is not None  # in `crossed` it is known
        rises = now.rising[-1]
        turned = now.turned[-1]
        restarts = {"rising": rises, "falling": turned & ~rises, "either": turned}[self.reset]
        begun: Any = inputs.get("initial", self.initial)
        return jnp.where(restarts, self._clipped(self.filled(begun)), state)

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return self._clipped(state)


@dataclasses.dataclass(frozen=True)
class UnitDelay(_Memory):
    """One-sample delay, $y_t = u_{t-1}$ with $y_0$ at first."""

    name: ClassVar[str] = "unit delay"
    category: ClassVar[str] = "dynamics"

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return inputs["u"]


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

    initial: Any = number(0.0, help="initial output, $y_0$")
    low: Any = number(-1.0, help="lower limit, if limited")
    high: Any = number(1.0, help="upper limit, if limited")
    method: Literal["forward", "backward", "trapezoid"] = static("forward", help="integration rule")
    limited: bool = static(False, help="whether the integral is clipped to the limits")

    def validate(self) -> None:
        super().validate()
        check_limits(self)

    @property
    def inputs(self) -> Ports:
        reset = Port((), "bool", feedthrough=False, default=0.0, help="restart at the initial value")
        return {"u": Port(self.shape, feedthrough=self.method != "forward"), "reset": reset}

    def _clipped(self, value: Array) -> Array:
        return jnp.clip(value, self.low, self.high) if self.limited else value

    def _current(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Array:
        part = {"forward": 0.0, "backward": 1.0, "trapezoid": 0.5}[self.method]
        return self._clipped(state + part * now.step * inputs["u"] if part else state)

    def init(self, uniforms: Array) -> PyTree[Array]:
        return self.filled(self._clipped(self.initial))

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": self._current(state, inputs, now)}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        rest = {"forward": 1.0, "backward": 0.0, "trapezoid": 0.5}[self.method]
        after = self._clipped(self._current(state, inputs, now) + rest * now.step * inputs["u"])
        return jnp.where(inputs["reset"], self.filled(self._clipped(self.initial)), after)


MAX_DELAY_NUMBERS = 2**22  # in its buffer


@dataclasses.dataclass(frozen=True)
class Delay(Shaped):
    r"""Delay of `length` samples, $y_t = u_{t-n}$, starting with `initial`: a transport delay.

    With `between="cubic"`, the output moves between its samples too, for continuous signals: a cubic polynomial through
    four neighbours, those with the smallest differences, so that kinks do not ring (essentially non-oscillatory
    interpolation; Harten, Engquist, Osher & Chakravarthy, 1987). The error is of the fourth order in the tick, near a
    bend of the third; a jump of the input is spread over the tick before it.
    """

    name: ClassVar[str] = "delay"
    category: ClassVar[str] = "dynamics"

    initial: Any = number(0.0, help="initial output")
    length: int = count(10, 1, unit="samples", help="$n$, how far the output is behind the input")
    between: Literal["hold", "cubic"] = static("hold", help="what the output does between samples")

    def validate(self) -> None:
        super().validate()
        most = MAX_DELAY_NUMBERS // int(np.prod(self.shape))
        least = 4 if self.between == "cubic" else 1
        check(least <= self.length <= most, "length", self.length, f"an integer from {least} to {most}")
        held = self.between == "hold" or (self.every == 1 and self.period is None)
        check(held, "between", self.between, '"hold" where every or period is given')

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, feedthrough=False)}

    @property
    def timing(self) -> Timing:
        return "continuous" if self.between == "cubic" else super().timing

    def init(self, uniforms: Array) -> PyTree[Array]:
        """A ring buffer of inputs, and the index of the oldest one."""
        kept = self.length + (2 if self.between == "cubic" else 0)
        return jnp.broadcast_to(self.initial, (kept, *self.shape)) * 1.0, jnp.zeros((), jnp.int32)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        ring, oldest = state
        if self.between == "hold":
            return {"y": ring[oldest]}
        near = ring[(oldest + jnp.arange(6)) % ring.shape[0]]
        return {"y": _between(near, jnp.asarray(now.within / now.step, near.dtype))}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        ring, oldest = state
        return ring.at[oldest].set(inputs["u"]), (oldest + 1) % ring.shape[0]


def _between(near: Array, part: Array) -> Array:
    """The value at a `part` of the way from the third to the fourth of six equidistant samples."""
    second = jnp.diff(near, 2, 0)
    third = jnp.diff(near, 3, 0)

    def flatter(one: Array, other: Array) -> Array:
        return jnp.where(jnp.abs(one) <= jnp.abs(other), one, other)

    left = second[1] + flatter(third[0], third[1]) * (part + 1) / 3
    right = second[2] + flatter(third[1], third[2]) * (part - 2) / 3
    bend = jnp.where(jnp.abs(second[1]) <= jnp.abs(second[2]), left, right)
    return near[2] + part * (near[3] - near[2]) + bend * part * (part - 1) / 2


@dataclasses.dataclass(frozen=True)
class _Lag(Shaped):
    constant: Any = number(1.0, 0, open_low=True, unit="s", help=r"the time constant $\tau$")
    gain: Any = number(1.0, help="$k$, the static gain")
    initial: Any = number(0.0, help="initial output")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, feedthrough=False)}

    def init(self, uniforms: Array) -> PyTree[Array]:
        return self.filled(self.initial)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": state}


@dataclasses.dataclass(frozen=True)
class Lag(_Lag):
    r"""First-order lag in continuous time, $\tau \dot y = k\,u - y$. RK4 is stable for $\tau$ above 0.4 of its
    steps.
    """

    name: ClassVar[str] = "lag"
    category: ClassVar[str] = "dynamics"

    def derivative(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return (self.gain * inputs["u"] - state) / self.constant


@dataclasses.dataclass(frozen=True)
class DiscreteLag(_Lag):
    r"""First-order lag for an input that is held over the sample period $h$; exact, and stable for every $\tau$:
    $y_{t+1} = y_t + (1 - e^{-h/\tau})\,(k\,u_t - y_t)$.
    """

    name: ClassVar[str] = "discrete lag"
    category: ClassVar[str] = "dynamics"

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return state - jnp.expm1(-now.step / self.constant) * (self.gain * inputs["u"] - state)


MAX_ORDER = 20  # of a transfer function, limited by single precision


@dataclasses.dataclass(frozen=True)
class _Rational(Block):
    """A rational transfer function in controllable canonical form."""

    numerator: Any = number((1.0,), help="coefficients of the numerator, highest power first")
    denominator: Any = number(
        (1.0, 1.0), help="coefficients of the denominator, highest power first; the first is not 0"
    )
    shape: tuple[int, ...] = static((), help="shape of the signals; each element is filtered separately")

    def validate(self) -> None:
        for name in ("numerator", "denominator"):
            check(np.ndim(getattr(self, name)) == 1, name, getattr(self, name), "a list of coefficients")
        order = len(self.denominator) - 1
        check(1 <= order <= MAX_ORDER, "denominator", self.denominator, f"2 … {MAX_ORDER + 1} coefficients")
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

    def init(self, uniforms: Array) -> PyTree[Array]:
        return jnp.zeros((*self.shape, np.shape(self.denominator)[0] - 1))

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        below = self.denominator[1:] / self.denominator[0]
        above = self.numerator / self.denominator[0]
        if self._direct:
            return {"y": state @ (above[1:] - above[0] * below) + above[0] * inputs["u"]}
        return {"y": state[..., below.shape[0] - above.shape[0] :] @ above}

    def _advanced(self, state: PyTree[Array], inputs: Signals) -> Any:
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

    def derivative(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return self._advanced(state, inputs)


@dataclasses.dataclass(frozen=True)
class DiscreteTransferFunction(_Rational):
    r"""Transfer function in discrete time, $y = \frac{b_0 z^m + \dots + b_m}{a_0 z^n + \dots + a_n}\,u$, starting at
    rest.

    With a numerator as long as the denominator the input has feedthrough.
    """

    name: ClassVar[str] = "discrete transfer function"
    category: ClassVar[str] = "dynamics"

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return self._advanced(state, inputs)


def check_system(a: Any, b: Any, c: Any) -> int:
    """The number of states of a linear system. **Raises** `ValueError` for matrices that do not fit together."""
    states = np.shape(a)[0] if np.ndim(a) == 2 else 0
    check(np.shape(a) == (states, states) and states, "a", a, "a square list of rows")
    fits = np.ndim(b) in (1, 2) and np.shape(b)[0] == states
    check(fits, "b", b, f"a list of {states} numbers, or {states} rows, to match a")
    fits = np.ndim(c) in (1, 2) and np.shape(c)[-1] == states
    check(fits, "c", c, f"a list of {states} numbers, or rows of {states}, to match a")
    return states


@dataclasses.dataclass(frozen=True)
class _StateSpace(Block):
    a: Any = number(((-1.0,),), help="$A$, a square list of rows")
    b: Any = number(((1.0,),), help="$B$, one row per state; a flat list for a scalar input")
    c: Any = number(((1.0,),), help="$C$, one column per state; a flat list for a scalar output")
    d: Any = number(0.0, help="$D$, one row per output; used if direct")
    initial: Any = number(0.0, help="initial state")
    direct: bool = static(False, help="whether the output depends on the input within the tick, through $D$")

    def validate(self) -> None:
        states = check_system(self.a, self.b, self.c)
        check(self.direct or np.all(np.equal(self.d, 0)), "d", self.d, "0 unless direct is true")
        self.check_broadcasts("d", (*self.outputs["y"].shape, *self.inputs["u"].shape))
        self.check_broadcasts("initial", (states,))

    @property
    def inputs(self) -> Ports:
        return {"u": Port(np.shape(self.b)[1:], feedthrough=self.direct)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(np.shape(self.c)[:-1])}

    def init(self, uniforms: Array) -> PyTree[Array]:
        return jnp.broadcast_to(self.initial, np.shape(self.a)[:1])

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        y = self.c @ state
        if self.direct:
            u = inputs["u"]
            y = y + jnp.tensordot(jnp.broadcast_to(self.d, (*y.shape, *u.shape)), u, u.ndim)
        return {"y": y}

    def _advanced(self, state: PyTree[Array], inputs: Signals) -> Any:
        return self.a @ state + jnp.tensordot(self.b, inputs["u"], inputs["u"].ndim)


@dataclasses.dataclass(frozen=True)
class StateSpace(_StateSpace):
    r"""Linear system in continuous time, $\dot x = A x + B u$, $y = C x + D u$.

    The matrices determine the shapes of the ports.
    """

    name: ClassVar[str] = "state space"
    category: ClassVar[str] = "dynamics"

    def derivative(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return self._advanced(state, inputs)


@dataclasses.dataclass(frozen=True)
class DiscreteStateSpace(_StateSpace):
    """Linear system in discrete time, $x_{t+1} = A x_t + B u_t$, $y_t = C x_t + D u_t$.

    The matrices determine the shapes of the ports.
    """

    name: ClassVar[str] = "discrete state space"
    category: ClassVar[str] = "dynamics"

    a: Any = number(((0.5,),), help="$A$, a square list of rows")

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return self._advanced(state, inputs)
