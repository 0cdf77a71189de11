"""What a diagram amounts to, once it is seen to be right: both the interpreter and the compiler begin here."""

import dataclasses

from motorgrad.lab._diagram import Diagram
from motorgrad.lab._flat import Placed, flatten
from motorgrad.lab._order import moving, sort
from motorgrad.lab._problems import DiagramError, Problem
from motorgrad.lab._verify import verify


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """The blocks of a diagram, flat; an `order` to evaluate them in; those that are `moving` within a tick."""

    tick: float
    substeps: int
    blocks: tuple[Placed, ...]
    order: tuple[int, ...]
    moving: frozenset[int]


def plan(diagram: Diagram) -> Plan:
    """The plan of a diagram. **Raises** `DiagramError` with all that is wrong with it."""
    made, found = _attempt(diagram)
    if made is None:
        raise DiagramError(found)
    return made


def problems(diagram: Diagram) -> list[Problem]:
    """All that keeps a diagram from running, by block and port; empty if nothing does."""
    return _attempt(diagram)[1]


def _attempt(diagram: Diagram) -> tuple[Plan | None, list[Problem]]:
    flat, found = flatten(diagram)
    found = found or [problem for placed in flat for problem in verify(placed)]
    if found:
        return None, found
    order, found = sort(flat)
    if found:
        return None, found
    return Plan(diagram.tick, diagram.substeps, tuple(flat), tuple(order), frozenset(moving(flat, order))), []
