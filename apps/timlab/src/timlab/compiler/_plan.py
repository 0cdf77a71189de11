"""Plans: the checked, flat form of a diagram from which both the compiler and the interpreter start."""

import dataclasses
from collections.abc import Mapping, Sequence

from motorgrad._arguments import check_arguments
from motorgrad._errors import unknown
from motorgrad._limits import MAX_DIAGRAM_SIGNALS, MAX_DIAGRAM_STATES
from timlab.diagram import (
    Block,
    Diagram,
    DiagramError,
    HostBlock,
    Outlet,
    Placed,
    Problem,
    Source,
    flatten,
    in_precision,
    numbers_at_ports,
    numbers_in_state,
    shared,
    verify,
)


def direct_sources(placed: Placed) -> dict[str, Source]:
    """The sources of the inputs that a block's outputs depend on within the tick."""
    ports = placed.block.inputs
    return {port: source for port, source in placed.sources.items() if ports[port].feedthrough}


def evaluation_order(flat: Sequence[Placed], solve: bool = False) -> tuple[list[int], set[int], list[Problem]]:
    """An order in which every block comes after the blocks that it reads from within the tick.

    If there is none, the problem names an algebraic loop; or to `solve` it, one of its blocks is torn: the blocks that
    read it come first. **Returns** the order, the torn blocks, and the problems.
    """
    order: list[int] = []
    torn: set[int] = set()
    waiting = {i: {source.block for source in direct_sources(each).values()} for i, each in enumerate(flat)}
    readers: dict[int, list[int]] = {i: [] for i in waiting}
    for i, sources in waiting.items():
        for source in sources:
            readers[source].append(i)
    ready = [i for i, sources in waiting.items() if not sources]

    def release(i: int) -> None:
        for reader in readers[i]:
            if i in waiting[reader]:
                waiting[reader].discard(i)
                if not waiting[reader]:
                    ready.append(reader)

    while True:
        while ready:
            i = ready.pop(0)
            order.append(i)
            release(i)
        stuck = {i for i, sources in waiting.items() if sources}
        if not stuck:
            return order, torn, []
        cycle = _cycle(flat, stuck, torn)
        hosts = any(isinstance(placed.block, HostBlock) for placed in flat)
        real = [i for i in cycle if all(port.kind == "float" for port in flat[i].block.outputs.values())]
        if not (solve and real) or hosts:
            return order, torn, [_algebraic_loop(flat, cycle, solve, hosts)]
        torn.add(real[0])
        release(real[0])


def _cycle(flat: Sequence[Placed], stuck: set[int], torn: set[int]) -> list[int]:
    """A cycle among blocks that wait for each other."""
    walk = [min(stuck)]
    while True:  # walks back from input to source; every stuck block waits for another stuck one
        sources = (source.block for source in direct_sources(flat[walk[-1]]).values())
        source = next(each for each in sources if each in stuck and each not in torn)
        if source in walk:
            return walk[walk.index(source) :][::-1]
        walk.append(source)


def _algebraic_loop(flat: Sequence[Placed], cycle: list[int], solve: bool, hosts: bool) -> Problem:
    names = " → ".join(flat[i].path for i in [*cycle, cycle[0]])
    first = flat[cycle[0]]
    last = cycle[-1]
    port = next(port for port, source in direct_sources(first).items() if source.block == last)
    why = "" if not solve else " (it cannot be solved beside blocks on the host)" if hosts else " (of conditions only)"
    return Problem(first.path, port, f"algebraic loop: {names}; insert a delay{why}")


def is_mode(block: Block) -> bool:
    """Whether a block's state is discrete but may change at zero crossings between ticks, like a relay's."""
    return block.switches and not block.is_continuous


def moving_blocks(flat: Sequence[Placed], order: Sequence[int], adapts: bool) -> set[int]:
    """The blocks whose outputs change within a tick: they are evaluated again inside a step of the solver. Where it
    `adapts` its steps, that includes modes that continuous blocks reach.
    """
    found: set[int] = set()
    adapts = adapts and any(placed.block.is_continuous for placed in flat)
    before = -1
    while len(found) > before:  # once, or again where an algebraic loop leads back
        before = len(found)
        for i in order:
            timing = flat[i].block.timing
            if adapts and is_mode(flat[i].block) and flat[i].ticks == 1:
                timing = "inherited"
            reached = any(source.block in found for source in direct_sources(flat[i]).values())
            if timing == "continuous" or (timing == "inherited" and reached):
                found.add(i)
    return found


@dataclasses.dataclass(frozen=True)
class Solver:
    """How continuous states are integrated; see `Diagram`."""

    name: str
    substeps: int
    tolerances: tuple[float, float]
    precision: str
    loops: str

    @property
    def adapts(self) -> bool:
        """Whether the length of its steps is adapted to the error."""
        return self.name != "rk4"


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """The flat blocks of a diagram, an `order` to evaluate them in, and the blocks that are `moving` within a tick."""

    tick: float
    solver: Solver
    blocks: tuple[Placed, ...]
    order: tuple[int, ...]
    moving: frozenset[int]
    torn: frozenset[int]
    """Blocks whose outputs are guessed and then found by iteration, because an algebraic loop leads through them."""
    shared: Mapping[str, tuple[str, ...]]
    """The addresses of blocks' parameters that parameters of diagrams stand for."""
    on_fault: str = "stop"


def plan(diagram: Diagram) -> Plan:
    """The plan of a diagram. **Raises** `DiagramError` with everything that keeps it from running."""
    with in_precision(diagram.precision):
        made, found = _checked(diagram)
    if made is None:
        raise DiagramError(found)
    return made


def problems(diagram: Diagram) -> list[Problem]:
    """Everything that keeps a diagram from running, by block and port; empty if it can run."""
    check_arguments(problems, locals())
    with in_precision(diagram.precision):
        return _checked(diagram)[1]


def _checked(diagram: Diagram) -> tuple[Plan | None, list[Problem]]:
    flat, found = flatten(diagram)
    found = found or [problem for placed in flat for problem in verify(placed)] or _too_large(flat)
    if found:
        return None, found
    order, torn, found = evaluation_order(flat, diagram.loops == "solve")
    if found:
        return None, found
    tolerances = (diagram.relative_tolerance, diagram.absolute_tolerance)
    solver = Solver(diagram.solver, diagram.substeps, tolerances, diagram.precision, diagram.loops)
    moving = moving_blocks(flat, order, solver.adapts)
    parts = tuple(flat), tuple(order), frozenset(moving), frozenset(torn)
    return Plan(diagram.tick, solver, *parts, shared(diagram), diagram.on_fault), []


def _too_large(flat: Sequence[Placed]) -> list[Problem]:
    """The problem with a diagram that would take more memory than a few lines of a file should."""
    limits = (("ports", numbers_at_ports, MAX_DIAGRAM_SIGNALS), ("states", numbers_in_state, MAX_DIAGRAM_STATES))
    for where, count, most in limits:
        sizes = [count(placed.block) for placed in flat]
        if sum(sizes) > most:
            largest = flat[sizes.index(max(sizes))].path
            said = (
                f"{max(sizes):,} of the {sum(sizes):,} numbers in the {where} of the diagram: must be at most {most:,}"
            )
            return [Problem(largest, None, said)]
    return []


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
    blocks = list(plan.blocks)
    order = list(plan.order)
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
