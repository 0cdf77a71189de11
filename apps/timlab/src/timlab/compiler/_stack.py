"""Stacking: blocks of one kind become rows of the same arrays, evaluated together in batches; and the wires between the
rows.

XLA would run a loop of 500 separate blocks as fast, but compiles it fifty times as long.
"""

import dataclasses
from collections.abc import Hashable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from timlab.compiler._plan import Plan, direct_sources
from timlab.diagram import Block, HostBlock, Port, kind_of


@dataclasses.dataclass(frozen=True, eq=False)
class Kind:
    """Blocks that share one stack of states and parameters, one row each; `block` represents them all."""

    block: Block
    members: tuple[int, ...]
    moving: bool
    held: bool
    """Whether outputs are kept: some are not computed at every tick, or all are found by iteration."""


@dataclasses.dataclass(frozen=True)
class Batch:
    """Consecutive rows of a kind that are evaluated together."""

    kind: int
    start: int
    stop: int


@dataclasses.dataclass(frozen=True, eq=False)
class Stacks:
    """The kinds of a plan and their batches in order of evaluation. For every block, `rows` has its kind and row, and
    `places` its batch and the row in the batch.
    """

    plan: Plan
    kinds: tuple[Kind, ...]
    batches: tuple[Batch, ...]
    rows: tuple[tuple[int, int], ...]
    places: tuple[tuple[int, int], ...]


def stack(plan: Plan, stacked: bool = True) -> Stacks:
    """The kinds and batches of a plan. Without stacking, every block is a kind of its own."""
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
    return kind_of(placed.block), i in plan.moving, placed.ticks > 1, i in plan.torn


def _kind(plan: Plan, group: Sequence[int]) -> Kind:
    first = group[0]
    return Kind(
        plan.blocks[first].block, tuple(group), first in plan.moving, plan.blocks[first].ticks > 1 or first in plan.torn
    )


def _first_source(plan: Plan, places: dict[int, tuple[int, int]], i: int) -> tuple[int, int]:
    """A sort key that orders rows like their sources, so that parallel wires become one slice."""
    found = [places[source.block] for source in plan.blocks[i].sources.values() if source.block in places]
    return found[0] if found else (len(places), i)


def _schedule(plan: Plan, signatures: Sequence[Any]) -> list[list[int]]:
    """Groups of blocks with one signature, each after the blocks that it reads from.

    Among the groups that could come next, one that completes its signature is taken first, else the largest. Hosts wait
    until nothing else is ready, unless they read nothing within the tick.
    """
    sources_of = {i: {source.block for source in direct_sources(plan.blocks[i]).values()} for i in plan.order}
    waiting = {i: sources - plan.torn for i, sources in sources_of.items()}
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

        def worth(signature: Hashable) -> tuple[int, bool, int]:
            first = plan.blocks[ready[signature][0]]
            kind = 1 if not isinstance(first.block, HostBlock) else 0 if direct_sources(first) else 2
            return kind, len(ready[signature]) == left[signature], len(ready[signature])

        best = max(ready, key=worth)
        group = ready.pop(best)
        left[best] -= len(group)
        groups.append(group)
        for i in group:
            for reader in readers[i] if i not in plan.torn else ():
                waiting[reader].discard(i)
                if not waiting[reader]:
                    ready.setdefault(signatures[reader], []).append(reader)
    return groups


Environment = list[dict[str, Array]]
"""The outputs of every batch, by port; rows lead."""
PIECES = 8  # with more runs of rows, indexing is faster than concatenating slices


class Gather:
    """The values at one input port of some blocks, as rows in their order."""

    def __init__(self, stacks: Stacks, members: Sequence[int], name: str, port: Port):
        self.port = port
        self.rows = len(members)
        self._keys: list[tuple[int, str] | None] = []
        """Outputs of batches; `None` for the port's default."""
        self._wanted: list[tuple[int, int]] = []
        for number, i in enumerate(members):
            source = stacks.plan.blocks[i].sources.get(name)
            batch, row = (0, number) if source is None else stacks.places[source.block]
            key = None if source is None else (batch, source.port)
            if key not in self._keys:
                self._keys.append(key)
            self._wanted.append((self._keys.index(key), row))
        self._runs = _contiguous_runs(self._wanted)

    def __call__(self, environment: Environment) -> Array:
        """The values, `(rows, *shape)`, in the port's dtype."""
        parts = [self._part(key, environment) for key in self._keys]
        if len(self._runs) <= PIECES:
            pieces = [parts[part][start:stop] for part, start, stop in self._runs]
            return pieces[0] if len(pieces) == 1 else jnp.concatenate(pieces)
        starts = np.cumsum([0, *(part.shape[0] for part in parts)])
        index = np.array([starts[part] + row for part, row in self._wanted])
        whole = parts[0] if len(parts) == 1 else jnp.concatenate(parts)
        return whole[index]

    def _part(self, key: tuple[int, str] | None, environment: Environment) -> Array:
        if key is None:
            return self.port.unwired((self.rows,))
        batch, port = key
        return environment[batch][port].astype(self.port.dtype)


def _contiguous_runs(wanted: Sequence[tuple[int, int]]) -> list[tuple[int, int, int]]:
    """Consecutive rows, as (part, first, last + 1)."""
    runs: list[tuple[int, int, int]] = []
    for part, row in wanted:
        if runs and runs[-1][0] == part and runs[-1][2] == row:
            runs[-1] = (part, runs[-1][1], row + 1)
        else:
            runs.append((part, row, row + 1))
    return runs
