"""What happens at events: counting, and holding a sample."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp

from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._shaped import Shaped

EDGES = ("rising", "falling", "either", "true")
WHEN = "what is an event: a change of the condition, or every evaluation at which it is true"


def event(edge: str, before: Any, now: Any) -> Any:
    """Where an event is, of a condition that was `before` and is `now`."""
    if edge == "true":
        return now
    return {"rising": now & ~before, "falling": before & ~now, "either": now ^ before}[edge]


@dataclasses.dataclass(frozen=True)
class Counter(Block):
    """Counts events of its input, this one among them. It starts again from 0 after `modulus` − 1 if that is not 0, and
    where `reset` is true. Before the first evaluation the condition counts as false.
    """

    name: ClassVar[str] = "counter"
    category: ClassVar[str] = "logic"

    modulus: Annotated[Any, Parameter("it counts 0 … modulus − 1; 0 for no end", kind="int", low=0)] = 0
    edge: Annotated[str, Setting(WHEN, choices=EDGES)] = "rising"
    shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

    def validate(self) -> None:
        self.check_broadcasts("modulus", self.shape)

    @property
    def inputs(self) -> Ports:
        return {
            "u": Port(self.shape, "bool"),
            "reset": Port((), "bool", default=0.0, help="to 0, whatever else happens"),
        }

    @property
    def outputs(self) -> Ports:
        return {"count": Port(self.shape, "int")}

    def init(self, uniforms: Any) -> Any:
        """The count, and the condition as it was."""
        return jnp.zeros(self.shape, jnp.int32), jnp.zeros(self.shape, bool)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"count": self.update(state, inputs, now)[0]}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        count, before = state
        count = count + event(self.edge, before, inputs["u"]).astype(jnp.int32)
        count = jnp.where(self.modulus > 0, count % jnp.maximum(self.modulus, 1), count)
        return jnp.where(inputs["reset"], 0, count), inputs["u"]


@dataclasses.dataclass(frozen=True)
class SampleAndHold(Shaped):
    """Gives its input as it was at the last event of the condition `sample`, and `initial` before the first."""

    name: ClassVar[str] = "sample and hold"
    category: ClassVar[str] = "logic"

    initial: Annotated[Any, Parameter("what it gives before the first sample")] = 0.0
    edge: Annotated[str, Setting(WHEN, choices=EDGES)] = "rising"

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape), "sample": Port((), "bool")}

    def init(self, uniforms: Any) -> Any:
        """What is held, and the condition as it was."""
        return self.filled(self.initial), jnp.zeros((), bool)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": self.update(state, inputs, now)[0]}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        held, before = state
        return jnp.where(event(self.edge, before, inputs["sample"]), inputs["u"], held), inputs["sample"]
