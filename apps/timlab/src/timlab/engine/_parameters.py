"""The parameters of a run: by address for people, by kind and row for the compiled loop."""

import copy
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from jax.typing import ArrayLike

from motorgrad._errors import check, unknown
from timlab.compiler import Stacks
from timlab.diagram import Block, HostBlock


class Parameters:
    """The current values of all parameters.

    **Arguments:** the stacks; values that differ between seeds, `(seeds, …)`, by address `"block.parameter"`; the
    number of seeds.
    """

    def __init__(self, stacks: Stacks, swept: Mapping[str, Any], seeds: int):
        self._stacks, self._seeds = stacks, seeds
        self._blocks = [placed.block for placed in stacks.plan.blocks]
        self._paths = {placed.path: i for i, placed in enumerate(stacks.plan.blocks)}
        self.values = {k: self._stacked(kind.members) for k, kind in enumerate(stacks.kinds)}
        """By kind: the arrays by name. Rows lead; seeds come last in arrays that differ between seeds."""
        self._swept: set[tuple[int, str]] = set()
        for address, rows in swept.items():
            for each in self._addresses(address):
                self._sweep(each, rows)

    @property
    def axes(self) -> dict[int, dict[str, int | None]]:
        """The seed axes of the arrays."""
        return {
            k: {name: -1 if (k, name) in self._swept else None for name in arrays} for k, arrays in self.values.items()
        }

    def __getitem__(self, address: str) -> Any:
        """The current value of a parameter: plain numbers, or `(seeds, …)` where it differs between seeds."""
        i, name = self._find(self._addresses(address)[0])
        k, row = self._stacks.rows[i]
        if (k, name) in self._swept:
            return np.moveaxis(self.values[k][name][row], -1, 0).copy()
        return getattr(self._blocks[i], name)

    def __setitem__(self, address: str, value: object) -> None:
        for each in self._addresses(address):
            self._set(each, value)

    def _addresses(self, address: str) -> tuple[str, ...]:
        """The addresses of blocks' parameters that an address stands for."""
        return self._stacks.plan.shared.get(address, (address,))

    def _set(self, address: str, value: object) -> None:
        i, name = self._find(address)
        k, row = self._stacks.rows[i]
        changed = self._with_value(i, name, value, address)
        array = changed.values()[name]
        self._blocks[i] = changed
        every = self.values[k][name].copy()  # a compiled call may still read the old array
        every[row] = array[..., None] if (k, name) in self._swept else array
        self.values[k] = self.values[k] | {name: every}

    def arrays(self, i: int) -> dict[str, np.ndarray]:
        """A block's parameters as arrays; seeds come last in those that differ between seeds."""
        k, row = self._stacks.rows[i]
        return {name: every[row] for name, every in self.values[k].items()}

    def copy(self) -> Self:
        """A copy that can be changed independently."""
        other = copy.copy(self)
        other._blocks = list(self._blocks)
        other.values = dict(self.values)
        return other

    def by_block(self) -> dict[str, dict[str, np.ndarray]]:
        """Every parameter by the identity of its block; seeds lead where it differs between seeds."""
        found = {}
        for i, placed in enumerate(self._stacks.plan.blocks):
            k, row = self._stacks.rows[i]
            arrays = {name: (every[row], (k, name) in self._swept) for name, every in self.values[k].items()}
            found[placed.identity] = {
                n: np.moveaxis(a, -1, 0).copy() if s else a.copy() for n, (a, s) in arrays.items()
            }
        return {identity: arrays for identity, arrays in found.items() if arrays}

    def restore(self, by_block: Mapping[str, Mapping[str, np.ndarray]]) -> None:
        """Set the parameters of the given blocks, the inverse of `by_block`."""
        values = {k: {name: every.copy() for name, every in arrays.items()} for k, arrays in self.values.items()}
        for i, placed in enumerate(self._stacks.plan.blocks):
            k, row = self._stacks.rows[i]
            plain: dict[str, Any] = {}
            for name, given in by_block.get(placed.identity, {}).items():
                swept = (k, name) in self._swept
                values[k][name][row] = np.moveaxis(given, 0, -1) if swept else given
                if not swept and name in self._blocks[i].parameters:  # a data file also has its table there
                    plain[name] = given.tolist()
            if plain:
                self._blocks[i] = self._blocks[i].retuned(plain)
        self.values = values

    def _stacked(self, members: tuple[int, ...]) -> dict[str, np.ndarray]:
        rows = [self._blocks[i].values() for i in members]
        return {name: np.stack([row[name] for row in rows]) for name in rows[0]}

    def _find(self, address: str) -> tuple[int, str]:
        path, dot, name = str(address).partition(".")  # names of parameters may have dots, those of blocks have none
        if not dot or path not in self._paths:
            raise unknown("block", path, self._paths)
        i = self._paths[path]
        known = self._blocks[i].parameters
        if name not in known:
            raise unknown(f"parameter of {path}:", name, known)
        return i, name

    def _with_value(self, i: int, name: str, value: object, address: str) -> Block:
        """The block with another value of a parameter, checked as when a block is made."""
        block = self._blocks[i]
        try:
            changed = block.retuned({name: value})
        except ValueError as error:
            raise ValueError(f"{address.partition('.')[0]}.{error}") from None
        check(name in changed.parameters, address, value, "a number, as it was when the diagram was compiled")
        old = block.values()[name].shape
        new = changed.values()[name].shape
        check(old == new, f"{address}: shape", new, f"{old}, as it was when the diagram was compiled")
        return changed

    def _sweep(self, address: str, rows: ArrayLike) -> None:
        i, name = self._find(address)
        shape = np.shape(rows)
        check(
            not isinstance(self._blocks[i], HostBlock),
            address,
            rows,
            "the same for all seeds: the block runs on the host",
        )
        check(shape[:1] == (self._seeds,), f"{address}: shape", shape, f"({self._seeds}, …), seeds first")
        k, row = self._stacks.rows[i]
        arrays = [self._with_value(i, name, value, address).values()[name] for value in np.asarray(rows)]
        if (k, name) not in self._swept:
            self._swept.add((k, name))
            every = self.values[k][name][..., None]
            self.values[k][name] = np.repeat(every, self._seeds, axis=-1)
        self.values[k][name][row] = np.stack(arrays, axis=-1)
