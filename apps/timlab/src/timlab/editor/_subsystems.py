"""Grouping blocks into a subsystem and ungrouping them in the editor, with unique names and ids."""

from collections.abc import Iterator
from typing import Any

from motorgrad._errors import check
from timlab.blocks import Constant
from timlab.diagram import MAX_NAME_CHARACTERS, Diagram, End, Gate, Inlet, Node, Outlet, checked_layout, numbered_names
from timlab.diagram import group as group_blocks


def fresh_name(scope: Diagram, like: str) -> str:
    """A name for a new block that the diagram does not contain: `like`, numbered if necessary."""
    return next(name for name in numbered_names(like) if name not in scope.nodes)


def fresh_id(document: Diagram, like: str) -> str:
    """An id that occurs nowhere in the document; a subsystem may pass on the ids of its blocks unchanged."""
    taken = set(_ids(document))
    return next(id for id in numbered_names(like[:MAX_NAME_CHARACTERS]) if id not in taken)


def _ids(diagram: Diagram) -> Iterator[str]:
    for node in diagram.nodes.values():
        yield node.id
        if isinstance(node.block, Diagram):
            yield from _ids(node.block)


ASIDE = 160.0  # between a block and the inlet or outlet beside it
BELOW = 70.0  # between one inlet and the next


def group(scope: Diagram, document: Diagram, names: list[str], name: str | None) -> None:
    """Turn blocks into a subsystem at their centre. Each keeps its id, and with it its random numbers and its state."""
    for each in names:
        boundary = isinstance(scope.nodes[each].block, Inlet | Outlet | Gate)
        check(not boundary, "names", each, "no inlet, outlet or gate: these stay in their diagram")
    title = fresh_name(scope, "subsystem") if name is None else name
    made = group_blocks(scope, names, title)
    scope.nodes = {each: scope.nodes.get(each, node) for each, node in made.nodes.items()}
    inner: Any = made.nodes[title].block
    scope.nodes[title] = Node(inner, "")
    scope.uses = made.uses
    places = scope.layout.get("positions", {})
    own = {each: place for each, place in places.items() if each in names}
    left, right, top = _extent(own)
    for kind, across in ((Inlet, left - ASIDE), (Outlet, right + ASIDE)):
        added = [each for each, node in inner.nodes.items() if isinstance(node.block, kind)]
        for number, each in enumerate(added):
            inner.nodes[each] = Node(inner.nodes[each].block, fresh_id(document, each))
            own[each] = [across, top + BELOW * number]
    scope.wires = made.wires
    placed = {each: place for each, place in places.items() if each not in names}
    if any(each in places for each in names):
        inner.layout = checked_layout({"positions": own})
        placed[title] = [(left + right) / 2, top]
    if "positions" in scope.layout:
        scope.layout = scope.layout | {"positions": placed}


def ungroup(scope: Diagram, document: Diagram, name: str) -> None:
    """Replace a subsystem with its blocks. If the subsystem had an id of its own, its blocks get new ids, and with them
    other random numbers.
    """
    node = scope.nodes[name]
    inner: Any = node.block
    gates = [each for each, part in inner.nodes.items() if isinstance(part.block, Gate)]
    check(not gates, name, f"a subsystem with {', '.join(gates)}", "without a condition, to be replaced by its blocks")
    around = {t: s for t, s in scope.wires.items() if name in (t[0], s[0])}
    fed = {t[1]: s for t, s in around.items() if t[0] == name}
    places = inner.layout.get("positions", {})
    outer = dict(scope.layout.get("positions", {}))
    corner = _extent(places)[0], _extent(places)[2]
    at = outer.pop(name, None) or corner
    outside = scope.uses_of(name)
    values = inner.parameters | {own: scope.parameters[used] for own, used in outside.items()}
    scope.remove(name)
    named = {}
    for each, part in sorted(inner.nodes.items(), key=lambda item: isinstance(item[1].block, Inlet)):
        block = part.block
        if isinstance(block, Outlet) or (isinstance(block, Inlet) and each in fed):
            continue
        if isinstance(block, Inlet):
            check(block.kind == "float", each, block.kind, "connected outside: there is no constant of this kind")
            block = Constant(block.value, block.shape)
        named[each] = fresh_name(scope, each)
        keeps = node.id == "" and block is part.block
        for own, used in inner.uses_of(each).items():
            block = with_parameter(block, own, values[used])
            if used in outside:
                scope.uses = scope.uses | {f"{named[each]}.{own}": outside[used]}
        scope.nodes[named[each]] = Node(block, part.id if keeps else fresh_id(document, named[each]))
        if each in places:
            outer[named[each]] = [places[each][n] - corner[n] + at[n] for n in (0, 1)]

    def origin(end: End | None, seen: frozenset[End] = frozenset()) -> End | None:
        """The source of an inner signal once the subsystem is gone."""
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


def with_parameter(block: Any, name: str, value: Any) -> Any:
    """A block or a subsystem with another value of a parameter."""
    if not isinstance(block, Diagram):
        return block.retuned({name: value})
    other = block.copy()
    other.parameters[name] = value
    return other


def _extent(places: dict[str, Any]) -> tuple[float, float, float]:
    """The left and right edges of the positions, and their top."""
    across = [place[0] for place in places.values()] or [0.0]
    return min(across), max(across), min((place[1] for place in places.values()), default=0.0)
