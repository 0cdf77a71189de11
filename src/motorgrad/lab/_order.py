"""In which order blocks are evaluated, and which of them move continuously."""

from collections.abc import Sequence

from motorgrad.lab._flat import Placed, Source
from motorgrad.lab._problems import Problem


def feeds(placed: Placed) -> dict[str, Source]:
    """The sources of the inputs that its outputs depend on at once."""
    ports = placed.block.inputs
    return {port: source for port, source in placed.sources.items() if ports[port].feedthrough}


def sort(flat: Sequence[Placed]) -> tuple[list[int], list[Problem]]:
    """An order in which every block comes after those that it reads from at once.

    Where there is none, the problem names a cycle of blocks without delay.
    """
    order: list[int] = []
    waiting = {i: {source.block for source in feeds(each).values()} for i, each in enumerate(flat)}
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
    return order, [_loop(flat, stuck)] if stuck else []


def _loop(flat: Sequence[Placed], stuck: set[int]) -> Problem:
    """The cycle among blocks that wait for each other."""
    walk = [min(stuck)]
    while True:  # backwards, from input to source; every stuck block waits for a stuck one
        port, source = next((p, s) for p, s in feeds(flat[walk[-1]]).items() if s.block in stuck)
        if source.block in walk:
            cycle = walk[walk.index(source.block) :][::-1]
            names = " → ".join(flat[i].path for i in [*cycle, cycle[0]])
            first = flat[walk[-1]]
            return Problem(first.path, port, f"algebraic loop: {names}; put a delay into it")
        walk.append(source.block)


def moving(flat: Sequence[Placed], order: Sequence[int]) -> set[int]:
    """The blocks whose outputs change within a tick: they are evaluated again inside an RK4 step."""
    found: set[int] = set()
    for i in order:
        timing = flat[i].block.timing
        reached = any(source.block in found for source in feeds(flat[i]).values())
        if timing == "continuous" or (timing == "inherited" and reached):
            found.add(i)
    return found
