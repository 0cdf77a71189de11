"""Tile coding: the cells of several overlapping grids as features (CMAC; Albus, 1975)."""

import functools
import itertools
import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from motorgrad._errors import check
from motorgrad.schema import Part, count, static

MAX_TILES = 100_000  # of all tilings together: features are dense, and so are the weights on them
PRIME = 65_521  # the greatest prime below 2 ** 16: products of numbers below it and of places fit into 32 bits


class TileCoding(Part):
    r"""The cells of several offset grids, of which one in each grid is active (CMAC; Albus, 1975).

    Each of $T$ tilings divides the range of every input that it sees into `cells` intervals, and is shifted against the
    others by fractions of a cell: tiling $k$ by $((2 j + 1)\,k \bmod T)/T$ along its $j$-th input, from $j = 0$ (Sutton
    & Barto, 2018, section 9.5.4). $T$ should be a power of two, or some shifts coincide. The feature of a cell is 1
    while the input is in it, and 0 otherwise. So two inputs share the fewer features the farther they are apart, and
    none if they are a cell apart in any input. Inputs beyond the range are in the outermost cells.

    The number of cells grows exponentially with that of the inputs. Two tricks are against this (section 6.4.2 of the
    thesis):

    - Tilings may ignore inputs: with `sees` below their number, the tilings take all choices of so many inputs in turn.
    - Cells may be hashed: with `slots`, all cells of all tilings share so many features, by a random function of a
      universal family (Carter & Wegman, 1979), drawn from `seed`. Cells that meet in one feature are confused, and its
      value is the number of active cells in it.

    **Raises:** `ValueError` for a value out of range; from `size` for more than 100,000 features, or more inputs in
    `sees` than there are.

    ```python
    features = mg.policies.FeatureMap(tiles=mg.policies.TileCoding(tilings=8, cells=4, low=0.0, high=1.0))
    policy = mg.policies.hyperplanes(task, features=features)
    ```
    """

    tilings: int = count(8, 1, 1_000, help="$T$, the number of grids")
    cells: int = count(4, 1, 1_000, help="the number of intervals along each input; a shifted grid has one more")
    low: float = static(-1.0, help="the lower end of the range of every input")
    high: float = static(1.0, help="its upper end")
    sees: int | None = count(None, 1, help="the number of inputs that each tiling sees, by default all")
    slots: int | None = count(
        None, 2, PRIME, help="the number of features that all cells share by hashing, by default one for each cell"
    )
    seed: int = count(0, 0, help="seed of the random numbers of hashing. All seeds of a run have the same features")

    def validate(self) -> None:
        check(self.low < self.high, "low, high", (self.low, self.high), "an interval, low < high")

    def size(self, inputs: int) -> int:
        """The number of features for this number of inputs."""
        seen = self._seen(inputs)
        if self.slots is not None:
            return self.slots
        made = self.tilings * (self.cells + 1) ** seen
        few = f"such that there are at most {MAX_TILES:,} features of {inputs} inputs, not {made:.3g}; or set slots"
        check(made <= MAX_TILES, "cells", self.cells, few)
        return made

    def active(self, observation: Float[Array, " inputs"]) -> Int[Array, " tilings"]:
        """The index of the active feature of each tiling."""
        inputs = observation.shape[0]
        which, offsets = _tilings(self.tilings, inputs, self._seen(inputs))
        scaled = self.cells * (observation - self.low) / (self.high - self.low)
        place = jnp.floor(scaled[which] + jnp.asarray(offsets, observation.dtype))
        place = jnp.clip(place, 0, self.cells).astype(jnp.int32)
        if self.slots is not None:
            factors, shifts = _hashing(self.tilings, place.shape[1], self.seed)
            return (jnp.sum(factors * place % PRIME, axis=1) + shifts) % PRIME % self.slots
        strides = (self.cells + 1) ** np.arange(place.shape[1] - 1, -1, -1)
        each = self.size(inputs) // self.tilings
        return jnp.sum(place * strides.astype(np.int32), axis=1) + each * np.arange(self.tilings, dtype=np.int32)

    def expanded(self, observation: Float[Array, " inputs"]) -> Float[Array, " features"]:
        """All features."""
        active = self.active(observation)
        size = self.size(observation.shape[0])
        if self.slots is not None:
            fires = active[:, None] == np.arange(size, dtype=np.int32)
            return jnp.sum(fires.astype(observation.dtype), axis=0)
        blocks: Bool[Array, "tilings cells"] = active[:, None] == np.arange(size, dtype=np.int32).reshape(
            self.tilings, -1
        )
        return jnp.reshape(blocks, size).astype(observation.dtype)

    def _seen(self, inputs: int) -> int:
        seen = inputs if self.sees is None else self.sees
        check(seen <= inputs, "sees", seen, f"at most the {inputs} inputs")
        return seen


@functools.lru_cache(maxsize=64)
def _tilings(tilings: int, inputs: int, seen: int) -> tuple[np.ndarray, np.ndarray]:
    """Which inputs each tiling sees, and by which fraction of a cell it is shifted along each, both `(tilings, seen)`.

    Tilings of the same inputs are shifted against each other, so they count from 0 among themselves.
    """
    ways = math.comb(inputs, seen)
    some = list(itertools.islice(itertools.combinations(range(inputs), seen), tilings))
    which = np.array([some[tiling % ways] for tiling in range(tilings)])
    of_same = [len(range(tiling % ways, tilings, ways)) for tiling in range(tilings)]
    among = np.arange(tilings) // ways
    shifts = (2 * np.arange(seen) + 1) * among[:, None] % np.array(of_same)[:, None]
    return which, shifts / np.array(of_same)[:, None]


@functools.lru_cache(maxsize=64)
def _hashing(tilings: int, seen: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A factor for each place of each tiling, and a shift for each tiling, from 0 to `PRIME` - 1."""
    drawn = np.random.RandomState(seed)
    factors = drawn.randint(1, PRIME, size=(tilings, seen)).astype(np.int32)
    return factors, drawn.randint(0, PRIME, size=tilings).astype(np.int32)
