"""Diagrams: blocks by name, and wires from outputs to inputs. A diagram is itself a block of other diagrams."""

import dataclasses
from collections.abc import Iterator
from typing import Any, Self

import numpy as np

from motorgrad._errors import check, unknown
from motorgrad.lab._block import Block, Ports
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._boundary import Inlet, Outlet

End = tuple[str, str]
"""One end of a wire: the name of a block in the diagram, and of one of its ports."""
LONGEST = 100  # characters of a name


@dataclasses.dataclass(frozen=True)
class Node:
    """A block in a diagram. Its `id` stays when it is renamed or moved: its random numbers and its state go by it."""

    block: "Block | Diagram"
    id: str


class Diagram:
    """Blocks that are wired to each other.

    `Inlet` and `Outlet` blocks in it are its own ports where it is part of another diagram; as a whole, an inlet is a
    number that may be set while it runs, and an outlet a record.

    **Arguments:** the `tick`, in seconds; `substeps`, how many RK4 steps there are in one. Both count for the outermost
    diagram only. A `title` and a `comment`, for people.

    `nodes` (by name), `wires` (the source of every connected input) and `layout` (where an editor has put the blocks,
    and what else it wants to keep there; the engine does not look at it) are plain dictionaries to read.
    """

    def __init__(self, tick: float = 0.01, substeps: int = 1, title: str = "", comment: str = ""):
        number = isinstance(tick, int | float) and not isinstance(tick, bool)
        check(number and 0 < tick < np.inf, "tick", tick, "a positive number of seconds")
        whole = isinstance(substeps, int) and not isinstance(substeps, bool)
        check(whole and 1 <= substeps <= 1000, "substeps", substeps, "a whole number in 1 … 1000")
        self.tick, self.substeps = float(tick), substeps
        self.title, self.comment = title, comment
        self.nodes: dict[str, Node] = {}
        self.wires: dict[End, End] = {}
        self.layout: dict[str, Any] = {}

    def add(self, name: str, block: "Block | Diagram", id: str | None = None) -> str:
        """Put a block, or a diagram as a subsystem, into the diagram.

        **Arguments:** its `name`, new, without `.` and `/`; the block; its `id`, by default the name, or where that is
        taken the name with a number. A subsystem with the id `""` leaves the ids of what is in it as they are.

        **Returns** the name.
        """
        _check_name(name)
        check(name not in self.nodes, "name", name, "a new one in the diagram")
        check(isinstance(block, Block | Diagram), name, block, "a block or a diagram")
        check(
            not isinstance(block, Diagram) or not block.holds(self),
            name,
            block,
            "a diagram that does not hold this one",
        )
        taken = {node.id for node in self.nodes.values()}
        if id is None:
            id = next(new for new in _numbered(name) if new not in taken)
        elif id != "" or not isinstance(block, Diagram):
            _check_name(id, "id")
            check(id not in taken, "id", id, "a new one in the diagram")
        self.nodes[name] = Node(block, id)
        return name

    def remove(self, name: str) -> None:
        """Take a block out, and the wires at it."""
        self._node(name)
        del self.nodes[name]
        self.wires = {to: source for to, source in self.wires.items() if name not in (to[0], source[0])}

    def rename(self, old: str, new: str) -> None:
        """Give a block another name. Its place, wires and id stay."""
        self._node(old)
        _check_name(new)
        check(new == old or new not in self.nodes, "name", new, "a new one in the diagram")

        def swap(end: End) -> End:
            return (new, end[1]) if end[0] == old else end

        self.nodes = {new if name == old else name: node for name, node in self.nodes.items()}
        self.wires = {swap(to): swap(source) for to, source in self.wires.items()}

    def replace(self, name: str, block: "Block | Diagram") -> None:
        """Put another block in the place of one, with its id; wires at ports that the new one has not are taken out."""
        node = self._node(name)
        check(isinstance(block, Block | Diagram), name, block, "a block or a diagram")
        self.nodes[name] = dataclasses.replace(node, block=block)
        inputs, outputs = block.inputs, block.outputs
        lost = {(t, s) for t, s in self.wires.items() if t[0] == name and t[1] not in inputs}
        lost |= {(t, s) for t, s in self.wires.items() if s[0] == name and s[1] not in outputs}
        self.wires = {t: s for t, s in self.wires.items() if (t, s) not in lost}

    def connect(self, source: str, target: str) -> None:
        """Lead a wire from an output, `"block.port"`, to an input; the port may be left out where there is one only.

        Shapes and kinds are checked when the diagram is compiled, or by `misfit`.
        """
        start, end = self._end(source, "outputs"), self._end(target, "inputs")
        held = self.wires.get(end)
        check(held is None, ".".join(end), source, f"disconnected first: {'.'.join(held or ())} leads there")
        self.wires[end] = start

    def disconnect(self, target: str) -> None:
        """Take out the wire to an input."""
        end = self._end(target, "inputs")
        check(end in self.wires, "target", target, "an input with a wire")
        del self.wires[end]

    def misfit(self, source: str, target: str) -> str | None:
        """Why a wire from an output to an input would be wrong; `None` where it fits."""
        try:
            start, end = self._end(source, "outputs"), self._end(target, "inputs")
        except ValueError as error:
            return str(error)
        given, wanted = self.nodes[start[0]].block.outputs[start[1]], self.nodes[end[0]].block.inputs[end[1]]
        return misfit(".".join(start), given, ".".join(end), wanted)

    @property
    def inputs(self) -> Ports:
        """Its input ports: the inlets by name."""
        return {name: block.port for name, block in self._of(Inlet)}

    @property
    def outputs(self) -> Ports:
        """Its output ports: the outlets by name."""
        return {name: block.port for name, block in self._of(Outlet)}

    def holds(self, other: "Diagram") -> bool:
        """Whether `other` is this diagram or in it, at any depth."""
        inner = [node.block for node in self.nodes.values() if isinstance(node.block, Diagram)]
        return self is other or any(diagram.holds(other) for diagram in inner)

    def copy(self) -> Self:
        """The same diagram, to be changed by itself; subsystems are copied too."""
        other = type(self)(self.tick, self.substeps, self.title, self.comment)
        for name, node in self.nodes.items():
            block = node.block.copy() if isinstance(node.block, Diagram) else node.block
            other.nodes[name] = Node(block, node.id)
        other.wires, other.layout = dict(self.wires), dict(self.layout)
        return other

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Diagram) and self._content() == other._content()

    __hash__ = object.__hash__

    def __repr__(self) -> str:
        return f"Diagram({self.title!r}, {len(self.nodes)} blocks, {len(self.wires)} wires)"

    def _content(self) -> tuple[Any, ...]:
        return self.tick, self.substeps, self.title, self.comment, list(self.nodes.items()), self.wires, self.layout

    def _of(self, kind: type[Any]) -> Iterator[tuple[str, Any]]:
        return ((name, node.block) for name, node in self.nodes.items() if isinstance(node.block, kind))

    def _node(self, name: str) -> Node:
        if name not in self.nodes:
            raise unknown("block", name, self.nodes)
        return self.nodes[name]

    def _end(self, address: str, side: str) -> End:
        check(isinstance(address, str), side.removesuffix("s"), address, 'an address, "block.port"')
        name, _, port = address.partition(".")
        ports = getattr(self._node(name).block, side)
        if not port and len(ports) == 1:
            return name, next(iter(ports))
        if port not in ports:
            raise unknown(f"{side.removesuffix('s')} of {name}:", port, ports)
        return name, port


def misfit(source: str, given: Port, target: str, wanted: Port) -> str | None:
    """Why an output's port does not fit an input's, in one line; `None` where it does."""
    if wanted.takes(given):
        return None
    return f"{target}: takes {wanted.described()}, but {source} gives {given.described()}"


def _numbered(name: str) -> Iterator[str]:
    yield name
    number = 2
    while True:
        yield f"{name} {number}"
        number += 1


def _check_name(name: Any, what: str = "name") -> None:
    text = isinstance(name, str) and 0 < len(name) <= LONGEST and name.isprintable() and name == name.strip()
    plain = text and not {".", "/"} & set(name)
    check(plain, what, name, f"a text of 1 … {LONGEST} characters without '.' and '/'")
