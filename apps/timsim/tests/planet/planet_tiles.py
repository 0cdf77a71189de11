"""The inverse of `timsim.planet._tiles.directions`, by which tests find what a tile is to hold."""

import numpy as np

from timsim.planet._geometry import Points
from timsim.planet._tiles import _AXES, Tiles


def tile_of(level: int, points: Points) -> Tiles:
    """The tile of a level at each direction (n, 3) of any length."""
    along = np.einsum("fad,nd->nfa", _AXES, points)
    face = np.argmax(along[..., 2], axis=1)
    found = along[np.arange(len(points)), face]
    place = np.arctan(found[:, :2] / found[:, 2:]) * 4.0 / np.pi
    cell = np.clip(((place + 1.0) / 2.0 * 2**level).astype(int), 0, 2**level - 1)
    return np.concatenate([face[:, None], cell], axis=1)
