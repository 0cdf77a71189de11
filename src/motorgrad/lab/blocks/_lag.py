"""What follows its input with a lag of first order."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp

from motorgrad.lab._block import Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._shaped import Shaped


@dataclasses.dataclass(frozen=True)
class _Lag(Shaped):
    constant: Annotated[Any, Parameter(r"the time constant $\tau$", unit="s", low=0.0, open=True)] = 1.0
    gain: Annotated[Any, Parameter("$k$, what a constant input is multiplied by in the end")] = 1.0
    initial: Annotated[Any, Parameter("the output at first")] = 0.0

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, feedthrough=False)}

    def init(self, uniforms: Any) -> Any:
        return self.filled(self.initial)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": state}


@dataclasses.dataclass(frozen=True)
class Lag(_Lag):
    r"""A lag of first order in continuous time, $\tau \dot y = k\,u - y$. It wants a $\tau$ above 0.4 RK4 steps."""

    name: ClassVar[str] = "lag"
    category: ClassVar[str] = "dynamics"

    def derivative(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return (self.gain * inputs["u"] - state) / self.constant


@dataclasses.dataclass(frozen=True)
class DiscreteLag(_Lag):
    r"""A lag of first order whose input is held over the sample period $h$, exact and stable for every $\tau$:
    $y_{t+1} = y_t + (1 - e^{-h/\tau})\,(k\,u_t - y_t)$."""

    name: ClassVar[str] = "discrete lag"
    category: ClassVar[str] = "dynamics"

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return state - jnp.expm1(-now.step / self.constant) * (self.gain * inputs["u"] - state)
