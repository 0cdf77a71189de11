"""The ground of a planet: elevation above the ellipsoid, made from noise in space or read from a map."""

import dataclasses
import functools
from typing import Literal, Protocol

import numpy as np
from jaxtyping import Float, Int

from motorgrad._errors import check
from timsim.planet._geometry import Ellipsoid, Points

Heights = Float[np.ndarray, "*any"]
_PRIMES = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_AROUND = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])


def cell_random(cells: Int[np.ndarray, "*any 3"], seed: int) -> Heights:
    """A number from [0, 1) for each cell of an integer grid: its bits, mixed as in SplitMix64."""
    mixed = (cells.astype(np.uint64) * _PRIMES).sum(-1, dtype=np.uint64)
    mixed = mixed + np.uint64((seed * 0xD1B54A32D192ED03 + 0x632BE59BD9B4E019) % 2**64)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return ((mixed ^ (mixed >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53


def smooth(share: Heights) -> Heights:
    """A smooth step from 0 to 1, with zero slope and curvature at both ends."""
    share = np.clip(share, 0.0, 1.0)
    return share**3 * (share * (6.0 * share - 15.0) + 10.0)


def hills(points: Points, length: float, seed: int) -> Heights:
    """Value noise from 0 to 1: random at the corners of cubes of side `length`, smooth between them."""
    place = points / length
    cell = np.floor(place)
    share = smooth(place - cell)[..., None, :]
    weights = np.prod(np.where(_CORNERS == 1, share, 1.0 - share), axis=-1)
    return np.sum(weights * cell_random(cell.astype(np.int64)[..., None, :] + _CORNERS, seed), axis=-1)


def plates(points: Points, length: float, riser: float, seed: int) -> Heights:
    """Plateaus from 0 to 1: each place has the number of the nearest of random points, one in each cube of side
    `length`.

    Between plateaus there are risers of width `riser`.
    """
    cells = np.floor(points / length).astype(np.int64)[..., None, :] + _AROUND
    strewn = np.stack([cell_random(cells, 4 * seed + axis) for axis in range(3)], axis=-1)
    distance = np.linalg.norm(points[..., None, :] - (cells + strewn) * length, axis=-1)
    weights = np.exp((distance.min(-1, keepdims=True) - distance) * (4.0 / riser))
    return np.sum(weights * cell_random(cells, 4 * seed + 3), axis=-1) / np.sum(weights, axis=-1)


Kind = Literal["bumps", "steps", "waves", "fractal"]
_WAVES = 8
_RISER = 0.1  # width of a riser between plateaus, as a share of the spacing
_BLEND = 1.0  # m, over which the ground rises around the clearing


class Elevation(Protocol):
    """Heights above the ellipsoid."""

    @property
    def least(self) -> float:
        """The least possible height in m."""
        ...

    @property
    def greatest(self) -> float:
        """The greatest possible height in m."""
        ...

    def __call__(self, points: Points, normals: Points) -> Heights:
        """Heights (…) in m over points (…, 3) on the ellipsoid with unit normals (…, 3)."""
        ...


@dataclasses.dataclass(frozen=True)
class SeededElevation:
    """Elevation as a function of the place in space, so that it has neither seams nor poles.

    It is 0 at `start` (3,), so that a body stands there as on level ground.

    **Arguments:** `kind`, `height`, `spacing`, `seed`: as of `Planet`; `finest` (m): the shortest wavelength of
    "fractal"; `clearing` (m): radius of a level disc around the start.
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
        """Bumps on bumps, each half as wide and half as high as those below."""
        octaves = max(1, 1 + int(np.log2(self.spacing / self.finest)))
        shares = 0.5 ** np.arange(octaves)
        layers = [hills(points, self.spacing / 2.0 ** (n + 1), self.seed + n) for n in range(octaves)]
        return sum(share * layer for share, layer in zip(shares, layers, strict=True)) / shares.sum()


@dataclasses.dataclass(frozen=True, eq=False)
class MapElevation:
    """Elevation from a map of latitudes and longitudes, with linear interpolation.

    **Arguments:** `heights` (rows, columns) in m: the first row at the north pole and the last at the south pole;
    columns evenly from −180°, excluding 180°. The rows at the poles are replaced by their mean.

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
        top = np.minimum(row.astype(int), rows - 2)
        left = np.floor(column).astype(int)
        down = row - top
        right = column - left
        first = left % columns
        second = (left + 1) % columns
        above = (1.0 - right) * self.heights[top, first] + right * self.heights[top, second]
        below = (1.0 - right) * self.heights[top + 1, first] + right * self.heights[top + 1, second]
        return (1.0 - down) * above + down * below


@dataclasses.dataclass(frozen=True)
class Surface:
    """The ground as a function of unit directions: the ellipsoid's point, raised along its normal.

    **Arguments:** `ellipsoid`; `elevation` above it.
    """

    ellipsoid: Ellipsoid
    elevation: Elevation

    def heights(self, directions: Points) -> Heights:
        """Heights above the ellipsoid in m."""
        return self.elevation(self.ellipsoid.points(directions), self.ellipsoid.normals(directions))

    def points(self, directions: Points) -> Points:
        """Points of the ground in m."""
        return self.points_and_heights(directions)[0]

    def points_and_heights(self, directions: Points) -> tuple[Points, Heights]:
        """Points and heights at once."""
        base = self.ellipsoid.points(directions)
        normals = self.ellipsoid.normals(directions)
        heights = self.elevation(base, normals)
        return base + heights[..., None] * normals, heights

    def altitude(self, points: Points) -> Heights:
        """The altitude of points above the ellipsoid in m along its normal; negative below."""
        foot = self.ellipsoid.foot(points)
        return np.sum((points - self.ellipsoid.points(foot)) * self.ellipsoid.normals(foot), axis=-1)

    @property
    def reach(self) -> float:
        """The greatest absolute elevation in m."""
        return max(abs(self.elevation.least), abs(self.elevation.greatest))
