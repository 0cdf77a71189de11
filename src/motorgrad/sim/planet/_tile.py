"""One tile as a mesh: a height field of 16 × 16 cells with skirts, and how far meshes of a level are off."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int, UInt8

from motorgrad.sim.planet._noise import hills
from motorgrad.sim.planet._surface import Surface
from motorgrad.sim.planet._tree import CELLS, Key, directions, places

TRIANGLES = 2 * CELLS * CELLS + 8 * CELLS
"""Of a tile with its skirts."""

_SAMPLES = 1000  # cells that are measured for the error of a level
_LOW, _MIDDLE, _HIGH = np.array([(104, 122, 92), (171, 160, 132), (226, 224, 218)], float)
_TINT = 0.16  # of the brightness, by which one place differs from another, so that motion is seen


class Tile(NamedTuple):
    """A mesh.

    - `centre` (3,): in the planet's coordinates, m; `vertices` (n, 3) are relative to it.
    - `faces` (m, 3): of vertices, outwards.
    - `colours` (n, 3).
    """

    centre: Float[np.ndarray, " 3"]
    vertices: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]
    colours: UInt8[np.ndarray, "n 3"]


def make_tile(surface: Surface, key: Key, skirt: float) -> Tile:
    """The mesh of a tile: its grid, row by row, then skirts `skirt` metres down along its four sides.

    Skirts have vertices of their own, so that they do not bend the light at the sides.
    """
    share = np.arange(CELLS + 1) / CELLS
    across, up = (each.ravel() for each in np.meshgrid(share, share))
    tile = np.array([[key.face, key.column, key.row]])
    ways = places(key.level, tile, across, up)[0]
    ground, heights = surface.points_and_heights(ways)
    centre = surface.ellipsoid.points(places(key.level, tile, np.array([0.5]), np.array([0.5]))[0, 0])
    rim = _rim()
    top = ground[rim]
    bottom = top - skirt * surface.ellipsoid.normals(ways[rim])
    colours = _colours(surface, ground, heights)
    vertices = np.concatenate([ground, top, bottom]) - centre
    return Tile(centre, vertices.astype(np.float32), FACES, np.concatenate([colours, colours[rim], colours[rim]]))


def errors(surface: Surface, deepest: int) -> Float[np.ndarray, " levels"]:
    """For each level, how far from the true ground its triangles get, in m.

    Measured where a triangle is farthest from its corners, in the middles of cells and of their sides, of cells strewn
    over the planet; the greatest of them. No level is better than a deeper one.
    """
    noise = np.random.default_rng(0)
    faces, found = noise.integers(0, 6, _SAMPLES), []
    for level in range(deepest + 1):
        size = 2.0 / 2**level / CELLS
        x, y = -1.0 + (2.0 - size) * noise.random((2, _SAMPLES))
        worst = 0.0
        for ends in (((0, 0), (1, 1)), ((0, 0), (1, 0)), ((0, 0), (0, 1))):
            one, other = (surface.points(directions(faces, x + size * i, y + size * j)) for i, j in ends)
            i, j = np.mean(ends, axis=0)
            middle = directions(faces, x + size * i, y + size * j)
            gap = np.sum((surface.points(middle) - (one + other) / 2.0) * surface.ellipsoid.normals(middle), axis=-1)
            worst = max(worst, float(np.abs(gap).max()))
        found.append(worst)
    return np.maximum.accumulate(found[::-1])[::-1]


def _rim() -> Int[np.ndarray, " rim"]:
    """The grid's vertices around its rim, anticlockwise as seen from outside, without repeating the first."""
    grid = np.arange((CELLS + 1) ** 2).reshape(CELLS + 1, CELLS + 1)
    return np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])


def _faces() -> Int[np.ndarray, "m 3"]:
    grid = np.arange((CELLS + 1) ** 2).reshape(CELLS + 1, CELLS + 1)
    a, b, c, d = grid[:-1, :-1].ravel(), grid[:-1, 1:].ravel(), grid[1:, 1:].ravel(), grid[1:, :-1].ravel()
    top = (CELLS + 1) ** 2 + np.arange(4 * CELLS)
    beside, bottom = np.roll(top, -1), top + 4 * CELLS
    under = np.roll(bottom, -1)
    sides = [(a, b, c), (a, c, d), (top, bottom, under), (top, under, beside)]
    return np.concatenate([np.stack(side, axis=1) for side in sides]).astype(np.uint32)


FACES = _faces()


def _colours(surface: Surface, points: np.ndarray, heights: np.ndarray) -> UInt8[np.ndarray, "n 3"]:
    """From green in the valleys to white on the tops, in patches that are a little lighter or darker."""
    low, high = surface.elevation.least, surface.elevation.greatest
    share = ((heights - low) / (high - low) if high > low else np.full_like(heights, 0.5))[:, None]
    ramp = np.where(share < 0.5, _LOW + 2 * share * (_MIDDLE - _LOW), _MIDDLE + (2 * share - 1) * (_HIGH - _MIDDLE))
    patches = hills(points, surface.ellipsoid.least / 8.0, 7) + hills(points, 0.3, 8)
    return np.clip(ramp * (1.0 + _TINT * (patches[:, None] - 1.0)), 0, 255).astype(np.uint8)
