"""A sum over discrete time."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._shaped import Shaped

METHODS = ("forward", "backward", "trapezoid")


@dataclasses.dataclass(frozen=True)
class DiscreteIntegrator(Shaped):
    r"""Integrates in steps of its sample period $h$, from $y_0$; within limits if `limited`, without winding up.

    | method | rule |
    |---|---|
    | `"forward"` | $y_{t+1} = y_t + h\,u_t$ |
    | `"backward"` | $y_t = y_{t-1} + h\,u_t$ |
    | `"trapezoid"` | $y_t = y_{t-1} + h\,(u_{t-1} + u_t)/2$ |

    The first value is $y_0$, to which the latter two already add $h\,u_0$ or $h\,u_0/2$. Where `reset` is true, it is
    at $y_0$ again at the next evaluation, as it was at the first.
    """

    name: ClassVar[str] = "discrete integrator"
    category: ClassVar[str] = "dynamics"

    initial: Annotated[Any, Parameter("$y_0$")] = 0.0
    low: Annotated[Any, Parameter("the lower limit, if limited")] = -1.0
    high: Annotated[Any, Parameter("the upper limit, if limited")] = 1.0
    method: Annotated[str, Setting("the rule", choices=METHODS)] = "forward"
    limited: Annotated[bool, Setting("whether it stays within the limits")] = False

    def validate(self) -> None:
        super().validate()
        check(isinstance(self.limited, bool), "limited", self.limited, "true or false")
        check(np.all(np.less(self.low, self.high)), "low", self.low, f"below high = {self.high}")

    @property
    def inputs(self) -> Ports:
        reset = Port((), "bool", feedthrough=False, default=0.0, help="begin again")
        return {"u": Port(self.shape, feedthrough=self.method != "forward"), "reset": reset}

    def _within(self, value: Any) -> Any:
        return jnp.clip(value, self.low, self.high) if self.limited else value

    def _now(self, state: Any, inputs: Signals, now: Moment) -> Any:
        part = {"forward": 0.0, "backward": 1.0, "trapezoid": 0.5}[self.method]
        return self._within(state + part * now.step * inputs["u"] if part else state)

    def init(self, uniforms: Any) -> Any:
        return self.filled(self._within(self.initial))

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self._now(state, inputs, now)}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        rest = {"forward": 1.0, "backward": 0.0, "trapezoid": 0.5}[self.method]
        after = self._within(self._now(state, inputs, now) + rest * now.step * inputs["u"])
        return jnp.where(inputs["reset"], self.init(None), after)
