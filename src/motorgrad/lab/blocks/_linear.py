"""Linear systems: transfer functions, and state space, in continuous and in discrete time."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port

HIGHEST = 20  # order of a transfer function; single precision carries no more


@dataclasses.dataclass(frozen=True)
class _Rational(Block):
    """A quotient of polynomials, in the controllable canonical form."""

    numerator: Annotated[Any, Parameter("its coefficients, of the highest power first")] = (1.0,)
    denominator: Annotated[Any, Parameter("its coefficients, in the same order; the first is not 0")] = (1.0, 1.0)
    shape: Annotated[tuple[int, ...], Setting("shape of the signals; every element is filtered by itself")] = ()

    def validate(self) -> None:
        for name in ("numerator", "denominator"):
            check(np.ndim(getattr(self, name)) == 1, name, getattr(self, name), "a list of coefficients")
        order = len(self.denominator) - 1
        check(1 <= order <= HIGHEST, "denominator", self.denominator, f"of 2 … {HIGHEST + 1} coefficients")
        check(self.denominator[0] != 0, "denominator", self.denominator, "a list whose first coefficient is not 0")
        proper = len(self.numerator) <= order + 1
        check(proper, "numerator", self.numerator, f"of at most {order + 1} coefficients, as the denominator has")

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

    def _moved(self, state: Any, inputs: Signals) -> Any:
        """The next state, or its rate of change: what enters, and the other variables one place further."""
        below = self.denominator[1:] / self.denominator[0]
        enters = inputs["u"] - state @ below
        return jnp.concatenate([enters[..., None], state[..., :-1]], axis=-1)


@dataclasses.dataclass(frozen=True)
class TransferFunction(_Rational):
    r"""A linear filter in continuous time, $y = \frac{b_0 s^m + \dots + b_m}{a_0 s^n + \dots + a_n}\,u$, from rest.

    A numerator as long as the denominator passes its input on at once.
    """

    name: ClassVar[str] = "transfer function"
    category: ClassVar[str] = "dynamics"

    def derivative(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return self._moved(state, inputs)


@dataclasses.dataclass(frozen=True)
class DiscreteTransferFunction(_Rational):
    r"""A linear filter in discrete time, $y = \frac{b_0 z^m + \dots + b_m}{a_0 z^n + \dots + a_n}\,u$, from rest.

    A numerator as long as the denominator passes its input on at once.
    """

    name: ClassVar[str] = "discrete transfer function"
    category: ClassVar[str] = "dynamics"

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return self._moved(state, inputs)


@dataclasses.dataclass(frozen=True)
class _StateSpace(Block):
    a: Annotated[Any, Parameter("$A$, a list of as many rows as columns")] = ((-1.0,),)
    b: Annotated[Any, Parameter("$B$, a row for each state; a plain list if the input is one number")] = ((1.0,),)
    c: Annotated[Any, Parameter("$C$, a column for each state; a plain list if the output is one number")] = ((1.0,),)
    d: Annotated[Any, Parameter("$D$, a row for each output; used if direct")] = 0.0
    initial: Annotated[Any, Parameter("the state at first")] = 0.0
    direct: Annotated[bool, Setting("whether the output depends on the input at once, by $D$")] = False

    def validate(self) -> None:
        states = np.shape(self.a)[0] if np.ndim(self.a) == 2 else 0
        check(np.shape(self.a) == (states, states) and states, "a", self.a, "a list of as many rows as columns")
        fits = np.ndim(self.b) in (1, 2) and np.shape(self.b)[0] == states
        check(fits, "b", self.b, f"a list of {states} numbers, or of {states} rows, as a has")
        fits = np.ndim(self.c) in (1, 2) and np.shape(self.c)[-1] == states
        check(fits, "c", self.c, f"a list of {states} numbers, or of rows of {states}, as a has")
        check(isinstance(self.direct, bool), "direct", self.direct, "true or false")
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

    def _moved(self, state: Any, inputs: Signals) -> Any:
        return self.a @ state + jnp.tensordot(self.b, inputs["u"], inputs["u"].ndim)


@dataclasses.dataclass(frozen=True)
class StateSpace(_StateSpace):
    r"""A linear system in continuous time, $\dot x = A x + B u$, $y = C x + D u$.

    Matrices set the ports' shapes.
    """

    name: ClassVar[str] = "state space"
    category: ClassVar[str] = "dynamics"

    def derivative(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return self._moved(state, inputs)


@dataclasses.dataclass(frozen=True)
class DiscreteStateSpace(_StateSpace):
    r"""A linear system in discrete time, $x_{t+1} = A x_t + B u_t$, $y_t = C x_t + D u_t$.

    Matrices set the ports' shapes.
    """

    name: ClassVar[str] = "discrete state space"
    category: ClassVar[str] = "dynamics"

    a: Annotated[Any, Parameter("$A$, a list of as many rows as columns")] = ((0.5,),)

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return self._moved(state, inputs)
