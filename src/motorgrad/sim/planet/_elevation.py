"""How high the ground is above the ellipsoid: made from a few numbers and a seed, or given as a map."""

import dataclasses
import functools
from typing import Literal, Protocol

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.sim.planet._noise import hills, plates, smooth

Kind = Literal["bumps", "steps", "waves", "fractal"]
Points = Float[np.ndarray, "*any 3"]
Heights = Float[np.ndarray, "*any"]
_WAVES = 8
_RISER = 0.1  # of the spacing, the width of what leads from one plateau to the next
_BLEND = 1.0  # m, over which the ground rises around the clearing


class Elevation(Protocol):
    """Heights above the ellipsoid."""

    @property
    def least(self) -> float:
        """The least height that is possible, in m."""
        ...

    @property
    def greatest(self) -> float:
        """The greatest height that is possible, in m."""
        ...

    def __call__(self, points: Points, normals: Points) -> Heights:
        """Heights (…) over points (…, 3) on the ellipsoid, in m, with unit normals (…, 3)."""
        ...


@dataclasses.dataclass(frozen=True)
class SeededElevation:
    """Elevation as a function of the place in space, so that it has no seams and no poles.

    It is 0 at the place `start` (3,), so that a body stands there as on level ground.

    **Arguments:** `kind`, `height`, `spacing`, `seed`: as in `Planet`; `finest` (m): the wavelength below which
    "fractal" has none; `clearing` (m): radius of a level disc about the start.
    """

    kind: Kind
    height: float
    spacing: float
    finest: float
    seed: int
    clearing: float
    start: tuple[float, ...]

    @property
    def least(self) -> float:
        return -self.height * self._there

    @property
    def greatest(self) -> float:
        return self.height * (1.0 - self._there)

    def __call__(self, points: Points, normals: Points) -> Heights:
        heights = self.height * (self._raw(points) - self._there)
        if self.clearing > 0.0:
            heights = heights * smooth((np.linalg.norm(points - self.start, axis=-1) - self.clearing) / _BLEND)
        return heights

    @functools.cached_property
    def _there(self) -> float:
        return float(self._raw(np.array(self.start)[None])[0])

    def _raw(self, points: Points) -> Heights:
        kinds = {"bumps": self._bumps, "steps": self._steps, "waves": self._waves, "fractal": self._fractal}
        return kinds[self.kind](points)

    def _bumps(self, points: Points) -> Heights:
        return hills(points, self.spacing / 2.0, self.seed)

    def _steps(self, points: Points) -> Heights:
        return plates(points, self.spacing / 2.0, _RISER * self.spacing, self.seed)

    def _waves(self, points: Points) -> Heights:
        noise = np.random.default_rng(self.seed)
        ways = noise.normal(size=(_WAVES, 3))
        ways *= 2.0 * np.pi / self.spacing / np.linalg.norm(ways, axis=1, keepdims=True)
        return 0.5 + 0.5 * np.sin(points @ ways.T + 2.0 * np.pi * noise.random(_WAVES)).mean(-1)

    def _fractal(self, points: Points) -> Heights:
        """Bumps on bumps, each half as wide and half as high as those below it."""
        octaves = max(1, 1 + int(np.log2(self.spacing / self.finest)))
        shares = 0.5 ** np.arange(octaves)
        layers = [hills(points, self.spacing / 2.0 ** (n + 1), self.seed + n) for n in range(octaves)]
        return sum(share * layer for share, layer in zip(shares, layers, strict=True)) / shares.sum()


@dataclasses.dataclass(frozen=True, eq=False)
class MapElevation:
    """Elevation from a map of latitudes and longitudes, straight between its points.

    **Arguments:** `heights` (rows, columns) in m: the first row at the north pole and the last at the south pole, the
    columns evenly from −180° on, without 180° itself. The rows at the poles are taken as their mean.

    **Raises:** `ValueError` for another shape, or numbers that are not finite.
    """

    heights: Float[np.ndarray, "rows columns"]

    def __post_init__(self) -> None:
        heights = np.array(self.heights)
        right = heights.ndim == 2 and min(heights.shape) >= 3
        check(right, "map", f"an array of shape {heights.shape}", "(rows, columns) of at least 3 each")
        real = np.issubdtype(heights.dtype, np.number) and not np.iscomplexobj(heights)
        check(real and np.isfinite(heights).all(), "map", heights.dtype.name, "an array of finite numbers, in m")
        heights = heights.astype(float)
        heights[[0, -1]] = heights[[0, -1]].mean(axis=1, keepdims=True)
        object.__setattr__(self, "heights", heights)

    @property
    def least(self) -> float:
        return float(self.heights.min())

    @property
    def greatest(self) -> float:
        return float(self.heights.max())

    def __call__(self, points: Points, normals: Points) -> Heights:
        rows, columns = self.heights.shape
        row = np.arccos(np.clip(normals[..., 2], -1.0, 1.0)) / np.pi * (rows - 1)
        column = (np.arctan2(normals[..., 1], normals[..., 0]) / (2.0 * np.pi) + 0.5) * columns
        top, left = np.minimum(row.astype(int), rows - 2), np.floor(column).astype(int)
        down, right = row - top, column - left
        first, second = left % columns, (left + 1) % columns
        above = (1.0 - right) * self.heights[top, first] + right * self.heights[top, second]
        below = (1.0 - right) * self.heights[top + 1, first] + right * self.heights[top + 1, second]
        return (1.0 - down) * above + down * below
