"""Plans: the checked, flat form of a diagram from which both the compiler and the interpreter start."""

import dataclasses
from collections.abc import Sequence

from motorgrad._errors import unknown
from motorgrad.lab.diagram import Diagram, DiagramError, Outlet, Placed, Problem, Source, flatten, verify


def direct_sources(placed: Placed) -> dict[str, Source]:
    """The sources of the inputs that a block's outputs depend on within the tick."""
    ports = placed.block.inputs
    return {port: source for port, source in placed.sources.items() if ports[port].feedthrough}


def evaluation_order(flat: Sequence[Placed]) -> tuple[list[int], list[Problem]]:
    """An order in which every block comes after the blocks that it reads from within the tick.

    If there is none, the problem names an algebraic loop.
    """
    order: list[int] = []
    waiting = {i: {source.block for source in direct_sources(each).values()} for i, each in enumerate(flat)}
    readers: dict[int, list[int]] = {i: [] for i in waiting}
    for i, sources in waiting.items():
        for source in sources:
            readers[source].append(i)
    ready = [i for i, sources in waiting.items() if not sources]
    while ready:
        i = ready.pop(0)
        order.append(i)
        for reader in readers[i]:
            waiting[reader].discard(i)
            if not waiting[reader]:
                ready.append(reader)
    stuck = {i for i, sources in waiting.items() if sources}
    return order, [_algebraic_loop(flat, stuck)] if stuck else []


def _algebraic_loop(flat: Sequence[Placed], stuck: set[int]) -> Problem:
    """The cycle among blocks that wait for each other."""
    walk = [min(stuck)]
    while True:  # walks back from input to source; every stuck block waits for another stuck one
        port, source = next((p, s) for p, s in direct_sources(flat[walk[-1]]).items() if s.block in stuck)
        if source.block in walk:
            cycle = walk[walk.index(source.block) :][::-1]
            names = " → ".join(flat[i].path for i in [*cycle, cycle[0]])
            first = flat[walk[-1]]
            return Problem(first.path, port, f"algebraic loop: {names}; insert a delay")
        walk.append(source.block)


def moving_blocks(flat: Sequence[Placed], order: Sequence[int]) -> set[int]:
    """The blocks whose outputs change within a tick: they are evaluated again inside an RK4 step."""
    found: set[int] = set()
    for i in order:
        timing = flat[i].block.timing
        reached = any(source.block in found for source in direct_sources(flat[i]).values())
        if timing == "continuous" or (timing == "inherited" and reached):
            found.add(i)
    return found


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """The flat blocks of a diagram, an `order` to evaluate them in, and the blocks that are `moving` within a tick."""

    tick: float
    substeps: int
    blocks: tuple[Placed, ...]
    order: tuple[int, ...]
    moving: frozenset[int]


def plan(diagram: Diagram) -> Plan:
    """The plan of a diagram. **Raises** `DiagramError` with everything that keeps it from running."""
    made, found = _checked(diagram)
    if made is None:
        raise DiagramError(found)
    return made


def problems(diagram: Diagram) -> list[Problem]:
    """Everything that keeps a diagram from running, by block and port; empty if it can run."""
    return _checked(diagram)[1]


def _checked(diagram: Diagram) -> tuple[Plan | None, list[Problem]]:
    flat, found = flatten(diagram)
    found = found or [problem for placed in flat for problem in verify(placed)]
    if found:
        return None, found
    order, found = evaluation_order(flat)
    if found:
        return None, found
    return Plan(diagram.tick, diagram.substeps, tuple(flat), tuple(order), frozenset(moving_blocks(flat, order))), []


WATCHED = "/"
"""Prefix of the path of a watched output, which no block's path has."""


def with_watched(plan: Plan, addresses: Sequence[str]) -> Plan:
    """The plan with an outlet at each of these outputs, given by addresses `"block.port"`.

    **Raises** `ValueError` for an unknown output.
    """
    found = {
        f"{placed.path}.{name}": (Source(i, name), port)
        for i, placed in enumerate(plan.blocks)
        for name, port in placed.block.outputs.items()
    }
    blocks, order = list(plan.blocks), list(plan.order)
    for address in dict.fromkeys(addresses):
        if address not in found:
            raise unknown("output", address, found)
        source, port = found[address]
        order.append(len(blocks))
        outlet = Outlet(port.shape, port.kind)
        blocks.append(Placed(WATCHED + address, WATCHED + address, outlet, {"u": source}, 1))
    return dataclasses.replace(plan, blocks=tuple(blocks), order=tuple(order))


def address_of(placed: Placed, port: str) -> str:
    """The address under which a record lists a sink's port."""
    return placed.path.removeprefix(WATCHED) if placed.path.startswith(WATCHED) else f"{placed.path}.{port}"
