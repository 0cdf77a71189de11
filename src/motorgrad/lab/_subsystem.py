"""Blocks of a diagram taken together: as a diagram of their own, or as a subsystem in their place."""

from collections.abc import Iterable, Sequence

from motorgrad._errors import check, unknown
from motorgrad.lab._diagram import Diagram, End, Node
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._boundary import Inlet, Outlet


def cut(diagram: Diagram, names: Iterable[str]) -> Diagram:
    """Some blocks of a diagram, with the wires between them, as a diagram of their own.

    An inlet stands for every output outside that they read, and an outlet for every one of theirs that is read outside;
    each has the name of the block, or of block and port where that is taken. Blocks keep their ids. The diagram stays
    as it is.

    **Raises** `ValueError` for names that there are not.
    """
    return _taken(diagram, names)[0]


def group(diagram: Diagram, names: Iterable[str], name: str) -> Diagram:
    """The diagram with some of its blocks as a subsystem `name`; it computes what it did, with the same random numbers.

    **Raises** `ValueError` for names that there are not, and where there is another block of that name.
    """
    chosen = list(names)
    inner, inlets, outlets = _taken(diagram, chosen)
    check(name not in diagram.nodes or name in chosen, "name", name, "a new one in the diagram")
    other = diagram.copy()
    for each in chosen:
        other.remove(each)
    other.add(name, inner, id="")  # what is in it keeps its ids, so its random numbers and its state
    for source, inlet in inlets.items():
        other.connect(".".join(source), f"{name}.{inlet}")
    for target, source in diagram.wires.items():
        if target[0] not in chosen and source[0] in chosen:
            other.connect(f"{name}.{outlets[source]}", ".".join(target))
    return other


def _taken(diagram: Diagram, names: Iterable[str]) -> tuple[Diagram, dict[End, str], dict[End, str]]:
    """The cut, and the names of its inlets and outlets by the ends of wires that they stand for."""
    chosen = set(names)
    check(chosen, "names", sorted(chosen), "at least one block")
    for each in chosen:
        if each not in diagram.nodes:
            raise unknown("block", each, diagram.nodes)
    inner = Diagram(diagram.tick, diagram.substeps)
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
                inlets[source] = _add(inner, source, Inlet(shape=port.shape, kind=_given(diagram, source, port).kind))
            inner.wires[target] = (inlets[source], "y")
        elif source[0] in chosen and source not in outlets:
            port = diagram.nodes[source[0]].block.outputs[source[1]]
            outlets[source] = _add(inner, source, Outlet(port.shape, port.kind))
            inner.wires[outlets[source], "u"] = source
    return inner, inlets, outlets


def _given(diagram: Diagram, source: End, wanted: Port) -> Port:
    """The output at the beginning of a wire, or what its end wants where there is none."""
    node = diagram.nodes.get(source[0])
    return node.block.outputs.get(source[1], wanted) if node else wanted


def _add(inner: Diagram, end: End, block: Inlet | Outlet) -> str:
    """Put a boundary block into the cut under a name like the end that it stands for."""
    options: Sequence[str] = (end[0], " ".join(end), *(f"{' '.join(end)} {number}" for number in range(2, 1000)))
    return inner.add(next(name for name in options if name not in inner.nodes), block)
