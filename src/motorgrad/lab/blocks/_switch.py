"""One of several signals."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp

from motorgrad._errors import check
from motorgrad.lab._block import Moment, Ports, Signals
from motorgrad.lab._parameter import Setting
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._shaped import Shaped
from motorgrad.lab.blocks._vectors import MOST


@dataclasses.dataclass(frozen=True)
class Switch(Shaped):
    """Gives `on` where its condition is true, else `off`, element by element."""

    name: ClassVar[str] = "switch"
    category: ClassVar[str] = "logic"

    @property
    def inputs(self) -> Ports:
        return {"condition": Port(self.shape, "bool"), "on": Port(self.shape), "off": Port(self.shape)}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": jnp.where(inputs["condition"], inputs["on"], inputs["off"])}


@dataclasses.dataclass(frozen=True)
class MultiSwitch(Shaped):
    """Gives the input whose number is `index`: `u0`, `u1`, …; the nearest one for a number beyond."""

    name: ClassVar[str] = "multi-switch"
    category: ClassVar[str] = "logic"

    count: Annotated[int, Setting("how many inputs there are to choose from")] = 2

    def validate(self) -> None:
        super().validate()
        check_count("count", self.count)

    @property
    def inputs(self) -> Ports:
        return {"index": Port((), "int"), **{f"u{number}": Port(self.shape) for number in range(self.count)}}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        choices = jnp.stack([inputs[f"u{number}"] for number in range(self.count)])
        return {"y": choices[jnp.clip(inputs["index"], 0, self.count - 1)]}


def check_count(name: str, count: Any) -> None:
    """Refuse what is no number of inputs."""
    whole = isinstance(count, int) and not isinstance(count, bool)
    check(whole and 1 <= count <= MOST, name, count, f"a whole number in 1 … {MOST}")
