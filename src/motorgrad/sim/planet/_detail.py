"""Which tiles to draw: as fine as the cameras want them and the budget of triangles allows."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from motorgrad.sim.planet._culling import Camera, above_horizon, in_frustum, spheres
from motorgrad.sim.planet._surface import Surface
from motorgrad.sim.planet._tree import ROOTS, Key, Tiles, quarters

_NEAR = 1e-3  # m; no nearer is a tile taken to be


class _Level(NamedTuple):
    """The visible tiles of a level: the number of the parent of each among all, how urgent it is to divide it."""

    tiles: Tiles
    parent: Int[np.ndarray, " tiles"]
    urgency: Float[np.ndarray, " tiles"]
    wanting: Bool[np.ndarray, " tiles"]


def select(
    surface: Surface,
    errors: Float[np.ndarray, " levels"],
    cameras: Sequence[Camera],
    tolerance: float,
    most: int,
) -> list[Key]:
    """The tiles that the cameras need, the most urgent first; no two overlap.

    A tile is divided into four while what its mesh is off by is more than `tolerance` pixels in some picture. Of all
    tiles that want to be divided, those that are farthest off come first, until the tiles are `most`.

    **Arguments:** `errors` (levels,) in m, of each level's meshes; `tolerance` in pixels; `most` tiles, at least 6.

    **Returns:** tiles that some camera may see, wholly covering what it sees.
    """
    levels: list[_Level] = []
    tiles, parent, urgency, count = ROOTS, np.full(6, -1), np.full(6, np.inf), 0
    for level, error in enumerate(errors):
        seen, pixels = _look(surface, float(errors[0]), cameras, level, tiles, float(error))
        # none is divided before the tile that it is a quarter of
        tiles, parent, urgency = tiles[seen], parent[seen], np.minimum(urgency, pixels)[seen]
        wanting = (urgency > tolerance) & (level < len(errors) - 1)
        if np.count_nonzero(wanting) > most:  # the others would not be divided in the end either
            wanting &= urgency >= np.partition(urgency, -most)[-most]
        levels.append(_Level(tiles, parent, urgency, wanting))
        parent = np.repeat(count + np.flatnonzero(wanting), 4)
        count += len(tiles)
        tiles, urgency = quarters(tiles[wanting]), np.repeat(urgency[wanting], 4)
        if not len(tiles):
            break
    return _cut(levels, most)


def _look(
    surface: Surface, slack: float, cameras: Sequence[Camera], level: int, tiles: Tiles, error: float
) -> tuple[Bool[np.ndarray, " tiles"], Float[np.ndarray, " tiles"]]:
    """For each tile whether some camera may see it, and by how many pixels its mesh is off there at most."""
    seen, pixels = np.zeros(len(tiles), bool), np.zeros(len(tiles))
    balls = spheres(surface, level, tiles)
    for camera in cameras:
        here = in_frustum(camera, balls) & above_horizon(camera, surface, level, tiles, slack)
        away = np.maximum(np.linalg.norm(balls[0] - camera.position, axis=1) - balls[1], _NEAR)
        scale = camera.pixels / (2.0 * np.tan(camera.fov / 2.0))
        pixels = np.where(here, np.maximum(pixels, error * scale / away), pixels)
        seen |= here
    return seen, pixels


def _cut(levels: list[_Level], most: int) -> list[Key]:
    """Divide tiles in the order of their urgency while there are at most `most` of them."""
    depth = np.repeat(np.arange(len(levels)), [len(level.tiles) for level in levels])
    tiles, parent, urgency, wanting = (np.concatenate(each) for each in zip(*levels, strict=True))
    parts = np.bincount(parent[parent >= 0], minlength=len(tiles))
    order = np.flatnonzero(wanting)
    order = order[np.argsort(-urgency[order], kind="stable")]  # parents stay before their quarters
    count = np.count_nonzero(parent < 0) + np.cumsum(parts[order] - 1)
    allowed = np.searchsorted(np.maximum.accumulate(count), most, side="right")
    divided = np.zeros(len(tiles), bool)
    divided[order[:allowed]] = True
    leaves = np.flatnonzero(~divided & ((parent < 0) | divided[parent]))
    leaves = leaves[np.argsort(-urgency[leaves], kind="stable")]
    return [Key(int(depth[n]), *map(int, tiles[n])) for n in leaves]
