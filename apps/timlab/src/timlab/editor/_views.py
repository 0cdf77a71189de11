"""What clients see of a diagram, and the declarations of all block types.

The view of a diagram has its `head` (its settings, such as title, tick and solver), its `nodes` by name, its `wires`
(from `source` to `target`, both `"block.port"`) and its `layout`: `positions` by name, and `comments` by id, each with
a `text` and a `box`.

A node has `name`, `type`, `id`, `category`, `fields`, `inputs` and `outputs` (lists of ports) and its `position`,
`null` if it has none. A subsystem, of type `"diagram"`, has the view of its diagram as `inner`. A sink that draws has
`drawing`, the kind of drawing. A block that learns and can be frozen has `frozen`: one truth value, or one per unit
where units can be frozen separately. `uses` has the parameters of the diagram that stand for its own. A port has
`follows`, whether it takes its shape from its wire.
"""

import dataclasses
import functools
import math
import types
import typing
from collections.abc import Iterator, Mapping
from typing import Any

from motorgrad.schema import Declared, declared_by, fields_of, hints_of, options_of, summary_of
from timlab.blocks._formulas import RESERVED
from timlab.diagram import (
    BLOCKS,
    SCHEDULE,
    SHARED,
    SUBSYSTEM,
    Block,
    Diagram,
    Node,
    Ports,
    allowed_in,
    choices_of,
    outline,
    parameters_of,
    required_fields,
    wired_shapes,
)
from timlab.editor._program import learns
from timlab.gallery import GALLERY

View = dict[str, Any]


def view(diagram: Diagram) -> View:
    """The whole view of a diagram."""
    nodes = {name: view_of_node(diagram, name) for name in diagram.nodes}
    return {"head": diagram.head, "nodes": nodes, "wires": wires(diagram), "layout": diagram.layout}


def wires(diagram: Diagram) -> list[View]:
    """All wires, sorted by target."""
    return [{"source": ".".join(s), "target": ".".join(t)} for t, s in sorted(diagram.wires.items())]


def view_of_node(diagram: Diagram, name: str, inner: bool = True) -> View:
    """The view of one block, with or without the contents of a subsystem."""
    node = diagram.nodes[name]
    return {
        "name": name,
        "id": node.id,
        "position": diagram.layout.get("positions", {}).get(name),
        "inputs": _ports_at(diagram, name, "inputs"),
        "outputs": _ports_at(diagram, name, "outputs"),
        "uses": diagram.uses_of(name),
        **(_subsystem(node.block, inner) if isinstance(node.block, Diagram) else _block(node.block)),
    }


def _subsystem(diagram: Diagram, inner: bool) -> View:
    own: View = {"type": SUBSYSTEM, "category": "subsystems", "fields": diagram.head | diagram.parameters}
    if diagram.parameters:
        own["parameters"] = _added_fields(dict.fromkeys(diagram.parameters, SHARED), diagram.parameters)
    return own | {"inner": view(diagram)} if inner else own


def _block(block: Block) -> View:
    fields = {name: getattr(block, name) for name in fields_of(type(block))}
    more = {name: declared for name, declared in block.parameters.items() if name not in fields}
    fields |= {name: getattr(block, name) for name in more}
    own: View = {"type": block.name, "category": block.category, "fields": fields}
    if more:  # parameters that settings add to those of the type
        own["parameters"] = _added_fields(more, fields)
    drawing = getattr(type(block), "drawing", None)
    own |= {} if drawing is None else {"drawing": drawing}
    return own | {"frozen": block.values()["frozen"].tolist()} if "frozen" in fields else own


def _added_fields(declared: Mapping[str, Declared], values: Mapping[str, Any]) -> list[View]:
    """The declarations of parameters that a block's type does not declare."""
    usual = {"type": "float", "required": False}
    return [{"name": name, **usual, **_field(each, True), "default": values[name]} for name, each in declared.items()]


def _field(declared: Declared, is_parameter: bool, allowed: str = "") -> View:
    """What a field declares, as data."""
    own: View = {"role": "parameter" if is_parameter else "setting", "help": declared.help, "unit": declared.unit}
    if declared.range is None:
        return own
    low, high, open_low, open_high, kind = declared.range
    ends = {"low": None if math.isinf(low) else low, "high": None if math.isinf(high) else high}
    is_open = open_low and (open_high or math.isinf(high))
    return own | ends | {"open": is_open, "kind": kind, "allowed": allowed or declared.allowed}


def ports(declared: Ports) -> list[View]:
    """Ports as data, in order."""
    return [{"name": name, **dataclasses.asdict(port)} for name, port in declared.items()]


def _ports_at(diagram: Diagram, name: str, side: str) -> list[View]:
    """The ports on one side of a block, and whether their shapes follow from wires."""
    own = ports(getattr(diagram.nodes[name].block, side))
    return [port | {"follows": port["shape"] == () and diagram.takes((name, port["name"]), side, (2,))} for port in own]


def shapes(diagram: Diagram) -> View:
    """The shapes that wires give to ports, by address, where they are not `()`."""
    return {address: list(shape) for address, shape in wired_shapes(diagram).items() if shape}


def difference(old: Diagram, new: Diagram, at: tuple[str, ...] = ()) -> Iterator[View]:
    """The changes that turn the view of `old` into that of `new`. For each diagram `at` which something changed: its
    new `nodes`, the names of those `removed`, and where they changed, all `wires`, the `layout` and the `head`.
    """
    if old is new:
        return
    found: View = {}
    nodes = {name: view_of_node(new, name, inner) for name, inner in _changed(old, new)}
    removed = [name for name in old.nodes if name not in new.nodes]
    found |= {"nodes": nodes} if nodes else {}
    found |= {"removed": removed} if removed else {}
    found |= {"wires": wires(new)} if old.wires != new.wires else {}
    found |= {"layout": new.layout} if old.layout != new.layout else {}
    found |= {"head": new.head} if old.head != new.head else {}
    if found:
        yield {"at": list(at), **found}
    for name, node in new.nodes.items():
        before = old.nodes.get(name)
        if before and isinstance(node.block, Diagram) and isinstance(before.block, Diagram):
            yield from difference(before.block, node.block, (*at, name))


def _changed(old: Diagram, new: Diagram) -> Iterator[tuple[str, bool]]:
    """The blocks whose view changed, and whether their contents must be sent too."""
    for name, node in new.nodes.items():
        before = old.nodes.get(name)
        if before is None or isinstance(before.block, Diagram) != isinstance(node.block, Diagram):
            yield name, True
        elif _visible_part(before, old, name) != _visible_part(node, new, name):
            yield name, False


def _visible_part(node: Node, diagram: Diagram, name: str) -> Any:
    """Everything that the view of a block shows in its own diagram."""
    block = node.block
    own: Any = (block.head, dict(block.inputs), dict(block.outputs)) if isinstance(block, Diagram) else block
    return node.id, own, diagram.uses_of(name), diagram.layout.get("positions", {}).get(name)


def declarations() -> dict[str, Any]:
    """Everything that a palette and its forms need: `categories`, each with the names of its types; `blocks` by type,
    including the subsystem; `gallery`, a list of name, title, comment, whether it `learns`, and the `boxes` and
    `wires` of its `outline`; `words`, the names that formulas know.
    """
    kinds = {name: declaration(cls) for name, cls in sorted(BLOCKS.items())}
    kinds[SUBSYSTEM] = _SUBSYSTEM
    categories: dict[str, list[str]] = {}
    for name, kind in kinds.items():
        categories.setdefault(kind["category"], []).append(name)
    sorted_categories = dict(sorted(categories.items()))
    return {"categories": sorted_categories, "blocks": kinds, "gallery": _gallery(), "words": sorted(RESERVED)}


@functools.cache
def declaration(cls: type[Block]) -> dict[str, Any]:
    """The declaration of a block type: name, category, `help`, `fields` in order, and the ports of a new block, `null`
    if some fields must be given.
    """
    parameters = parameters_of(cls)
    known = fields_of(cls)
    hints = hints_of(cls)
    fields = []
    required = required_fields(cls)
    for name in sorted(known, key=SCHEDULE.__contains__):  # the schedule comes last
        own: dict[str, Any] = {"name": name, "type": _hint_text(hints[name]), "required": name in required}
        own |= _field(declared_by(known[name]), name in parameters, allowed_in(cls, name))
        fields.append(own | {"choices": choices_of(cls, name)})
    new = None if required else cls()
    for field in fields:
        field["default"] = None if new is None else getattr(new, field["name"])
    return {
        "name": cls.name,
        "category": cls.category,
        "help": summary_of(cls),
        "fields": fields,
        "inputs": None if new is None else ports(new.inputs),
        "outputs": None if new is None else ports(new.outputs),
        "drawing": getattr(cls, "drawing", None),
    }


_SUBSYSTEM: dict[str, Any] = {
    "name": SUBSYSTEM,
    "category": "subsystems",
    "help": "A diagram used as a block. Its inlets and outlets are its ports.",
    "fields": [],
    "inputs": [],
    "outputs": [],
    "drawing": None,
}


@functools.cache
def _gallery() -> list[dict[str, Any]]:
    made = {name: make() for name, make in GALLERY.items()}
    return [
        {"name": name, "title": each.title, "comment": each.comment, "learns": learns(each), **outline(each)}
        for name, each in made.items()
    ]


def _hint_text(hint: object) -> str:
    """A type hint as source text, such as `int`, `float | None` or `tuple[int, ...]`."""
    if isinstance(hint, type) and not typing.get_args(hint):
        return hint.__name__
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return " | ".join(map(_hint_text, options_of(hint))).replace("NoneType", "None")
    return str(hint).replace("typing.", "").replace("collections.abc.", "")
