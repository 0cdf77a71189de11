"""What clients are shown of a diagram.

The view of a diagram has its `head` (title, comment, tick, substeps), its `nodes` by name, its `wires` (from `source`
to `target`, both `"block.port"`) and its `layout`: `positions` by name, and `comments` by id, each a `text` and a
`box`.

A node has `name`, `type`, `id`, `category`, `fields`, `inputs` and `outputs`, which are lists of ports, and its
`position`, `null` where it was never put anywhere; a subsystem, of type `"diagram"`, has the view of its diagram as
`inner`. A sink that draws has the way in which it does as `drawing`. What learns and can be frozen has `frozen`, one
truth value; or one for each unit, where units can be frozen singly. A block whose settings bring parameters beyond
those of its type has their fields as `parameters`.
"""

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from motorgrad.lab._block import Block
from motorgrad.lab._diagram import Diagram, Node
from motorgrad.lab._files import HEAD, SUBSYSTEM
from motorgrad.lab._parameter import Parameter

View = dict[str, Any]


def view(diagram: Diagram) -> View:
    """The whole view of a diagram."""
    nodes = {name: view_of_node(diagram, name) for name in diagram.nodes}
    return {"head": head(diagram), "nodes": nodes, "wires": wires(diagram), "layout": diagram.layout}


def head(diagram: Diagram) -> View:
    """Title, comment, tick and substeps."""
    return {name: getattr(diagram, name) for name in HEAD}


def wires(diagram: Diagram) -> list[View]:
    """All wires, by their target."""
    return [{"source": ".".join(s), "target": ".".join(t)} for t, s in sorted(diagram.wires.items())]


def view_of_node(diagram: Diagram, name: str, inner: bool = True) -> View:
    """One block, with or without what is in it."""
    node = diagram.nodes[name]
    return {
        "name": name,
        "id": node.id,
        "position": diagram.layout.get("positions", {}).get(name),
        "inputs": ports(node.block.inputs),
        "outputs": ports(node.block.outputs),
        **(_subsystem(node.block, inner) if isinstance(node.block, Diagram) else _block(node.block)),
    }


def _subsystem(diagram: Diagram, inner: bool) -> View:
    own = {"type": SUBSYSTEM, "category": "subsystems", "fields": head(diagram)}
    return own | {"inner": view(diagram)} if inner else own


def _block(block: Block) -> View:
    fields = {field.name: getattr(block, field.name) for field in dataclasses.fields(block) if field.init}
    more = {name: declared for name, declared in block.parameters.items() if name not in fields}
    fields |= {name: getattr(block, name) for name in more}
    own: View = {"type": block.name, "category": block.category, "fields": fields}
    if more:
        usual = {"type": "float", "required": False}
        own["parameters"] = [
            {"name": name, **usual, **parameter_field(declared), "default": fields[name]}
            for name, declared in more.items()
        ]
    drawing = getattr(type(block), "drawing", None)
    own |= {} if drawing is None else {"drawing": drawing}
    return own | {"frozen": block.values()["frozen"].tolist()} if "frozen" in fields else own


def parameter_field(declared: Parameter) -> View:
    """A parameter's declaration as data."""
    own = dataclasses.asdict(declared) | {"role": "parameter", "allowed": declared.allowed()}
    return own | {end: None if np.isinf(own[end]) else own[end] for end in ("low", "high")}


def ports(declared: Any) -> list[View]:
    """Ports as data, in order."""
    return [{"name": name, **dataclasses.asdict(port)} for name, port in declared.items()]


def difference(old: Diagram, new: Diagram, at: tuple[str, ...] = ()) -> Iterator[View]:
    """What to replace in the view of `old` to have that of `new`: for each diagram `at` which something changed, its
    new `nodes`, the names of those `removed`, and where they changed all `wires`, the `layout` and the `head`."""
    if old is new:
        return
    found: View = {}
    nodes = {name: view_of_node(new, name, inner) for name, inner in _changed(old, new)}
    removed = [name for name in old.nodes if name not in new.nodes]
    found |= {"nodes": nodes} if nodes else {}
    found |= {"removed": removed} if removed else {}
    found |= {"wires": wires(new)} if old.wires != new.wires else {}
    found |= {"layout": new.layout} if old.layout != new.layout else {}
    found |= {"head": head(new)} if head(old) != head(new) else {}
    if found:
        yield {"at": list(at), **found}
    for name, node in new.nodes.items():
        before = old.nodes.get(name)
        if before and isinstance(node.block, Diagram) and isinstance(before.block, Diagram):
            yield from difference(before.block, node.block, (*at, name))


def _changed(old: Diagram, new: Diagram) -> Iterator[tuple[str, bool]]:
    """The blocks that look otherwise, and whether what is in them is to be shown too."""
    for name, node in new.nodes.items():
        before = old.nodes.get(name)
        if before is None or isinstance(before.block, Diagram) != isinstance(node.block, Diagram):
            yield name, True
        elif _face(before, old, name) != _face(node, new, name):
            yield name, False


def _face(node: Node, diagram: Diagram, name: str) -> Any:
    """What is seen of a block in its own diagram."""
    block = node.block
    own: Any = (head(block), dict(block.inputs), dict(block.outputs)) if isinstance(block, Diagram) else block
    return node.id, own, diagram.layout.get("positions", {}).get(name)
