"""Six faces of a cube around the planet, each a quad-tree of tiles: which tiles there are, and where."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from motorgrad.sim.planet._ellipsoid import unit

CELLS = 16  # along a side of a tile
Tiles = Int[np.ndarray, "tiles 3"]  # of one level: face, column, row
Points = Float[np.ndarray, "*any 3"]

# along the columns, along the rows, outwards; right-handed, so that faces wind outwards
_AXES = np.array(
    [
        [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
        [[0, -1, 0], [0, 0, 1], [-1, 0, 0]],
        [[-1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
        [[0, 1, 0], [1, 0, 0], [0, 0, -1]],
    ],
    float,
)
ROOTS: Tiles = np.array([(face, 0, 0) for face in range(6)])
_QUARTERS = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])


class Key(NamedTuple):
    """One tile: of the 2^level × 2^level of a face."""

    level: int
    face: int
    column: int
    row: int

    @property
    def parent(self) -> "Key":
        """The tile of which this is a quarter."""
        return Key(self.level - 1, self.face, self.column // 2, self.row // 2)

    @property
    def ancestors(self) -> tuple["Key", ...]:
        """All tiles that contain it, the nearest first."""
        return tuple(
            Key(k, self.face, self.column >> self.level - k, self.row >> self.level - k) for k in range(self.level)
        )[::-1]


def keys(level: int, tiles: Tiles) -> list[Key]:
    """The tiles of a level one by one."""
    return [Key(level, *map(int, tile)) for tile in tiles]


def quarters(tiles: Tiles) -> Tiles:
    """The four tiles of the next level in each of these, tile by tile."""
    corners = 2 * tiles[:, None, 1:] + _QUARTERS
    faces = np.broadcast_to(tiles[:, None, :1], (*corners.shape[:2], 1))
    return np.concatenate([faces, corners], axis=-1).reshape(-1, 3)


def directions(faces: Int[np.ndarray, "*any"], across: np.ndarray, up: np.ndarray) -> Points:
    """Unit directions of places on faces, from -1 to 1 across and up: lines of one place are great circles.

    The tangent makes cells of nearly equal size.
    """
    axes = _AXES[faces]
    flat = (
        np.tan(np.pi / 4.0 * across)[..., None] * axes[..., 0, :]
        + np.tan(np.pi / 4.0 * up)[..., None] * axes[..., 1, :]
    )
    return unit(flat + axes[..., 2, :])


def places(level: int, tiles: Tiles, across: np.ndarray, up: np.ndarray) -> Points:
    """Unit directions (tiles, places, 3) of places (places,) in tiles, from 0 to 1 across and up."""
    size = 2.0 / 2**level
    x = -1.0 + size * (tiles[:, 1, None] + across)
    y = -1.0 + size * (tiles[:, 2, None] + up)
    return directions(np.broadcast_to(tiles[:, :1], x.shape), x, y)


def caps(level: int, tiles: Tiles) -> tuple[Points, Float[np.ndarray, " tiles"]]:
    """For each tile a direction (tiles, 3) and the angle (tiles,) in rad from it within which the whole tile lies.

    Sides are great circles, so that no place of a tile is farther than its corners.
    """
    found = places(level, tiles, np.array([0.5, 0.0, 1.0, 0.0, 1.0]), np.array([0.5, 0.0, 0.0, 1.0, 1.0]))
    middle, corners = found[:, :1], found[:, 1:]
    chords = np.linalg.norm(corners - middle, axis=-1).max(axis=1)
    return middle[:, 0], 2.0 * np.arcsin(chords / 2.0)


def tile_of(level: int, points: Points) -> Tiles:
    """The tile of a level at each direction (n, 3), which need not be of length 1."""
    along = np.einsum("fad,nd->nfa", _AXES, points)
    face = np.argmax(along[..., 2], axis=1)
    found = along[np.arange(len(points)), face]
    place = np.arctan(found[:, :2] / found[:, 2:]) * 4.0 / np.pi
    cell = np.clip(((place + 1.0) / 2.0 * 2**level).astype(int), 0, 2**level - 1)
    return np.concatenate([face[:, None], cell], axis=1)
