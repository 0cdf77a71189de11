"""Stacking: blocks of one kind as rows of the same arrays, and batches of them that one call evaluates."""

import dataclasses
from collections.abc import Sequence
from typing import Any

from motorgrad.lab._block import Block
from motorgrad.lab._flat import Source
from motorgrad.lab._host import HostBlock
from motorgrad.lab._order import feeds
from motorgrad.lab._plan import Plan
from motorgrad.lab._verify import kind_of


@dataclasses.dataclass(frozen=True, eq=False)
class Kind:
    """Blocks that share one stack of states and parameters, a row each; `block` stands for all of them."""

    block: Block
    members: tuple[int, ...]
    moving: bool
    held: bool
    """Whether some are not evaluated at every tick, so that their outputs are kept."""


@dataclasses.dataclass(frozen=True)
class Batch:
    """Rows of a kind that are evaluated together."""

    kind: int
    start: int
    stop: int


@dataclasses.dataclass(frozen=True, eq=False)
class Stacks:
    """All kinds of a plan; their batches in order; and for every block its kind and row, its batch and row in that."""

    plan: Plan
    kinds: tuple[Kind, ...]
    batches: tuple[Batch, ...]
    rows: tuple[tuple[int, int], ...]
    places: tuple[tuple[int, int], ...]

    def place(self, source: Source) -> tuple[int, int]:
        """In which batch, and in which row of it, an output is."""
        return self.places[source.block]


def stack(plan: Plan, stacked: bool = True) -> Stacks:
    """The kinds and batches of a plan; without stacking, every block is a kind by itself."""
    signatures = [_signature(plan, i, stacked) for i in range(len(plan.blocks))]
    members: dict[Any, list[int]] = {}
    emitted: list[tuple[Any, list[int]]] = []
    places: dict[int, tuple[int, int]] = {}
    for group in _schedule(plan, signatures):
        group = sorted(group, key=lambda i: _first_source(plan, places, i))
        places |= {i: (len(emitted), row) for row, i in enumerate(group)}
        emitted.append((signatures[group[0]], group))
        members.setdefault(signatures[group[0]], []).extend(group)
    numbers = {signature: number for number, signature in enumerate(members)}
    kinds = tuple(_kind(plan, group) for group in members.values())
    rows = {i: (numbers[signature], row) for signature, group in members.items() for row, i in enumerate(group)}
    batches = tuple(
        Batch(numbers[signature], rows[group[0]][1], rows[group[0]][1] + len(group)) for signature, group in emitted
    )
    every = range(len(plan.blocks))
    return Stacks(plan, kinds, batches, tuple(rows[i] for i in every), tuple(places[i] for i in every))


def _signature(plan: Plan, i: int, stacked: bool) -> Any:
    placed = plan.blocks[i]
    if isinstance(placed.block, HostBlock) or not stacked:
        return i
    return kind_of(placed.block), i in plan.moving, placed.ticks > 1


def _kind(plan: Plan, group: Sequence[int]) -> Kind:
    first = group[0]
    return Kind(plan.blocks[first].block, tuple(group), first in plan.moving, plan.blocks[first].ticks > 1)


def _first_source(plan: Plan, places: dict[int, tuple[int, int]], i: int) -> tuple[int, int]:
    """Rows in the order of what they read make wires that run side by side."""
    found = [places[source.block] for source in plan.blocks[i].sources.values() if source.block in places]
    return found[0] if found else (len(places), i)


def _schedule(plan: Plan, signatures: Sequence[Any]) -> list[list[int]]:
    """Groups of blocks of one signature, each after those that it reads from.

    Of the groups that could come next the one that leaves nothing of its signature behind is taken, else the largest;
    hosts wait until nothing else can be done, unless they read nothing at once.
    """
    waiting = {i: {source.block for source in feeds(plan.blocks[i]).values()} for i in plan.order}
    readers: dict[int, list[int]] = {i: [] for i in waiting}
    left: dict[Any, int] = {}
    ready: dict[Any, list[int]] = {}
    for i, sources in waiting.items():
        left[signatures[i]] = left.get(signatures[i], 0) + 1
        for source in sources:
            readers[source].append(i)
        if not sources:
            ready.setdefault(signatures[i], []).append(i)
    groups = []
    while ready:

        def worth(signature: Any) -> tuple[int, bool, int]:
            first = plan.blocks[ready[signature][0]]
            kind = 1 if not isinstance(first.block, HostBlock) else 0 if feeds(first) else 2
            return kind, len(ready[signature]) == left[signature], len(ready[signature])

        best = max(ready, key=worth)
        group = ready.pop(best)
        left[best] -= len(group)
        groups.append(group)
        for i in group:
            for reader in readers[i]:
                waiting[reader].discard(i)
                if not waiting[reader]:
                    ready.setdefault(signatures[reader], []).append(reader)
    return groups
