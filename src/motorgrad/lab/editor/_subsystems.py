"""Blocks into a subsystem, and out of it again."""

from typing import Any

from motorgrad._errors import check
from motorgrad.lab._diagram import Diagram, End, Node
from motorgrad.lab.blocks._boundary import Inlet, Outlet
from motorgrad.lab.blocks._constant import Constant
from motorgrad.lab.editor._names import fresh_id, fresh_name

ASIDE = 160.0  # between a block and the inlet or outlet beside it
BELOW = 70.0  # between one inlet and the next


def group(scope: Diagram, document: Diagram, names: list[str], name: str | None) -> None:
    """Make a subsystem of blocks. Each keeps its id, and with it its random numbers and its state."""
    check(names, "names", names, "at least one")
    for each in names:
        boundary = isinstance(scope.nodes[each].block, Inlet | Outlet)
        check(not boundary, "names", each, "no inlet or outlet: these stay in their diagram")
    inside, inner = set(names), Diagram(scope.tick)
    for each in scope.nodes:
        if each in inside:
            inner.nodes[each] = scope.nodes[each]
    places = scope.layout.get("positions", {})
    own = {each: place for each, place in places.items() if each in inside}
    entering = {t: s for t, s in scope.wires.items() if t[0] in inside and s[0] not in inside}
    leaving = {t: s for t, s in scope.wires.items() if s[0] in inside and t[0] not in inside}
    inner.wires = {t: s for t, s in scope.wires.items() if t[0] in inside and s[0] in inside}
    outer = {t: s for t, s in scope.wires.items() if t[0] not in inside and s[0] not in inside}
    rest = {each: node for each, node in scope.nodes.items() if each not in inside}
    scope.nodes, scope.wires = rest, outer
    title = fresh_name(scope, "subsystem") if name is None else name
    scope.add(title, inner, "")
    scope.nodes[title] = Node(inner, "")

    left, right, top = _extent(own)
    inlets: dict[End, str] = {}
    for target, source in entering.items():
        if source not in inlets:
            port = scope.nodes[source[0]].block.outputs[source[1]]
            inlets[source] = fresh_name(inner, target[1])
            inlet = Inlet(shape=port.shape, kind=port.kind)
            inner.add(inlets[source], inlet, fresh_id(document, inlets[source]))
            own[inlets[source]] = [left - ASIDE, top + BELOW * (len(inlets) - 1)]
        inner.wires[target] = (inlets[source], "y")
        scope.wires[title, inlets[source]] = source
    outlets: dict[End, str] = {}
    for target, source in leaving.items():
        if source not in outlets:
            port = inner.nodes[source[0]].block.outputs[source[1]]
            outlets[source] = fresh_name(inner, source[1])
            inner.add(outlets[source], Outlet(port.shape, port.kind), fresh_id(document, outlets[source]))
            inner.wires[outlets[source], "u"] = source
            own[outlets[source]] = [right + ASIDE, top + BELOW * (len(outlets) - 1)]
        scope.wires[target] = (title, outlets[source])
    placed = {each: place for each, place in places.items() if each not in inside}
    if any(each in places for each in inside):
        inner.layout = {"positions": own}
        placed[title] = [(left + right) / 2, top]
    if placed or "positions" in scope.layout:
        scope.layout = scope.layout | {"positions": placed}


def ungroup(scope: Diagram, document: Diagram, name: str) -> None:
    """Put the blocks of a subsystem in its place. Where that had an id of its own, its blocks get new ones, and with
    them other random numbers."""
    node = scope.nodes[name]
    inner: Any = node.block
    around = {t: s for t, s in scope.wires.items() if name in (t[0], s[0])}
    fed = {t[1]: s for t, s in around.items() if t[0] == name}
    places, outer = inner.layout.get("positions", {}), dict(scope.layout.get("positions", {}))
    corner = _extent(places)[0], _extent(places)[2]
    at = outer.pop(name, None) or corner
    scope.remove(name)
    named = {}
    for each, part in sorted(inner.nodes.items(), key=lambda item: isinstance(item[1].block, Inlet)):
        block = part.block
        if isinstance(block, Outlet) or (isinstance(block, Inlet) and each in fed):
            continue
        if isinstance(block, Inlet):
            check(block.kind == "float", each, block.kind, "wired from outside: an inlet of this kind has no constant")
            block = Constant(block.value, block.shape)
        named[each] = fresh_name(scope, each)
        keeps = node.id == "" and block is part.block
        scope.nodes[named[each]] = Node(block, part.id if keeps else fresh_id(document, named[each]))
        if each in places:
            outer[named[each]] = [places[each][n] - corner[n] + at[n] for n in (0, 1)]

    def origin(end: End | None, seen: frozenset[End] = frozenset()) -> End | None:
        """Where a signal inside comes from, once the subsystem is gone."""
        if end is None or end in seen:
            return None
        if end[0] in fed and isinstance(inner.nodes[end[0]].block, Inlet):
            source = fed[end[0]]
            return source if source[0] != name else origin(inner.wires.get((source[1], "u")), seen | {end})
        return named[end[0]], end[1]

    for (block, port), source in inner.wires.items():
        found = origin(source)
        if block in named and found:
            scope.wires[named[block], port] = found
    for target, source in around.items():
        if target[0] != name:
            found = origin(inner.wires.get((source[1], "u")))
            if found:
                scope.wires[target] = found
    if outer or "positions" in scope.layout:
        scope.layout = scope.layout | {"positions": outer}


def _extent(places: dict[str, Any]) -> tuple[float, float, float]:
    """The left and the right edge of what has a place, and its top."""
    across = [place[0] for place in places.values()] or [0.0]
    return min(across), max(across), min((place[1] for place in places.values()), default=0.0)
