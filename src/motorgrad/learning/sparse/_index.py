"""A table of which local units can fire where, so that a decision evaluates no others."""

import functools
import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from motorgrad.policies import LocalGaussians
from motorgrad.schema import Part, Range, count, static

SLACK = 1e-3  # of a cell: how much wider a cell is taken than it is, for the rounding of single precision
UNITS_A_CELL = 4  # of all units, when the number of cells is chosen


class SpatialIndex(Part):
    r"""A grid of cells over the space of observations, and for each cell the units that can fire in it.

    A unit fires with a probability above $\varepsilon$ only within $r = \sqrt{2\ln(p_\max/\varepsilon)}$ of its widths.
    It is listed in every cell that comes nearer to its centre than $r + m$ widths. So where it is not listed it fires
    with at most $\varepsilon$ for as long as its `strain` is at most 1: until it has moved, or grown, by the margin
    $m$. The grid spans the units' centres; cells at its border reach to infinity, so every observation is in one.

    All numbers fix tables that are made outside compiled code, so they are static.
    """

    neglect: float = static(
        1e-3,
        allowed=Range(0, 1, open_low=True, open_high=True),
        help=r"$\varepsilon$, the greatest probability with which a unit may fire where it is not listed",
    )
    margin: float = static(
        1.0,
        allowed=Range(0, open_low=True),
        unit="widths",
        help="$m$, how far units move before a table is made anew. A wide margin lists more units, a narrow one makes "
        "more tables",
    )
    cells: int | None = count(
        None,
        1,
        4096,
        help="number of cells of the grid in every input; by default there are about four units to a cell",
    )
    rebase: int = count(
        64,
        1,
        1024,
        unit="decisions",
        help="greatest time between updates of all units; shorter if the trace decays so fast that rounding would "
        "matter",
    )

    def sides(self, units: int, inputs: int) -> int:
        """How many cells the grid has in every input."""
        return self.cells or max(1, round((units / UNITS_A_CELL) ** (1 / inputs)))

    def reach(self, pool: LocalGaussians) -> Float[Array, "*units"]:
        """How many widths from its centre a unit fires with more than `neglect`: 0 where it never does."""
        return jnp.sqrt(2 * jnp.maximum(pool.log_height() - math.log(self.neglect), 0))

    def strain(self, before: LocalGaussians, after: LocalGaussians) -> Float[Array, " units"]:
        r"""How much of the margin each unit has used up, $(|\Delta\mu/\sigma| + r(e^g - 1))/m$, with $g \ge 0$ by how
        much the log-width has grown in the input where it has grown the most."""
        aside = _length((after.centre - before.centre) * jnp.exp(-before.log_width))
        growth = _greatest(jnp.maximum(after.log_width - before.log_width, 0))
        return (aside + self.reach(after) * jnp.expm1(growth)) / self.margin

    def pace(self, pool: LocalGaussians, step: LocalGaussians) -> Float[Array, " units"]:
        """The most that a small `step` of the parameters adds to the strain, whatever the strain is by now."""
        reach = self.reach(pool)
        wider = 1 + self.margin / jnp.maximum(reach, 1e-3)  # than in the reference, at most
        aside = wider * _length(step.centre * jnp.exp(-pool.log_width))
        return (aside + (reach + self.margin) * _greatest(jnp.abs(step.log_width))) / self.margin

    def grid(self, pool: LocalGaussians) -> tuple[Float[np.ndarray, " inputs"], Float[np.ndarray, " inputs"]]:
        """The lower corner and the size of a cell, of a grid over nearly all centres."""
        centre = np.asarray(pool.centre)
        finite = centre[np.isfinite(centre).all(axis=1)]
        low, high = np.quantile(finite if len(finite) else np.zeros_like(centre), (0.01, 0.99), axis=0)
        size = np.maximum((high - low) / self.sides(*pool.centre.shape), 1e-6)
        return low.astype(np.float32), size.astype(np.float32)

    def cell(
        self,
        observation: Float[Array, " inputs"],
        low: Float[Array, " inputs"],
        size: Float[Array, " inputs"],
        units: int,
    ) -> Int[Array, ""]:
        """The cell of an observation, among those of a `table` for this number of units."""
        sides = self.sides(units, len(low))
        place = jnp.clip(jnp.floor((observation - low) / size), 0, sides - 1).astype(jnp.int32)
        return functools.reduce(lambda cell, column: cell * sides + column, list(place))

    def table(
        self, pool: LocalGaussians, low: Float[np.ndarray, " inputs"], size: Float[np.ndarray, " inputs"]
    ) -> Int[np.ndarray, "cells most"]:
        """The units of every cell, in ascending order; after the last of a cell the number of all units."""
        centre = np.asarray(pool.centre, float)
        width = np.exp(np.asarray(pool.log_width, float))
        units, inputs = centre.shape
        sides = self.sides(units, inputs)
        reach = np.broadcast_to(np.asarray(self.reach(pool), float), units)
        # pairs of a unit and a cell, input by input, and the squared distance that is left to the unit's reach
        finite = np.isfinite(centre).all(axis=1) & np.isfinite(width).all(axis=1) & (width > 0).all(axis=1)
        unit = np.flatnonzero((reach > 0) & finite)
        cell = np.zeros(len(unit), int)
        left = (reach[unit] + self.margin) ** 2
        for axis in range(inputs):
            at = centre[unit, axis]
            wide = width[unit, axis]
            first, last = (
                np.clip((at + side * wide * np.sqrt(left) - low[axis]) / size[axis] + side * SLACK, 0, sides - 1)
                for side in (-1, 1)
            )
            first = first.astype(int)
            count = last.astype(int) - first + 1
            pair = np.repeat(np.arange(len(unit)), count)
            column = first[pair] + _places(count)
            start, end = (low[axis] + size[axis] * (column + edge) for edge in (-SLACK, 1 + SLACK))
            start[column == 0] = -np.inf
            end[column == sides - 1] = np.inf
            gap = np.maximum(np.maximum(start - at[pair], at[pair] - end), 0) / wide[pair]
            rest = left[pair] - gap**2
            kept = rest >= 0
            pair = pair[kept]
            unit = unit[pair]
            left = rest[kept]
            cell = cell[pair] * sides + column[kept]
        order = np.argsort(cell, kind="stable")  # units ascend within a cell
        unit = unit[order]
        cell = cell[order]
        count = np.bincount(cell, minlength=sides**inputs)
        found = np.full((len(count), count.max()), units, np.int32)
        found[cell, _places(count)] = unit
        return found


# Over the inputs, one by one: a reduction of a large array is taken out of the loop that XLA compiles as one function.


def _length(rows: Float[Array, "units inputs"]) -> Float[Array, " units"]:
    return jnp.sqrt(functools.reduce(jnp.add, [column**2 for column in rows.T]))


def _greatest(rows: Float[Array, "units inputs"]) -> Float[Array, " units"]:
    return functools.reduce(jnp.maximum, list(rows.T))


def _places(count: Int[np.ndarray, " groups"]) -> Int[np.ndarray, " members"]:
    """0, 1, 2 … within each of some groups that follow one another."""
    return np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
