"""Rewards that depend on a place: sums of axis-aligned Gaussians (section 6.3 of the thesis)."""

import math
from collections.abc import Sequence

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.worlds import Walls

Region = tuple[float, float, float, float, float]
"""Amplitude; x and y of the centre; width (standard deviation) along x and along y."""

LAYOUTS: dict[str, tuple[Region, ...]] = {
    "R1": (
        (1.0, 0.25, 0.55, 0.12, 0.12),
        (-1.0, 0.2, 0.2, 0.15, 0.1),
        (1.0, 0.75, 0.25, 0.12, 0.12),
        (-1.0, 0.7, 0.6, 0.12, 0.12),
    ),
    "R2": (
        (1.0, 0.5, 0.65, 0.1, 0.1),
        (-1.0, 0.5, 0.3, 0.12, 0.12),
        (1.0, 0.15, 0.15, 0.12, 0.12),
        (1.0, 0.85, 0.15, 0.12, 0.12),
    ),
    "R3": (
        (1.0, 0.2, 0.75, 0.1, 0.1),
        (-1.0, 0.5, 0.75, 0.12, 0.1),
        (1.0, 0.8, 0.5, 0.1, 0.1),
        (-1.0, 0.4, 0.5, 0.12, 0.1),
        (1.0, 0.2, 0.2, 0.1, 0.1),
        (-1.0, 0.6, 0.2, 0.12, 0.1),
    ),
}
"""Layouts by name, for the unit square."""


def region_reward(regions: Sequence[Region], position: Float[Array, " 2"]) -> Float[Array, ""]:
    r"""$\sum_k A_k \exp\left(-\tfrac12 \lVert (x - c_k)/w_k \rVert^2\right)$ at a position."""
    numbers = jnp.asarray(regions, position.dtype).reshape(-1, 5)
    return jnp.sum(numbers[:, 0] * jnp.exp(-0.5 * squared_distance(numbers, position)))


def squared_distance(regions: Float[Array, "regions 5"], position: Float[Array, " 2"]) -> Float[Array, " regions"]:
    """From the centre of each region, in its widths, squared."""
    return jnp.sum(((position - regions[:, 1:3]) / regions[:, 3:]) ** 2, axis=-1)


def check_region(name: str, region: Region, walls: Walls) -> None:
    """Refuse a region without extent, or whose centre is outside the box."""
    _, x, y, *widths = region
    check(all(math.isfinite(number) for number in region), name, region, "finite numbers")
    box = f"within the box, x in {walls.left:g} … {walls.right:g} and y in {walls.bottom:g} … {walls.top:g}"
    check(walls.contains(x, y), f"{name} centre", (x, y), box)
    check(min(widths) > 0, f"{name} widths", tuple(widths), "positive")
