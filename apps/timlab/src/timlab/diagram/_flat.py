"""Flattened diagrams: one list of blocks, with subsystems opened, and the source of each of their inputs."""

import dataclasses
from collections.abc import Iterator
from typing import Any

from motorgrad._errors import unknown
from timlab.diagram._block import Block, HostBlock, Sink
from timlab.diagram._diagram import Diagram, End, Inlet, Outlet, port_mismatch
from timlab.diagram._foreign import Foreign
from timlab.diagram._gates import Condition, Gate, Gated
from timlab.diagram._placed import DiagramError, Placed, Problem, Source
from timlab.diagram._shapes import with_shapes
from timlab.diagram._tags import From, Goto

MAX_SUBSYSTEM_DEPTH = 32
MAX_SIGNAL_HOPS = 200  # subsystems and tags that a signal passes in a row


@dataclasses.dataclass(frozen=True)
class Scope:
    """A diagram in its place: the block `name` of the diagram `above`."""

    diagram: Diagram
    above: "Scope | None" = None
    name: str = ""

    def path(self, name: str) -> str:
        return name if self.above is None else f"{self.above.path(self.name)}/{name}"

    def identity(self, id: str) -> str:
        if self.above is None:
            return id
        own = self.above.identity(self.above.diagram.nodes[self.name].id)
        return f"{own}/{id}".strip("/")

    def leaves(self, depth: int = 0) -> Iterator[tuple["Scope", str]]:
        """The blocks that are not diagrams and take part in the computation."""
        for name, node in self.diagram.nodes.items():
            if isinstance(node.block, Diagram):
                if depth == MAX_SUBSYSTEM_DEPTH:
                    raise Problem.error(self.path(name), None, f"more than {MAX_SUBSYSTEM_DEPTH} nested subsystems")
                yield from Scope(node.block, self, name).leaves(depth + 1)
            elif not (self._from_above(name) or isinstance(node.block, Goto | From | (Outlet if self.above else Goto))):
                yield self, name

    def _from_above(self, name: str) -> bool:
        """Whether a block is an inlet that is wired from outside."""
        inlet = isinstance(self.diagram.nodes[name].block, Inlet)
        return inlet and self.above is not None and (self.name, name) in self.above.diagram.wires

    def parameters(self) -> dict[str, Any]:
        """The parameters of the diagram, as set from outside."""
        if self.above is None:
            return self.diagram.parameters
        outside = self.above.parameters()
        return self.diagram.parameters | {
            own: outside[name] for own, name in self.above.diagram.uses_of(self.name).items()
        }

    def block(self, name: str) -> Block:
        """A block, with the parameters that it uses. **Raises** `DiagramError` for one that it lacks."""
        block: Any = self.diagram.nodes[name].block
        uses = self.diagram.uses_of(name)
        values = self.parameters() if uses else {}
        try:
            for own, used in uses.items():
                if own not in block.parameters:
                    raise unknown("parameter", own, block.parameters)
                block = block.retuned({own: values[used]})
        except ValueError as error:
            raise Problem.error(self.path(name), None, str(error)) from None
        return block

    def gates(self) -> list[str]:
        """The paths of all gates that its blocks are behind."""
        if self.above is None:
            return []
        own = [self.path(name) for name, node in self.diagram.nodes.items() if isinstance(node.block, Gate)]
        return [*self.above.gates(), *own]

    def wire(self, name: str, port: str) -> tuple["Scope", End] | None:
        """The output that a wire brings to a block's input, and the diagram of the wire. A gate's is outside."""
        scope = self
        at = (name, port)
        if self.above is not None and isinstance(self.diagram.nodes[name].block, Gate):
            scope = self.above
            at = (self.name, name)
        source = scope.diagram.wires.get(at)
        return None if source is None else scope.origin(source)

    def origin(self, end: End, seen: frozenset[str] = frozenset()) -> tuple["Scope", End]:
        """The output of a block from which a signal of this diagram comes."""
        name, port = end
        if name not in self.diagram.nodes:
            raise Problem.error(self.path(name), port, "a wire starts at it, but there is no such block")
        block = self.diagram.nodes[name].block
        place = f"{self.path(name)}.{port}"
        if place in seen:
            raise Problem.error(self.path(name), port, "the wires form a loop that contains no block")
        if len(seen) == MAX_SIGNAL_HOPS:
            raise Problem.error(
                self.path(name), port, f"the signal passes more than {MAX_SIGNAL_HOPS} subsystems and tags"
            )
        seen |= {place}
        if port not in block.outputs:
            raise Problem.error(self.path(name), port, "a wire starts at it, but there is no such output")
        if isinstance(block, Diagram):
            inner = Scope(block, self, name)
            wire = block.wires.get((port, "u"))
            if wire is None:
                raise Problem.error(inner.path(port), "u", "not connected")
            return inner.origin(wire, seen)
        if isinstance(block, From):
            return self._named(name, block.tag, seen)
        if self.above is not None and self._from_above(name):
            return self.above.origin(self.above.diagram.wires[self.name, name], seen)
        return self, end

    def _named(self, name: str, tag: str, seen: frozenset[str]) -> tuple["Scope", End]:
        """The origin of the signal with a tag, which the block `name` reads."""
        scope: Scope | None = self
        while scope is not None:
            nodes = scope.diagram.nodes.items()
            found = [each for each, node in nodes if isinstance(node.block, Goto) and node.block.tag == tag]
            if len(found) > 1:
                raise Problem.error(scope.path(found[1]), None, f"has the same tag, {tag!r}, as {found[0]}")
            if found:
                wire = scope.diagram.wires.get((found[0], "u"))
                if wire is None:
                    raise Problem.error(scope.path(found[0]), "u", "not connected")
                return scope.origin(wire, seen)
            scope = scope.above
        raise Problem.error(self.path(name), None, f"there is no goto with the tag {tag!r}")


def flatten(diagram: Diagram) -> tuple[list[Placed], list[Problem]]:
    """Every block of a diagram and of its subsystems, and all problems with blocks and wires."""
    problems: list[Problem] = []
    top = Scope(diagram)
    try:
        leaves = list(top.leaves())
    except DiagramError as error:
        return [], list(error.problems)
    index = {scope.path(name): number for number, (scope, name) in enumerate(leaves)}
    placed = []
    for scope, name in leaves:
        node = scope.diagram.nodes[name]
        path = scope.path(name)
        assert isinstance(node.block, Block)
        block = node.block
        sources = {}
        ticks = 1
        try:
            block = scope.block(name)
        except DiagramError as error:
            problems += error.problems
        if isinstance(block, Gate) and scope.above is not None:
            block = Condition(getattr(block, "on", ""))
        for port, declared in block.inputs.items():
            try:
                found = scope.wire(name, port)
                if found is not None:
                    origin, end = found
                    sources[port] = Source(index[origin.path(end[0])], end[1])
                elif declared.default is None:
                    problems.append(Problem(path, port, "not connected"))
            except DiagramError as error:
                problems += error.problems
        try:
            ticks = node.block.ticks(diagram.tick)
        except ValueError as error:
            problems.append(Problem(path, None, str(error)))
        if node.block.is_continuous and ticks > 1:
            problems.append(Problem(path, None, f"every = {ticks} ticks: must be 1 for a continuous state"))
        placed.append(Placed(path, scope.identity(node.id), block, sources, ticks))
    placed = with_shapes(placed)
    problems += _mismatches(placed)
    for number, (scope, _) in enumerate(leaves):
        try:
            placed[number] = _gated(placed[number], [index[gate] for gate in scope.gates()])
        except DiagramError as error:
            problems += error.problems
    problems += _loose_wires(top)
    problems += _loose_uses(top)
    problems += _same_identity(placed)
    return placed, problems


def _mismatches(placed: list[Placed]) -> Iterator[Problem]:
    """Wires between blocks of different shapes or kinds."""
    for each in placed:
        for port, source in each.sources.items():
            if isinstance(each.block, Condition):
                continue  # reported at the subsystem's input
            origin = placed[source.block]
            given = origin.block.outputs[source.port]
            wanted = each.block.inputs[port]
            wrong = port_mismatch(f"{origin.path}.{source.port}", given, f"{each.path}.{port}", wanted)
            if wrong:
                yield Problem(each.path, port, wrong.split(": ", 1)[1])


def _gated(placed: Placed, gates: list[int]) -> Placed:
    """A block behind these gates."""
    block = placed.block
    if not gates or isinstance(block, Condition | Sink):
        return placed
    if isinstance(block, HostBlock | Foreign):
        text = "runs on the host: it must not be in an enabled or triggered subsystem"
        raise Problem.error(placed.path, None, text)
    gated = Gated(block, len(gates), every=block.every, period=block.period)
    more = {Gated.port(number): Source(gate, "y") for number, gate in enumerate(gates)}
    return dataclasses.replace(placed, block=gated, sources=placed.sources | more)


def _loose_wires(scope: Scope) -> Iterator[Problem]:
    """Wires that lead nowhere, and mismatches at the boundary of a subsystem."""
    for name, port in scope.diagram.wires:
        node = scope.diagram.nodes.get(name)
        if node is None or port not in node.block.inputs:
            yield Problem(scope.path(name), port, "a wire leads to it, but there is no such input")
    for name, node in scope.diagram.nodes.items():
        if isinstance(node.block, Diagram):
            yield from _boundary_mismatches(scope, name, node.block)
            yield from _loose_wires(Scope(node.block, scope, name))


def _loose_uses(scope: Scope) -> Iterator[Problem]:
    """Parameters of blocks and subsystems that do not exist."""
    for address in scope.diagram.uses:
        name, _, own = address.partition(".")
        node = scope.diagram.nodes.get(name)
        if node is None or (isinstance(node.block, Diagram) and own not in node.block.parameters):
            yield Problem(scope.path(name), None, f"a parameter is set for its {own!r}, which does not exist")
    for name, node in scope.diagram.nodes.items():
        if isinstance(node.block, Diagram):
            yield from _loose_uses(Scope(node.block, scope, name))


def shared(diagram: Diagram) -> dict[str, tuple[str, ...]]:
    """The addresses of the blocks' parameters that a parameter of a diagram sets, by its own address:
    `"subsystem.name"`, or `"name"` in the outermost diagram.
    """
    found: dict[str, tuple[str, ...]] = {}

    def visit(scope: Scope, prefix: str) -> None:
        for name, node in scope.diagram.nodes.items():
            if isinstance(node.block, Diagram):
                visit(Scope(node.block, scope, name), f"{scope.path(name)}.")
        for address, own in scope.diagram.uses.items():
            name, _, field = address.partition(".")
            at = f"{scope.path(name)}.{field}"
            found[prefix + own] = (*found.get(prefix + own, ()), *found.get(at, (at,)))

    visit(Scope(diagram), "")
    return found


def blocks_of(diagram: Diagram) -> dict[str, Block]:
    """All blocks that are not subsystems, by path, with the parameters that they use."""

    def visit(scope: Scope) -> Iterator[tuple[str, Block]]:
        for name, node in scope.diagram.nodes.items():
            if isinstance(node.block, Diagram):
                yield from visit(Scope(node.block, scope, name))
                continue
            try:
                yield scope.path(name), scope.block(name)
            except DiagramError:
                yield scope.path(name), node.block

    return dict(visit(Scope(diagram)))


def _boundary_mismatches(scope: Scope, name: str, inner: Diagram) -> Iterator[Problem]:
    for port in inner.inputs:
        wire = scope.diagram.wires.get((name, port))
        source = scope.diagram.nodes.get(wire[0]) if wire else None
        if wire and source and wire[1] in source.block.outputs:
            given, wanted = scope.diagram.meeting(wire, (name, port))
            wrong = port_mismatch(f"{scope.path(wire[0])}.{wire[1]}", given, "", wanted)
            if wrong:
                yield Problem(scope.path(name), port, wrong.split(": ", 1)[1])


def _same_identity(placed: list[Placed]) -> Iterator[Problem]:
    by_identity: dict[str, str] = {}
    by_stream: dict[int, str] = {}
    for each in placed:
        other = by_identity.setdefault(each.identity, each.path)
        if other != each.path:
            yield Problem(each.path, None, f"has the same id, {each.identity!r}, as {other}")
        elif by_stream.setdefault(each.stream, each.path) != each.path:
            yield Problem(
                each.path, None, f"its id has the same hash as the id of {by_stream[each.stream]}: change one of them"
            )
