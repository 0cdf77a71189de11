"""Changes of a diagram. None alters the diagram it is given: what did not change is shared with the one before."""

import dataclasses
import functools
import json
from typing import Any

import numpy as np

from motorgrad._errors import check, unknown
from motorgrad.lab import _files
from motorgrad.lab._block import Block
from motorgrad.lab._diagram import Diagram, Node
from motorgrad.lab._parameter import parameters_of
from motorgrad.lab._registry import BLOCKS
from motorgrad.lab.blocks._boundary import Inlet, Outlet
from motorgrad.lab.editor import _protocol as ask
from motorgrad.lab.editor._names import fresh_id, fresh_name
from motorgrad.lab.editor._subsystems import group, ungroup

HEAD = tuple(_files.HEAD)


def edited(document: Diagram, edit: ask.Edit) -> Diagram:
    """The document after a change. **Raises** `ValueError` where that cannot be."""
    scopes = opened(document, edit.at)
    _apply(edit, scopes[-1], scopes[0])
    if len(scopes) > 1:
        _follow(scopes[-2], edit)
    return scopes[0]


def opened(document: Diagram, at: list[str]) -> list[Diagram]:
    """Copies of the diagrams from the outermost to the one `at`, which may be altered; all else is shared."""
    scopes = [shallow(document)]
    for name in at:
        node = scopes[-1].nodes.get(name)
        if node is None or not isinstance(node.block, Diagram):
            raise unknown("subsystem", name, [n for n, x in scopes[-1].nodes.items() if isinstance(x.block, Diagram)])
        inner = shallow(node.block)
        scopes[-1].nodes[name] = Node(inner, node.id)
        scopes.append(inner)
    return scopes


def shallow(diagram: Diagram) -> Diagram:
    """A copy whose blocks and subsystems are those of the original."""
    other = Diagram(diagram.tick, diagram.substeps, diagram.title, diagram.comment)
    other.nodes, other.wires, other.layout = dict(diagram.nodes), dict(diagram.wires), dict(diagram.layout)
    return other


def with_fields(block: Block, fields: dict[str, Any]) -> Block:
    """A block with other values of its fields."""
    names = dict.fromkeys(field.name for field in dataclasses.fields(block) if field.init) | dict(block.parameters)
    for name in fields:
        if name not in names:
            raise unknown(f"setting of {block.name}", name, names)
    return block.retuned(fields)


@functools.singledispatch
def _apply(edit: ask.Edit, scope: Diagram, document: Diagram) -> None:
    raise NotImplementedError(type(edit).__name__)


@_apply.register
def _(edit: ask.Add, scope: Diagram, document: Diagram) -> None:
    if edit.type == _files.SUBSYSTEM:
        check(set(edit.fields) <= set(HEAD), "fields", edit.fields, f"some of {', '.join(HEAD)}")
        block: Block | Diagram = Diagram(**edit.fields)
    elif edit.type in BLOCKS:
        block = _made(edit.type, edit.fields)
    else:
        raise unknown("type of block", edit.type, (*BLOCKS, _files.SUBSYSTEM))
    name = fresh_name(scope, edit.type) if edit.name is None else edit.name
    scope.add(name, block, fresh_id(document, name))
    if edit.position is not None:
        _place(scope, {name: edit.position})


def _made(kind: str, fields: dict[str, Any]) -> Block:
    cls = BLOCKS[kind]
    for field in dataclasses.fields(cls):
        given = field.default is not dataclasses.MISSING or field.default_factory is not dataclasses.MISSING
        if field.init and not given and field.name not in fields:
            raise ValueError(f"{kind}: {field.name} must be given")
    known = [field.name for field in dataclasses.fields(cls) if field.init]
    for name in fields:
        if name not in known:
            raise unknown(f"setting of {kind}", name, known)
    return cls(**fields)


@_apply.register
def _(edit: ask.Remove, scope: Diagram, document: Diagram) -> None:
    for name in dict.fromkeys(edit.names):
        scope.remove(name)
    _place(scope, dict.fromkeys(edit.names))
    comments = dict(scope.layout.get("comments", {}))
    for id in dict.fromkeys(edit.comments):
        if id not in comments:
            raise unknown("comment", id, comments)
        del comments[id]
    _lay(scope, "comments", comments)


@_apply.register
def _(edit: ask.Rename, scope: Diagram, document: Diagram) -> None:
    scope.rename(edit.name, edit.to)
    places = scope.layout.get("positions", {})
    _lay(scope, "positions", {edit.to if name == edit.name else name: place for name, place in places.items()})


@_apply.register
def _(edit: ask.Set, scope: Diagram, document: Diagram) -> None:
    check(edit.values, "fields", edit.values, "at least one")
    if edit.name is None:
        _set_head(scope, edit.values)
        return
    node = _node(scope, edit.name)
    if isinstance(node.block, Diagram):
        inner = shallow(node.block)
        _set_head(inner, edit.values)
        scope.nodes[edit.name] = Node(inner, node.id)
    else:
        scope.replace(edit.name, with_fields(node.block, edit.values))


def _set_head(scope: Diagram, values: dict[str, Any]) -> None:
    for name in values:
        if name not in HEAD:
            raise unknown("setting of a diagram", name, HEAD)
    for name in {"title", "comment"} & set(values):
        check(isinstance(values[name], str), name, values[name], "a text")
    checked = Diagram(**{name: getattr(scope, name) for name in HEAD} | values)
    for name in HEAD:
        setattr(scope, name, getattr(checked, name))


@_apply.register
def _(edit: ask.Connect, scope: Diagram, document: Diagram) -> None:
    wrong = scope.misfit(edit.source, edit.target)
    if wrong:
        raise ValueError(wrong)
    target = scope._end(edit.target, "inputs")
    scope.wires.pop(target, None)
    scope.connect(edit.source, edit.target)


@_apply.register
def _(edit: ask.Disconnect, scope: Diagram, document: Diagram) -> None:
    scope.disconnect(edit.target)


@_apply.register
def _(edit: ask.Move, scope: Diagram, document: Diagram) -> None:
    check(edit.positions or edit.boxes, "positions", edit.positions, "at least one")
    for name in edit.positions:
        _node(scope, name)
    _place(scope, edit.positions)
    comments = dict(scope.layout.get("comments", {}))
    for id, box in edit.boxes.items():
        if id not in comments:
            raise unknown("comment", id, comments)
        comments[id] = comments[id] | {"box": _box(box)}
    _lay(scope, "comments", comments)


@_apply.register
def _(edit: ask.Comment, scope: Diagram, document: Diagram) -> None:
    comments = dict(scope.layout.get("comments", {}))
    if edit.id is not None and edit.id not in comments:
        raise unknown("comment", edit.id, comments)
    id = edit.id or next(str(n) for n in range(1, len(comments) + 2) if str(n) not in comments)
    box = comments.get(id, {}).get("box") if edit.box is None else edit.box
    _lay(scope, "comments", comments | {id: {"text": edit.text, "box": _box(box)}})


@_apply.register
def _(edit: ask.Paste, scope: Diagram, document: Diagram) -> None:
    given = _files.loads(json.dumps(edit.fragment))
    check(given.nodes, "fragment", "no blocks", "at least one block")
    places = given.layout.get("positions", {})
    corner = [min((place[n] for place in places.values()), default=0.0) for n in (0, 1)]
    named = {}
    for name, node in given.nodes.items():
        named[name] = fresh_name(scope, name)
        scope.add(named[name], node.block, fresh_id(document, named[name]))
    scope.wires |= {(named[t], p): (named[s], q) for (t, p), (s, q) in given.wires.items()}
    to = corner if edit.position is None else edit.position
    _place(scope, {named[name]: (x - corner[0] + to[0], y - corner[1] + to[1]) for name, (x, y) in places.items()})


@_apply.register
def _(edit: ask.Group, scope: Diagram, document: Diagram) -> None:
    for name in edit.names:
        _node(scope, name)
    group(scope, document, list(dict.fromkeys(edit.names)), edit.name)


@_apply.register
def _(edit: ask.Ungroup, scope: Diagram, document: Diagram) -> None:
    check(isinstance(_node(scope, edit.name).block, Diagram), "name", edit.name, "a subsystem")
    ungroup(scope, document, edit.name)


def _follow(outer: Diagram, edit: ask.Edit) -> None:
    """Keep the wires outside in step with the ports of a subsystem that changed inside."""
    name = edit.at[-1]
    inner = outer.nodes[name].block
    if isinstance(edit, ask.Rename) and isinstance(inner.nodes[edit.to].block, Inlet | Outlet):  # type: ignore[union-attr]

        def swap(end: tuple[str, str]) -> tuple[str, str]:
            return (name, edit.to) if end == (name, edit.name) else end

        outer.wires = {swap(target): swap(source) for target, source in outer.wires.items()}
    inputs, outputs = inner.inputs, inner.outputs
    outer.wires = {
        target: source
        for target, source in outer.wires.items()
        if (target[0] != name or target[1] in inputs) and (source[0] != name or source[1] in outputs)
    }


def _node(scope: Diagram, name: str) -> Node:
    if name not in scope.nodes:
        raise unknown("block", name, scope.nodes)
    return scope.nodes[name]


def _place(scope: Diagram, positions: Any) -> None:
    """Note where blocks are; at `None` they are nowhere any more."""
    places = {
        **scope.layout.get("positions", {}),
        **{name: None if at is None else [float(x) for x in at] for name, at in positions.items()},
    }
    _lay(scope, "positions", {name: at for name, at in places.items() if at is not None})


def _lay(scope: Diagram, part: str, table: dict[str, Any]) -> None:
    rest = {name: value for name, value in scope.layout.items() if name != part}
    scope.layout = {**rest, part: table} if table else rest


def _box(box: Any) -> list[float]:
    check(box is not None and len(box) == 4 and min(box[2:]) > 0, "box", box, "x, y, width and height, these above 0")
    return [float(x) for x in box or ()]


def retuned(document: Diagram, address: str, value: Any) -> Diagram:
    """The document with another value of the parameter at an address."""
    path, _, name = address.partition(".")
    *at, block = path.split("/")
    node = _node(opened(document, at)[-1], block)
    known = {} if isinstance(node.block, Diagram) else {**parameters_of(type(node.block)), **node.block.parameters}
    if name not in known:
        raise unknown(f"parameter of {path}:", name, known)
    return edited(document, ask.Set(at, block, name, value))


def frozen(document: Diagram, change: ask.Freeze) -> Diagram:
    """The document with a block, or one of its units, frozen or thawed."""
    path = change.address.removesuffix(".frozen")
    *at, name = path.split("/")
    block = _node(opened(document, at)[-1], name).block
    can = not isinstance(block, Diagram) and "frozen" in parameters_of(type(block))
    check(can, "address", change.address, "a block that learns, with the parameter 'frozen'")
    now = block.values()["frozen"]  # type: ignore[union-attr]
    if change.unit is None:
        return retuned(document, f"{path}.frozen", np.full(now.shape, change.on).tolist())
    check(now.ndim == 1, "unit", change.unit, "null: the units of this block are frozen as one")
    check(0 <= change.unit < len(now), "unit", change.unit, f"a whole number in 0 … {len(now) - 1}")
    return retuned(document, f"{path}.frozen", np.where(np.arange(len(now)) == change.unit, change.on, now).tolist())


def selection(document: Diagram, at: list[str], names: list[str]) -> dict[str, Any]:
    """Some blocks and the wires between them, as a document to be pasted."""
    scope = opened(document, at)[-1]
    for name in names:
        _node(scope, name)
    part, chosen = Diagram(scope.tick), set(names)
    part.nodes = {name: node for name, node in scope.nodes.items() if name in chosen}
    part.wires = {t: s for t, s in scope.wires.items() if t[0] in chosen and s[0] in chosen}
    _place(part, {name: at for name, at in scope.layout.get("positions", {}).items() if name in chosen})
    return json.loads(_files.dumps(part))
