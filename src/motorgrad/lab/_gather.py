"""Wires between stacks: which rows of which batches make up the inputs of another."""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from motorgrad.lab._port import Port
from motorgrad.lab._stack import Stacks

Environment = list[dict[str, Array]]
"""The outputs of every batch, by port; rows lead."""
PIECES = 8  # beyond so many runs of rows, looking them up one by one is quicker than putting them together


class Gather:
    """The values at one input port of some blocks, rows in their order."""

    def __init__(self, stacks: Stacks, members: Sequence[int], name: str, port: Port):
        self.port, self.rows = port, len(members)
        self._keys: list[tuple[int, str] | None] = []
        """Outputs of batches; `None` for the port's default."""
        self._wanted: list[tuple[int, int]] = []
        for number, i in enumerate(members):
            source = stacks.plan.blocks[i].sources.get(name)
            batch, row = (0, number) if source is None else stacks.place(source)
            key = None if source is None else (batch, source.port)
            if key not in self._keys:
                self._keys.append(key)
            self._wanted.append((self._keys.index(key), row))
        self._runs = _runs(self._wanted)

    def __call__(self, environment: Environment) -> Array:
        """The values, `(rows, *shape)`, in the port's type."""
        parts = [self._part(key, environment) for key in self._keys]
        if len(self._runs) <= PIECES:
            pieces = [parts[part][start:stop] for part, start, stop in self._runs]
            return pieces[0] if len(pieces) == 1 else jnp.concatenate(pieces)
        starts = np.cumsum([0, *(part.shape[0] for part in parts)])
        index = np.array([starts[part] + row for part, row in self._wanted])
        whole = parts[0] if len(parts) == 1 else jnp.concatenate(parts)
        return whole[index]

    def _part(self, key: Any, environment: Environment) -> Array:
        if key is None:
            return jnp.full((self.rows, *self.port.shape), self.port.default or 0.0, self.port.dtype)
        batch, port = key
        return environment[batch][port].astype(self.port.dtype)


def _runs(wanted: Sequence[tuple[int, int]]) -> list[tuple[int, int, int]]:
    """Rows one after the other, as (part, first, one beyond the last)."""
    runs: list[tuple[int, int, int]] = []
    for part, row in wanted:
        if runs and runs[-1][0] == part and runs[-1][2] == row:
            runs[-1] = (part, runs[-1][1], row + 1)
        else:
            runs.append((part, row, row + 1))
    return runs
