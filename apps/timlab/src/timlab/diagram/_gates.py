"""Enabled and triggered subsystems: their blocks rest while a condition does not hold."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from motorgrad.schema import Declared, static
from timlab.diagram._block import Block, Moment, Ports, Signals, Timing
from timlab.diagram._declarations import Port


@dataclasses.dataclass(frozen=True)
class Gate(Block):
    """A block that decides when the subsystem that contains it is evaluated. It gives the subsystem an input, named
    like the block.
    """

    @property
    def port(self) -> Port:
        """The input port that it gives the subsystem."""
        return Port((), "bool", default=0.0, help="the condition under which the subsystem is evaluated")

    @property
    def outputs(self) -> Ports:
        return {"y": Port((), "bool")}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        """As in the outermost diagram, which is always evaluated."""
        return {"y": jnp.asarray(True)}


@dataclasses.dataclass(frozen=True)
class Enable(Gate):
    """Evaluate the subsystem only while a condition holds, the input that this block gives the subsystem.

    Otherwise all blocks of the subsystem keep their states and outputs; outputs that need an input are 0 before the
    first evaluation. The condition counts from tick to tick, also with solvers that locate zero crossings, and relays
    inside switch at ticks. Output: whether the subsystem is evaluated. Without a wire from outside, it always is.
    """

    name: ClassVar[str] = "enable"
    category: ClassVar[str] = "subsystems"


@dataclasses.dataclass(frozen=True)
class Trigger(Gate):
    """Evaluate the subsystem once whenever a condition changes, the input that this block gives the subsystem.

    In between, its blocks rest as under `Enable`. Before the first tick the condition counts as false.
    """

    name: ClassVar[str] = "trigger"
    category: ClassVar[str] = "subsystems"

    on: Literal["rising", "falling", "either"] = static("rising", help="which changes of the condition count")


@dataclasses.dataclass(frozen=True)
class Condition(Block):
    """A gate in the flat list of blocks: whether it is open in this tick."""

    on: str = static("", help="which changes open it; empty where the condition itself does")

    @property
    def inputs(self) -> Ports:
        return {"u": Port((), "bool", default=0.0 if self.on else 1.0)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port((), "bool")}

    @property
    def timing(self) -> Timing:
        return "discrete"

    def init(self, uniforms: Array) -> PyTree[Array]:
        return jnp.asarray(False)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        u = inputs["u"]
        rises = u & ~state
        falls = state & ~u
        return {"y": {"": u, "rising": rises, "falling": falls, "either": rises | falls}[self.on]}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return inputs["u"]


@dataclasses.dataclass(frozen=True)
class Gated(Block):
    """A block behind gates, in the flat list of blocks: it is evaluated in ticks in which all of them are open.

    Its state is that of the `inner` block, and its last outputs where they depend on more than the state.
    """

    inner: Block
    gates: int

    @staticmethod
    def port(number: int) -> str:
        """The name of the input for a gate."""
        return f"gate {number}"

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.__dict__["inner"], name)

    @property
    def inputs(self) -> Ports:
        gate = Port((), "bool", feedthrough=self._holds)
        return {**self.inner.inputs, **{self.port(number): gate for number in range(self.gates)}}

    @property
    def outputs(self) -> Ports:
        return self.inner.outputs

    @property
    def uniforms(self) -> int:
        return self.inner.uniforms

    @property
    def init_uniforms(self) -> int:
        return self.inner.init_uniforms

    @property
    def timing(self) -> Timing:
        return self.inner.timing

    @property
    def is_continuous(self) -> bool:
        return self.inner.is_continuous

    @property
    def jumps(self) -> bool:
        return self.inner.jumps

    @property
    def switches(self) -> bool:
        return self.inner.switches and self.is_continuous

    @property
    def parameters(self) -> Mapping[str, Declared]:
        return self.inner.parameters

    @property
    def structure(self) -> Any:
        return self.gates, type(self.inner), self.inner.structure

    def values(self) -> Any:
        return self.inner.values()

    def retuned(self, values: Mapping[str, Any]) -> Self:
        return dataclasses.replace(self, inner=self.inner.retuned(values))

    def bound(self, values: Mapping[str, Any]) -> Self:
        other = super().bound({})
        other.__dict__["inner"] = self.inner.bound(values)
        return other

    @property
    def _holds(self) -> bool:
        """Whether outputs depend on more than the state, so that they are kept."""
        direct = any(port.feedthrough for port in self.inner.inputs.values())
        moves = self.timing == "continuous" and not self.is_continuous
        return direct or self.inner.timed or moves or self.uniforms > 0

    def _open(self, inputs: Signals) -> Array:
        return jnp.all(jnp.stack([inputs[self.port(number)] for number in range(self.gates)]))

    def _chosen(self, inputs: Signals, new: PyTree[Array], old: PyTree[Array]) -> PyTree[Array]:
        opened = self._open(inputs)
        return jax.tree.map(lambda a, b: jnp.where(opened, a, b).astype(b.dtype), new, old)

    def init(self, uniforms: Array) -> PyTree[Array]:
        kept = self.outputs if self._holds else {}
        real = self.is_continuous  # whose state consists of floats
        last = {name: jnp.zeros(port.shape, None if real else port.dtype) for name, port in kept.items()}
        return self.inner.init(uniforms), last

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        own, last = state
        given = self.inner.output(own, inputs, now)
        if not self._holds:
            return given
        kept = {name: last[name].astype(port.dtype) for name, port in self.outputs.items()}
        return self._chosen(inputs, {name: given[name] for name in kept}, kept)

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        own, last = state
        given = self.inner.output(own, inputs, now) if self._holds else {}
        after = self.inner.update(own, inputs, now)
        return self._chosen(inputs, (after, {name: given[name] for name in last}), (own, last))

    def derivative(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        still = jax.tree.map(jnp.zeros_like, state)
        return self._chosen(inputs, (self.inner.derivative(state[0], inputs, now), still[1]), still)

    def next_jump(self, now: Moment) -> Array:
        return self.inner.next_jump(now)

    def crossings(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Array:
        return self.inner.crossings(state[0], inputs, now)

    def crossed(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        return self._chosen(inputs, (self.inner.crossed(state[0], inputs, now), state[1]), state)
