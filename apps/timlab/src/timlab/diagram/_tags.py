"""Wires without a line: signals that are named."""

import dataclasses
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, PyTree

from motorgrad._errors import check
from motorgrad.schema import Kind, static
from timlab.diagram._block import Block, Moment, Ports, Signals
from timlab.diagram._declarations import Port


@dataclasses.dataclass(frozen=True)
class _Tagged(Block):
    tag: str = static("signal", help="the name of the signal")
    shape: tuple[int, ...] = static((), help="shape of the signal")
    kind: Kind = static("float", help="kind of the signal")

    def validate(self) -> None:
        check(self.tag.strip(), "tag", self.tag, "a name")


@dataclasses.dataclass(frozen=True)
class Goto(_Tagged):
    """Gives a signal a name, its `tag`. Every `From` with this tag outputs it, as if a wire led there: in the same
    diagram, or in subsystems of it that have no `Goto` with this tag themselves.
    """

    name: ClassVar[str] = "goto"
    category: ClassVar[str] = "subsystems"

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, self.kind)}


@dataclasses.dataclass(frozen=True)
class From(_Tagged):
    """The signal that a `Goto` with the same `tag` names."""

    name: ClassVar[str] = "from"
    category: ClassVar[str] = "subsystems"

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape, self.kind)}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        """As without a `Goto`, which a diagram that runs does not lack."""
        return {"y": jnp.zeros(self.shape, self.outputs["y"].dtype)}
