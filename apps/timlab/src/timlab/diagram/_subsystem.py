"""Parts of a diagram: as a diagram of their own, or as a subsystem."""

from collections.abc import Iterable, Sequence
from typing import Any

from motorgrad._arguments import check_arguments
from motorgrad._errors import check, unknown
from timlab.diagram._diagram import Diagram, End, Inlet, Node, Outlet


def extract(diagram: Diagram, names: Iterable[str]) -> Diagram:
    """Extract some blocks of a diagram, with the wires between them, as a diagram of their own.

    Every outside output that they read becomes an inlet, and every output of theirs that is read outside becomes an
    outlet, named after the block, or after block and port where that name is taken. Blocks keep their ids. The original
    diagram is not changed.

    **Raises** `ValueError` for unknown names.
    """
    check_arguments(extract, locals())
    return _extracted(diagram, names)[0]


def group(diagram: Diagram, names: Iterable[str], name: str) -> Diagram:
    """The diagram with some of its blocks as a subsystem `name`. It computes the same, with the same random numbers.

    **Raises** `ValueError` for unknown names, and if another block has the name.
    """
    check_arguments(group, locals())
    chosen = list(names)
    inner, inlets, outlets = _extracted(diagram, chosen)
    check(name not in diagram.nodes or name in chosen, "name", name, "a new name in the diagram")
    other = diagram.copy()
    for each in chosen:
        other.remove(each)
    own = {f"{name}.{used}": used for used in inner.parameters}
    other.uses |= own
    other.add(name, inner, id="")  # its blocks keep their ids, and with them their random numbers and states
    for source, inlet in inlets.items():
        other.connect(".".join(source), f"{name}.{inlet}")
    for target, source in diagram.wires.items():
        if target[0] not in chosen and source[0] in chosen:
            other.connect(f"{name}.{outlets[source]}", ".".join(target))
    return other


def _extracted(diagram: Diagram, names: Iterable[str]) -> tuple[Diagram, dict[End, str], dict[End, str]]:
    """The extracted diagram, and the names of its inlets and outlets by the outputs that they stand for."""
    chosen = set(names)
    check(chosen, "names", sorted(chosen), "at least one block")
    for each in chosen:
        if each not in diagram.nodes:
            raise unknown("block", each, diagram.nodes)
    uses = {address: used for address, used in diagram.uses.items() if address.partition(".")[0] in chosen}
    parameters = {used: value for used, value in diagram.parameters.items() if used in uses.values()}
    head: dict[str, Any] = diagram.head | {"title": "", "comment": "", "parameters": parameters, "uses": uses}
    inner = Diagram(**head)
    for each, node in diagram.nodes.items():
        if each in chosen:
            block = node.block.copy() if isinstance(node.block, Diagram) else node.block
            inner.nodes[each] = Node(block, node.id)
    inlets: dict[End, str] = {}
    outlets: dict[End, str] = {}
    for target, source in diagram.wires.items():
        if target[0] in chosen and source[0] in chosen:
            inner.wires[target] = source
        elif target[0] in chosen:
            if source not in inlets:
                port = diagram.nodes[target[0]].block.inputs[target[1]]
                node = diagram.nodes.get(source[0])
                given = node.block.outputs.get(source[1], port) if node else port
                inlets[source] = _add_boundary(inner, source, Inlet(shape=port.shape, kind=given.kind))
            inner.wires[target] = (inlets[source], "y")
        elif source[0] in chosen and source not in outlets:
            port = diagram.nodes[source[0]].block.outputs[source[1]]
            outlets[source] = _add_boundary(inner, source, Outlet(port.shape, port.kind))
            inner.wires[outlets[source], "u"] = source
    return inner, inlets, outlets


def _add_boundary(inner: Diagram, end: End, block: Inlet | Outlet) -> str:
    """Add an inlet or outlet under a name like the output that it stands for."""
    options: Sequence[str] = (end[0], " ".join(end), *(f"{' '.join(end)} {number}" for number in range(2, 1000)))
    return inner.add(next(name for name in options if name not in inner.nodes), block)
