"""The muscle law as a block."""

import dataclasses
import types
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp

from motorgrad.bodies import tension
from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port

# The very function of the physics, whose one call of NumPy is made JAX's: the law stays written in one place.
_tension = types.FunctionType(tension.__code__, {**tension.__globals__, "np": jnp}, "tension", tension.__defaults__)


@dataclasses.dataclass(frozen=True)
class MuscleLaw(Block):
    r"""The tension of a muscle, $F = a f_\max \exp(-(L/r - 1)^2/k) + d\,\dot L$ (`motorgrad.bodies.tension`)."""

    name: ClassVar[str] = "muscle"
    category: ClassVar[str] = "bodies and worlds"

    strength: Annotated[Any, Parameter(r"$f_\max$, greatest force", "N", low=0.0)] = 100.0
    rest_length: Annotated[Any, Parameter("$r$, where the force is greatest", "m", low=1e-6)] = 0.2
    curve: Annotated[Any, Parameter("$k$; the larger, the flatter over length", low=1e-6)] = 0.5
    damping: Annotated[Any, Parameter("$d$", "N s/m", low=0.0)] = 0.0
    shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

    def validate(self) -> None:
        for name in ("strength", "rest_length", "curve", "damping"):
            self.check_broadcasts(name, self.shape)

    @property
    def inputs(self) -> Ports:
        return {
            "activation": Port(self.shape, help="from 0 to 1"),
            "length": Port(self.shape, unit="m"),
            "velocity": Port(self.shape, default=0.0, unit="m/s", help="positive while it is stretched"),
        }

    @property
    def outputs(self) -> Ports:
        return {"tension": Port(self.shape, unit="N", help="positive when it pulls")}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        moved = (jnp.clip(inputs["activation"], 0, 1), inputs["length"], inputs["velocity"])
        return {"tension": _tension(*moved, self.strength, self.rest_length, self.curve, self.damping)}
