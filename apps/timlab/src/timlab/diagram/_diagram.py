"""Diagrams: named blocks, and wires from outputs to inputs. A diagram is itself a block of other diagrams."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar, Self

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._arguments import check_arguments
from motorgrad._errors import check, choice, counted, unknown
from motorgrad.schema import Kind, number, plain_numbers, static
from timlab.diagram._block import Block, Moment, Ports, Signals, Sink
from timlab.diagram._declarations import SHARED, Port
from timlab.diagram._gates import Gate
from timlab.diagram._shapes import fitted


@dataclasses.dataclass(frozen=True)
class Inlet(Block):
    """An input of the diagram that contains it. Without a wire from outside it outputs its `value`.

    In the outermost diagram it is an external input: `value` is a parameter like any other and can be set between
    ticks.
    """

    name: ClassVar[str] = "inlet"
    category: ClassVar[str] = "subsystems"

    value: Any = number(0.0, help="the output where no wire leads to the inlet")
    shape: tuple[int, ...] = static((), help="shape of the signal")
    kind: Kind = static("float", help="kind of the signal")

    def validate(self) -> None:
        self.check_broadcasts("value", self.shape)

    @property
    def port(self) -> Port:
        """The input port that it gives the subsystem."""
        return Port(self.shape, self.kind, default=0.0)

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape, self.kind)}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": jnp.broadcast_to(self.value, self.shape).astype(self.port.dtype)}


@dataclasses.dataclass(frozen=True)
class Outlet(Sink):
    """An output of the diagram that contains it. In the outermost diagram it is recorded."""

    name: ClassVar[str] = "outlet"
    category: ClassVar[str] = "subsystems"

    shape: tuple[int, ...] = static((), help="shape of the signal")
    kind: Kind = static("float", help="kind of the signal")

    @property
    def port(self) -> Port:
        """The output port that it gives the subsystem."""
        return Port(self.shape, self.kind)

    @property
    def inputs(self) -> Ports:
        return {"u": self.port}


End = tuple[str, str]
"""One end of a wire: the name of a block in the diagram, and the name of one of its ports."""
MAX_NAME_CHARACTERS = 100
SOLVERS = ("rk4", "tsit5", "dopri8", "rodas5p")
HEAD: dict[str, Any] = {
    **{"title": "", "comment": "", "tick": 0.01, "substeps": 1},
    **{"solver": "rk4", "relative_tolerance": 1e-6, "absolute_tolerance": 1e-9, "precision": "single"},
    **{"loops": "refuse", "on_fault": "stop", "parameters": {}, "uses": {}},
}
"""The settings of a diagram, and their defaults."""


@dataclasses.dataclass(frozen=True)
class Node:
    """A block in a diagram. Random numbers and state depend on its `id`, which stays the same when it is renamed or
    moved.
    """

    block: "Block | Diagram"
    id: str


class Diagram:
    r"""Named blocks, and wires between them.

        diagram = Diagram(tick=0.01)
        diagram.add("input", Constant(1.0))
        diagram.add("level", Integrator())
        diagram.connect("input", "level")

    A block whose `shape` is left at `()` takes the one that its wires have, when the diagram is compiled.

    `Inlet` and `Outlet` blocks are the ports of a diagram that is part of another one. In the outermost diagram an
    inlet is a number that can be set during a run, and an outlet is a recorded signal. A subsystem with an `Enable` or
    a `Trigger` is evaluated only under a condition.

    **Arguments:**

    - `tick` (s): the length of a tick.
    - `substeps`: RK4 steps per tick.
    - `title`, `comment`: for people.
    - `solver`: how continuous states are integrated. `"rk4"` takes fixed steps; `"tsit5"` (order 5) and `"dopri8"`
      (order 8, for small tolerances) adapt them; `"rodas5p"` adapts them too, and is implicit, for stiff systems.
      Solvers that adapt their steps locate zero crossings.
    - `relative_tolerance`, `absolute_tolerance`: of solvers that adapt their steps, per step: the root mean square over
      all states of the estimated error over $a + r\,|x|$ is at most 1. The relative one is raised to
      20 roundings, 2.4e-6 in single precision.
    - `precision`: `"single"`, or `"double"` for this diagram alone, whatever the precision of the process.
    - `loops`: `"refuse"` or `"solve"` algebraic loops.
    - `on_fault`: `"stop"`, with a `RunFault`, where a number is not finite or a limit of the solver is reached; or
      `"warn"`, once, and go on with what there is. Continuous states that the solver could not find are NaN from there.
    - `parameters`: numbers, or arrays of numbers, that several blocks may use, by name. Those of a subsystem are set
      from outside like those of a block.
    - `uses`: which parameter of the diagram stands for a parameter of a block, `{"block.parameter": "name"}`; see
      `use`.

    `tick`, `substeps`, `loops`, `on_fault` and what concerns the solver count for the outermost diagram only.

    `nodes` (by name), `wires` (the source of every connected input) and `layout` (block positions and other data of an
    editor, ignored by the engine) are plain dictionaries to read.
    """

    _repr_svg_: "ClassVar[Callable[[Diagram], str]]"
    """Its picture in a notebook: `to_svg`, which is made of diagrams and sets itself here."""

    def __init__(
        self,
        tick: float = 0.01,
        substeps: int = 1,
        title: str = "",
        comment: str = "",
        solver: str = "rk4",
        relative_tolerance: float = 1e-6,
        absolute_tolerance: float = 1e-9,
        precision: str = "single",
        loops: str = "refuse",
        on_fault: str = "stop",
        parameters: Mapping[str, Any] | None = None,
        uses: Mapping[str, str] | None = None,
    ):
        check_arguments(Diagram, locals())
        numbers = {"tick": tick, "relative_tolerance": relative_tolerance, "absolute_tolerance": absolute_tolerance}
        for name, value in numbers.items():
            number = isinstance(value, int | float) and not isinstance(value, bool)
            unit = " of seconds" if name == "tick" else ""
            check(number and 0 < value < np.inf, name, value, f"a positive number{unit}")
        whole = isinstance(substeps, int) and not isinstance(substeps, bool)
        check(whole and 1 <= substeps <= 1000, "substeps", substeps, "an integer from 1 to 1000")
        choice("solver", solver, SOLVERS)
        choice("precision", precision, ("single", "double"))
        choice("loops", loops, ("refuse", "solve"))
        choice("on_fault", on_fault, ("stop", "warn"))
        self.tick = float(tick)
        self.substeps = substeps
        self.title, self.comment = title, comment
        self.solver, self.precision, self.loops = solver, precision, loops
        self.on_fault = on_fault
        self.relative_tolerance = float(relative_tolerance)
        self.absolute_tolerance = float(absolute_tolerance)
        self.parameters: dict[str, Any] = {}
        for name, value in _table("parameters", parameters):
            self._declare(name, value)
        self.uses: dict[str, str] = {}
        for address, name in _table("uses", uses):
            check(name in self.parameters, f"uses: {address}", name, "one of the parameters of the diagram")
            self.uses[address] = name
        self.nodes: dict[str, Node] = {}
        self.wires: dict[End, End] = {}
        self.layout: dict[str, Any] = {}

    def add(self, name: str, block: "Block | Diagram", id: str | None = None) -> str:
        """Add a block, or a diagram as a subsystem.

        **Arguments:**

        - `name`: a new name, without `.` and `/`.
        - `block`: the block or diagram.
        - `id`: by default the name, numbered if another block has that id. A subsystem with the id `""` leaves the ids
          of its blocks unchanged.

        **Returns** the name.
        """
        check_arguments(Diagram.add, locals())
        _check_name(name)
        check(name not in self.nodes, "name", name, "a new name in the diagram")
        check(
            not isinstance(block, Diagram) or not block.contains(self),
            name,
            block,
            "a diagram that does not contain this one",
        )
        taken = {node.id for node in self.nodes.values()}
        if id is None:
            id = next(new for new in numbered_names(name) if new not in taken)
        elif id != "" or not isinstance(block, Diagram):
            _check_name(id, "id")
            check(id not in taken, "id", id, "a new id in the diagram")
        self.nodes[name] = Node(block, id)
        return name

    def remove(self, name: str) -> None:
        """Remove a block and its wires."""
        check_arguments(Diagram.remove, locals())
        self._node(name)
        del self.nodes[name]
        self.uses = {address: own for address, own in self.uses.items() if address.partition(".")[0] != name}
        self.wires = {to: source for to, source in self.wires.items() if name not in (to[0], source[0])}

    def rename(self, old: str, new: str) -> None:
        """Rename a block. Its position, wires and id stay the same."""
        check_arguments(Diagram.rename, locals())
        self._node(old)
        _check_name(new)
        check(new == old or new not in self.nodes, "name", new, "a new name in the diagram")

        def renamed(end: End) -> End:
            return (new, end[1]) if end[0] == old else end

        own = {f"{old}.{field}": f"{new}.{field}" for field in self.uses_of(old)}
        self.uses = {own.get(address, address): name for address, name in self.uses.items()}
        self.nodes = {new if name == old else name: node for name, node in self.nodes.items()}
        self.wires = {renamed(to): renamed(source) for to, source in self.wires.items()}

    def replace(self, name: str, block: "Block | Diagram") -> None:
        """Replace a block and keep its id. Wires at ports that the new block lacks are removed."""
        check_arguments(Diagram.replace, locals())
        node = self._node(name)
        self.nodes[name] = dataclasses.replace(node, block=block)
        inputs, outputs = block.inputs, block.outputs
        lost = {(t, s) for t, s in self.wires.items() if t[0] == name and t[1] not in inputs}
        lost |= {(t, s) for t, s in self.wires.items() if s[0] == name and s[1] not in outputs}
        self.wires = {t: s for t, s in self.wires.items() if (t, s) not in lost}

    def connect(self, source: str, target: str) -> None:
        """Connect an output, `"block.port"`, to an input. The port may be omitted where a block has only one.

        Shapes and kinds are checked when the diagram is compiled, or by `mismatch`.
        """
        check_arguments(Diagram.connect, locals())
        start = self.end(source, "outputs")
        end = self.end(target, "inputs")
        held = self.wires.get(end)
        check(held is None, ".".join(end), source, f"disconnected first: {'.'.join(held or ())} leads there")
        self.wires[end] = start

    def disconnect(self, target: str) -> None:
        """Remove the wire to an input."""
        check_arguments(Diagram.disconnect, locals())
        end = self.end(target, "inputs")
        check(end in self.wires, "target", target, "an input with a wire")
        del self.wires[end]

    def use(self, address: str, name: str) -> None:
        """Let a parameter of the diagram set one of a block or a subsystem, at an address
        `"block.parameter"`. A parameter that the diagram does not have yet begins with the block's value.

            plant.use("inertia.gain", "mass")
            plant.use("weight.gain", "mass")
            run["plant.mass"] = 2.0  # sets both
        """
        check_arguments(Diagram.use, locals())
        block, _, own = address.partition(".")
        inner = self._node(block).block
        known = inner.parameters
        if own not in known:
            raise unknown(f"parameter of {block}:", own, known)
        if name not in self.parameters:
            self._declare(name, inner.parameters[own] if isinstance(inner, Diagram) else getattr(inner, own))
        self.uses[address] = name

    def _declare(self, name: str, value: object) -> None:
        _check_name(name)
        check(name not in HEAD, "parameters", name, "another name: a setting of the diagram has it")
        self.parameters[name] = plain_numbers(value, name, SHARED)

    def uses_of(self, block: str) -> dict[str, str]:
        """The parameters of the diagram that a block uses, by the name of its own parameter."""
        check_arguments(Diagram.uses_of, locals())
        ends = ((address.partition("."), name) for address, name in self.uses.items())
        return {end[2]: name for end, name in ends if end[0] == block}

    def mismatch(self, source: str, target: str) -> str | None:
        """Why an output cannot be connected to an input; `None` if it can."""
        try:
            start = self.end(source, "outputs")
            end = self.end(target, "inputs")
        except ValueError as error:
            return str(error)
        given, wanted = self.meeting(start, end)
        return port_mismatch(".".join(start), given, ".".join(end), wanted)

    def meeting(self, start: End, end: End) -> tuple[Port, Port]:
        """The ports at both ends of a wire; one whose shape follows from the other has that one's."""
        given = self.nodes[start[0]].block.outputs[start[1]]
        wanted = self.nodes[end[0]].block.inputs[end[1]]
        if given.shape == wanted.shape:
            return given, wanted
        if self.takes(end, "inputs", given.shape):
            return given, dataclasses.replace(wanted, shape=given.shape)
        if self.takes(start, "outputs", wanted.shape):
            return dataclasses.replace(given, shape=wanted.shape), wanted
        return given, wanted

    def takes(self, end: End, side: str, shape: tuple[int, ...]) -> bool:
        """Whether a port, among the `"inputs"` or the `"outputs"` of its block, takes a shape from its wire."""
        block = self.nodes[end[0]].block
        port = end[1]
        if not isinstance(block, Diagram):
            return fitted(block, side, port, shape) is not None
        inner: Any = block.nodes[port].block  # an inlet, an outlet or a gate
        return any(fitted(inner, *own, shape) for own in (("outputs", "y"), ("inputs", "u")))

    @property
    def head(self) -> dict[str, Any]:
        """Its settings by name, which are the arguments of a new diagram."""
        return {name: getattr(self, name) for name in HEAD}

    @property
    def inputs(self) -> Ports:
        """Its input ports: the inlets and gates by name."""
        return {name: block.port for name, block in self._blocks_of((Inlet, Gate))}

    @property
    def outputs(self) -> Ports:
        """Its output ports: the outlets by name."""
        return {name: block.port for name, block in self._blocks_of(Outlet)}

    def contains(self, other: "Diagram") -> bool:
        """Whether `other` is this diagram or part of it, at any depth."""
        check_arguments(Diagram.contains, locals())
        inner = [node.block for node in self.nodes.values() if isinstance(node.block, Diagram)]
        return self is other or any(diagram.contains(other) for diagram in inner)

    def copy(self) -> Self:
        """A copy that can be changed independently; subsystems are copied too."""
        other = type(self)(**self.head)
        for name, node in self.nodes.items():
            block = node.block.copy() if isinstance(node.block, Diagram) else node.block
            other.nodes[name] = Node(block, node.id)
        other.wires = dict(self.wires)
        other.layout = dict(self.layout)
        return other

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Diagram) and self._content() == other._content()

    __hash__ = object.__hash__

    def __repr__(self) -> str:
        return f"Diagram({self.title!r}, {counted(len(self.nodes), 'block')}, {counted(len(self.wires), 'wire')})"

    def _content(self) -> tuple[Any, ...]:
        return self.head, list(self.nodes.items()), self.wires, self.layout

    def _blocks_of(self, kind: type[Any] | tuple[type[Any], ...]) -> Iterator[tuple[str, Any]]:
        return ((name, node.block) for name, node in self.nodes.items() if isinstance(node.block, kind))

    def _node(self, name: str) -> Node:
        if name not in self.nodes:
            raise unknown("block", name, self.nodes)
        return self.nodes[name]

    def end(self, address: str, side: str) -> End:
        """The end of a wire at an address, `"block.port"` or `"block"`; `side` is `"inputs"` or `"outputs"`."""
        check(isinstance(address, str), side.removesuffix("s"), address, 'an address, "block.port"')
        name, _, port = address.partition(".")
        ports = getattr(self._node(name).block, side)
        if not port and len(ports) == 1:
            return name, next(iter(ports))
        if port not in ports:
            raise unknown(f"{side.removesuffix('s')} of {name}:", port, ports)
        return name, port


def port_mismatch(source: str, given: Port, target: str, wanted: Port) -> str | None:
    """Why an output port cannot be wired to an input port, in one line; `None` if it can."""
    if wanted.accepts(given):
        return None
    return f"{target}: accepts {wanted.describe()}, but {source} outputs {given.describe()}"


def numbered_names(name: str) -> Iterator[str]:
    """A name, then the name with numbers from 2."""
    yield name
    number = 2
    while True:
        yield f"{name} {number}"
        number += 1


def _table(name: str, value: Mapping[str, Any] | None) -> list[tuple[Any, Any]]:
    """The entries of a table."""
    check(value is None or isinstance(value, Mapping), name, value, "a table")
    return list((value or {}).items())


def _check_name(name: str, what: str = "name") -> None:
    text = (
        isinstance(name, str) and 0 < len(name) <= MAX_NAME_CHARACTERS and name.isprintable() and name == name.strip()
    )
    plain = text and not {".", "/"} & set(name)
    check(plain, what, name, f"a string of 1 … {MAX_NAME_CHARACTERS} characters without '.' and '/'")
