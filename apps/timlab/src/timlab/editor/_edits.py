"""Changes of a diagram. They return a new diagram, which shares all unchanged parts with the old one."""

import abc
import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motorgrad._errors import check, unknown
from timlab.diagram import (
    HEAD,
    SUBSYSTEM,
    Block,
    Diagram,
    Gate,
    Inlet,
    Node,
    Outlet,
    check_names,
    checked_layout,
    dumps,
    loads,
    make_block,
    parameters_of,
)
from timlab.editor._protocol import Operation
from timlab.editor._subsystems import fresh_id, fresh_name, group, ungroup

Path = tuple[str, ...]
Point = tuple[float, float]
Box = tuple[float, ...]


@dataclasses.dataclass(frozen=True)
class Change(Operation, abc.ABC, op=""):
    """A change that depends only on the document. It can be undone."""

    @abc.abstractmethod
    def apply(self, document: Diagram) -> Diagram:
        """The document after the change. **Raises** `ValueError` where the change is impossible."""


@dataclasses.dataclass(frozen=True)
class Edit(Change, op=""):
    """A change of the diagram `at`."""

    at: Path

    def apply(self, document: Diagram) -> Diagram:
        scopes = opened(document, self.at)
        self.change(scopes[-1], scopes[0])
        checked_layout(scopes[-1].layout)  # what is not allowed in a file could not be saved
        if len(scopes) > 1:
            self.follow(scopes[-2], self.at[-1])
        return scopes[0]

    @abc.abstractmethod
    def change(self, scope: Diagram, document: Diagram) -> None:
        """Change `scope`, the copied diagram `at`, in place; `document` is the outermost diagram."""

    def follow(self, outer: Diagram, name: str) -> None:
        """Change what the diagram around the changed subsystem `name` says of it: wires at ports that are gone, and
        uses of parameters that are gone, are removed.
        """
        inner: Any = outer.nodes[name].block
        inputs, outputs = inner.inputs, inner.outputs
        outer.wires = {
            target: source
            for target, source in outer.wires.items()
            if (target[0] != name or target[1] in inputs) and (source[0] != name or source[1] in outputs)
        }
        gone = [f"{name}.{own}" for own in outer.uses_of(name) if own not in inner.parameters]
        outer.uses = {address: used for address, used in outer.uses.items() if address not in gone}


@dataclasses.dataclass(frozen=True)
class Add(Edit):
    """Add a new block, by default named like its type; the type `"diagram"` is an empty subsystem."""

    type: str
    name: str | None = None
    fields: dict[str, Any] = dataclasses.field(default_factory=dict)
    position: Point | None = None

    def change(self, scope: Diagram, document: Diagram) -> None:
        if self.type == SUBSYSTEM:
            check(set(self.fields) <= set(HEAD), "fields", self.fields, f"some of {', '.join(HEAD)}")
            block: Block | Diagram = Diagram(**self.fields)
        else:
            block = make_block(self.type, self.fields)
        name = fresh_name(scope, self.type) if self.name is None else self.name
        scope.add(name, block, fresh_id(document, name))
        if self.position is not None:
            _set_positions(scope, {name: self.position})


@dataclasses.dataclass(frozen=True)
class Remove(Edit):
    """Remove blocks with their wires; and `comments`, by their ids."""

    names: tuple[str, ...] = ()
    comments: tuple[str, ...] = ()

    def change(self, scope: Diagram, document: Diagram) -> None:
        for name in dict.fromkeys(self.names):
            scope.remove(name)
        _set_positions(scope, dict.fromkeys(self.names))
        comments = _comments(scope, self.comments)
        _set_layout(scope, "comments", {id: own for id, own in comments.items() if id not in self.comments})


@dataclasses.dataclass(frozen=True)
class Rename(Edit):
    """Rename a block. An inlet or outlet of a subsystem keeps its wires outside."""

    name: str
    to: str

    def change(self, scope: Diagram, document: Diagram) -> None:
        scope.rename(self.name, self.to)
        places = scope.layout.get("positions", {})
        renamed = {self.to if name == self.name else name: place for name, place in places.items()}
        _set_layout(scope, "positions", renamed)

    def follow(self, outer: Diagram, name: str) -> None:
        inner: Any = outer.nodes[name].block
        if isinstance(inner.nodes[self.to].block, Inlet | Outlet | Gate):

            def renamed(end: tuple[str, str]) -> tuple[str, str]:
                return (name, self.to) if end == (name, self.name) else end

            outer.wires = {renamed(target): renamed(source) for target, source in outer.wires.items()}
        super().follow(outer, name)


@dataclasses.dataclass(frozen=True)
class Set(Edit):
    """Set a field of a block, or several at once in `fields`. Without a name it sets fields of the diagram itself:
    title, comment, tick, substeps, solver, relative_tolerance, absolute_tolerance, precision, loops, on_fault,
    parameters, uses; or of a subsystem one of its parameters.
    """

    name: str | None = None
    field: str | None = None
    value: Any = None
    fields: dict[str, Any] = dataclasses.field(default_factory=dict)

    def change(self, scope: Diagram, document: Diagram) -> None:
        values = self.fields if self.field is None else {**self.fields, self.field: self.value}
        check(values, "fields", values, "at least one")
        if self.name is None:
            _set_head(scope, values)
            return
        node = _node(scope, self.name)
        for name, used in scope.uses_of(self.name).items():
            check(name not in values, name, values.get(name), f"unset: the diagram's parameter {used!r} stands for it")
        if isinstance(node.block, Diagram):
            inner = shallow_copy(node.block)
            own = {name: value for name, value in values.items() if name in inner.parameters}
            rest = {name: value for name, value in values.items() if name not in own}
            _set_head(inner, {"parameters": {**inner.parameters, **own}} | rest)
            scope.nodes[self.name] = Node(inner, node.id)
        else:
            check_names(node.block, values)
            scope.replace(self.name, node.block.retuned(values))


@dataclasses.dataclass(frozen=True)
class Connect(Edit):
    """Connect an output, `"block.port"`, to an input; a wire that leads to the input already is removed."""

    source: str
    target: str

    def change(self, scope: Diagram, document: Diagram) -> None:
        wrong = scope.mismatch(self.source, self.target)
        if wrong:
            raise ValueError(wrong)
        scope.wires.pop(scope.end(self.target, "inputs"), None)
        scope.connect(self.source, self.target)


@dataclasses.dataclass(frozen=True)
class Disconnect(Edit):
    """Remove the wire to an input."""

    target: str

    def change(self, scope: Diagram, document: Diagram) -> None:
        scope.disconnect(self.target)


@dataclasses.dataclass(frozen=True)
class Move(Edit):
    """Move blocks; and comments, by their ids: `boxes` are `[x, y, width, height]`."""

    positions: dict[str, Point] = dataclasses.field(default_factory=dict)
    boxes: dict[str, Box] = dataclasses.field(default_factory=dict)

    def change(self, scope: Diagram, document: Diagram) -> None:
        check(self.positions or self.boxes, "positions", self.positions, "at least one")
        for name in self.positions:
            _node(scope, name)
        _set_positions(scope, self.positions)
        comments = _comments(scope, self.boxes)
        moved = {id: comments[id] | {"box": _checked_box(box)} for id, box in self.boxes.items()}
        _set_layout(scope, "comments", comments | moved)


@dataclasses.dataclass(frozen=True)
class Comment(Edit):
    """Write a new comment, or change the one with this id; `box` is `[x, y, width, height]`."""

    text: str
    box: Box | None = None
    id: str | None = None

    def change(self, scope: Diagram, document: Diagram) -> None:
        comments = _comments(scope, [] if self.id is None else [self.id])
        id = self.id or next(str(n) for n in range(1, len(comments) + 2) if str(n) not in comments)
        box = comments.get(id, {}).get("box") if self.box is None else self.box
        _set_layout(scope, "comments", comments | {id: {"text": self.text, "box": _checked_box(box)}})


@dataclasses.dataclass(frozen=True)
class Paste(Edit):
    """Add the blocks of a document, under new names where theirs exist already. They use the parameters of the same
    names; those that the diagram does not have are declared with the document's values.
    """

    fragment: dict[str, Any]
    position: Point | None = None

    def change(self, scope: Diagram, document: Diagram) -> None:
        given = loads(json.dumps(self.fragment))
        check(given.nodes, "fragment", "no blocks", "at least one block")
        places = given.layout.get("positions", {})
        corner = [min((place[n] for place in places.values()), default=0.0) for n in (0, 1)]
        named = {}
        for name, node in given.nodes.items():
            named[name] = fresh_name(scope, name)
            scope.add(named[name], node.block, fresh_id(document, named[name]))
        used = {name: value for name, value in given.parameters.items() if name in given.uses.values()}
        uses = {f"{named[block]}.{own}": name for block in named for own, name in given.uses_of(block).items()}
        _set_head(scope, {"parameters": used | scope.parameters, "uses": scope.uses | uses})
        scope.wires |= {(named[t], p): (named[s], q) for (t, p), (s, q) in given.wires.items()}
        to = corner if self.position is None else self.position
        moved = {named[n]: (x - corner[0] + to[0], y - corner[1] + to[1]) for n, (x, y) in places.items()}
        _set_positions(scope, moved)


@dataclasses.dataclass(frozen=True)
class Group(Edit):
    """Turn blocks into a subsystem."""

    names: tuple[str, ...]
    name: str | None = None

    def change(self, scope: Diagram, document: Diagram) -> None:
        for name in self.names:
            _node(scope, name)
        group(scope, document, list(dict.fromkeys(self.names)), self.name)


@dataclasses.dataclass(frozen=True)
class Ungroup(Edit):
    """Replace a subsystem with its blocks."""

    name: str

    def change(self, scope: Diagram, document: Diagram) -> None:
        check(isinstance(_node(scope, self.name).block, Diagram), "name", self.name, "a subsystem")
        ungroup(scope, document, self.name)


@dataclasses.dataclass(frozen=True)
class SetParameter(Change, op="parameter"):
    """Set a parameter in the document, and in the run from its next tick on: `"block.parameter"`, or `"name"` for one
    of the outermost diagram. Quick successive changes of one parameter
    are undone as one.
    """

    address: str
    value: Any

    def apply(self, document: Diagram) -> Diagram:
        path, dot, name = self.address.partition(".")
        if not dot and path in document.parameters:  # of the outermost diagram itself
            return Set((), fields={"parameters": {**document.parameters, path: self.value}}).apply(document)
        *at, block = path.split("/")
        scopes = opened(document, at)
        node = _node(scopes[-1], block)
        block_type: Any = type(node.block)
        inner = isinstance(node.block, Diagram)
        known = node.block.parameters if inner else {**parameters_of(block_type), **node.block.parameters}
        if name not in known:
            raise unknown(f"parameter of {path}:", name, known)
        Set(tuple(at), block, name, self.value).change(scopes[-1], scopes[0])  # ports and layout stay
        return scopes[0]


@dataclasses.dataclass(frozen=True)
class Freeze(Change):
    """Freeze what a block has learned, or let it learn again: the whole block, or one of its units."""

    address: str
    on: bool
    unit: int | None = None

    def apply(self, document: Diagram) -> Diagram:
        path = self.address.removesuffix(".frozen")
        *at, name = path.split("/")
        block = _node(opened(document, at)[-1], name).block
        learns = not isinstance(block, Diagram) and "frozen" in parameters_of(type(block))
        check(learns, "address", self.address, "a block that learns, with the parameter 'frozen'")
        frozen = block.values()["frozen"]  # type: ignore[union-attr]
        if self.unit is None:
            value = np.full(frozen.shape, self.on)
        else:
            check(frozen.ndim == 1, "unit", self.unit, "null: the units of this block are frozen together")
            check(0 <= self.unit < len(frozen), "unit", self.unit, f"an integer from 0 to {len(frozen) - 1}")
            value = np.where(np.arange(len(frozen)) == self.unit, self.on, frozen)
        return SetParameter(f"{path}.frozen", value.tolist()).apply(document)


def opened(document: Diagram, at: Sequence[str]) -> list[Diagram]:
    """Copies of the diagrams from the outermost one to the one `at`, which may be modified; the rest is shared."""
    scopes = [shallow_copy(document)]
    for name in at:
        node = scopes[-1].nodes.get(name)
        if node is None or not isinstance(node.block, Diagram):
            raise unknown("subsystem", name, [n for n, x in scopes[-1].nodes.items() if isinstance(x.block, Diagram)])
        inner = shallow_copy(node.block)
        scopes[-1].nodes[name] = Node(inner, node.id)
        scopes.append(inner)
    return scopes


def shallow_copy(diagram: Diagram) -> Diagram:
    """A copy that shares blocks and subsystems with the original."""
    other = Diagram(**diagram.head)
    other.nodes = dict(diagram.nodes)
    other.wires = dict(diagram.wires)
    other.layout = dict(diagram.layout)
    return other


def selection(document: Diagram, at: Sequence[str], names: Sequence[str]) -> dict[str, Any]:
    """Some blocks and the wires between them, as a document that can be pasted."""
    scope = opened(document, at)[-1]
    for name in names:
        _node(scope, name)
    chosen = set(names)
    uses = {f"{name}.{own}": used for name in chosen for own, used in scope.uses_of(name).items()}
    parameters = {name: value for name, value in scope.parameters.items() if name in uses.values()}
    part = Diagram(scope.tick, parameters=parameters, uses=uses)
    part.nodes = {name: node for name, node in scope.nodes.items() if name in chosen}
    part.wires = {t: s for t, s in scope.wires.items() if t[0] in chosen and s[0] in chosen}
    _set_positions(part, {name: at for name, at in scope.layout.get("positions", {}).items() if name in chosen})
    return json.loads(dumps(part))


def _set_head(scope: Diagram, values: dict[str, Any]) -> None:
    for name in values:
        if name not in HEAD:
            raise unknown("setting of a diagram", name, HEAD)
    for name in {"title", "comment"} & set(values):
        check(isinstance(values[name], str), name, values[name], "a string")
    checked = Diagram(**scope.head | values)
    for name in HEAD:
        setattr(scope, name, getattr(checked, name))


def _node(scope: Diagram, name: str) -> Node:
    if name not in scope.nodes:
        raise unknown("block", name, scope.nodes)
    return scope.nodes[name]


def _comments(scope: Diagram, ids: Sequence[str] | Mapping[str, Any]) -> dict[str, Any]:
    """The comments of a diagram, of which these must exist."""
    comments = dict(scope.layout.get("comments", {}))
    for id in ids:
        if id not in comments:
            raise unknown("comment", id, comments)
    return comments


def _set_positions(scope: Diagram, positions: Mapping[str, Any]) -> None:
    """Record the positions of blocks; `None` removes a position."""
    places = {
        **scope.layout.get("positions", {}),
        **{name: None if at is None else [float(x) for x in at] for name, at in positions.items()},
    }
    _set_layout(scope, "positions", {name: at for name, at in places.items() if at is not None})


def _set_layout(scope: Diagram, part: str, table: dict[str, Any]) -> None:
    rest = {name: value for name, value in scope.layout.items() if name != part}
    scope.layout = {**rest, part: table} if table else rest


def _checked_box(box: Any) -> list[float]:
    check(
        box is not None and len(box) == 4 and min(box[2:]) > 0, "box", box, "x, y, width and height, the latter above 0"
    )
    return [float(x) for x in box or ()]
