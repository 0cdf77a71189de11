"""Names and ids that are not taken."""

from collections.abc import Iterator

from motorgrad.lab._diagram import LONGEST, Diagram, numbered


def fresh_name(scope: Diagram, like: str) -> str:
    """A name for a new block, that one has not in the diagram: `like`, or that with a number."""
    return next(name for name in numbered(like) if name not in scope.nodes)


def fresh_id(document: Diagram, like: str) -> str:
    """An id that nothing has anywhere in the document, as a subsystem may leave the ids of its blocks as they are."""
    taken = set(_ids(document))
    return next(id for id in numbered(like[:LONGEST]) if id not in taken)


def _ids(diagram: Diagram) -> Iterator[str]:
    for node in diagram.nodes.values():
        yield node.id
        if isinstance(node.block, Diagram):
            yield from _ids(node.block)
