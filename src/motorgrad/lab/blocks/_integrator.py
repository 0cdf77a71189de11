"""An integral over continuous time."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp

from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port


@dataclasses.dataclass(frozen=True)
class Integrator(Block):
    r"""Integrates, $\dot y = u$ from $y(0) = y_0$, by the classical Runge–Kutta method of fourth order."""

    name: ClassVar[str] = "integrator"
    category: ClassVar[str] = "dynamics"

    initial: Annotated[Any, Parameter("$y_0$")] = 0.0
    shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

    def validate(self) -> None:
        self.check_broadcasts("initial", self.shape)

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, feedthrough=False)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape)}

    def init(self, uniforms: Any) -> Any:
        return jnp.broadcast_to(self.initial, self.shape)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": state}

    def derivative(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return inputs["u"]
