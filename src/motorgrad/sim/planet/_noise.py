"""Random numbers that belong to places in space: the same place has the same number, wherever one comes from."""

import numpy as np
from jaxtyping import Float, Int

Points = Float[np.ndarray, "*any 3"]
Values = Float[np.ndarray, "*any"]
_PRIMES = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_AROUND = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])


def chance(cells: Int[np.ndarray, "*any 3"], seed: int) -> Values:
    """A number from [0, 1) for each cell of a grid of whole numbers: their bits, mixed as in SplitMix64."""
    mixed = (cells.astype(np.uint64) * _PRIMES).sum(-1, dtype=np.uint64)
    mixed = mixed + np.uint64((seed * 0xD1B54A32D192ED03 + 0x632BE59BD9B4E019) % 2**64)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return ((mixed ^ (mixed >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53


def smooth(share: Values) -> Values:
    """From 0 to 1 with level ends that do not bend either."""
    share = np.clip(share, 0.0, 1.0)
    return share**3 * (share * (6.0 * share - 15.0) + 10.0)


def hills(points: Points, length: float, seed: int) -> Values:
    """Smooth noise from 0 to 1: random at the corners of cubes of this side, smooth between them (value noise)."""
    place = points / length
    cell = np.floor(place)
    share = smooth(place - cell)[..., None, :]
    weights = np.prod(np.where(_CORNERS == 1, share, 1.0 - share), axis=-1)
    return np.sum(weights * chance(cell.astype(np.int64)[..., None, :] + _CORNERS, seed), axis=-1)


def plates(points: Points, length: float, riser: float, seed: int) -> Values:
    """Plateaus from 0 to 1: each place has the number of the nearest of points strewn one to a cube of this side.

    Where two are about as near, a riser about as wide as `riser` leads from one to the other.
    """
    cells = np.floor(points / length).astype(np.int64)[..., None, :] + _AROUND
    strewn = np.stack([chance(cells, 4 * seed + axis) for axis in range(3)], axis=-1)
    distance = np.linalg.norm(points[..., None, :] - (cells + strewn) * length, axis=-1)
    weights = np.exp((distance.min(-1, keepdims=True) - distance) * (4.0 / riser))
    return np.sum(weights * chance(cells, 4 * seed + 3), axis=-1) / np.sum(weights, axis=-1)
