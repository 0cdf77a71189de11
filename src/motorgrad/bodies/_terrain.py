"""Uneven ground, made from a few numbers and a seed, under any body."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
import math
from collections.abc import Callable
from typing import Any, Literal, get_args

import mujoco
import numpy as np
from jaxtyping import Float

from motorgrad._errors import check, choice
from motorgrad.bodies._muscle import not_negative, positive
from motorgrad.bodies._wrapped_body import WrappedBody

Kind = Literal["bumps", "slopes", "steps", "waves"]
LEAST_CELL = 0.1  # m; MuJoCo takes at most 50 contacts of a pair, and a fine grid spends them on the first triangles
MOST_POINTS = 4_000_000
_ROCK = (0.74, 0.72, 0.66, 1.0)
_DROP = 0.01  # m, of the plane around the field below the field's lowest point, so that nothing touches both
_BLEND = 1.0  # m, over which the ground rises to its full height around the clearing
_WAVES = 8

Noise = np.random.Generator
Points = Float[np.ndarray, "rows columns"]


@dataclasses.dataclass(frozen=True)
class Terrain:
    """Uneven ground as a grid of heights.

    **Arguments:**

    - `kind`: "bumps", a random height at every point of the grid; "slopes", ramps along x, up and down in turn, each as
      long as half of `spacing`, give or take a quarter; "steps", square plateaus with sides of half of `spacing`, at
      random heights, with risers as wide as one cell; "waves", eight sines of random directions and phases, each of the
      wavelength `spacing`.
    - `height` (m): from the lowest to the highest point that is possible, at full difficulty.
    - `difficulty`: from 0, level ground, to 1; the height grows in proportion.
    - `spacing` (m): from one ridge, wave or pair of plateaus to the next; bumps have none but the cell.
    - `cell` (m): between two points of the grid, at least 0.1.
    - `size` (m): of the field along x and y, with the origin in its middle.
    - `clearing` (m): the radius of the level disc at the origin, on which a body starts; around it the ground rises to
      its full height within one metre. With 0 the ground is uneven from the start, and level with 0 at the origin.
    - `seed`: of the random numbers; the same seed gives the same ground at every difficulty.

    **Raises:** `ValueError` naming the field and what it may be.
    """

    kind: Kind = "bumps"
    height: float = 0.1
    difficulty: float = 1.0
    spacing: float = 1.0
    cell: float = 0.1
    size: tuple[float, float] = (24.0, 12.0)
    clearing: float = 0.6
    seed: int = 0

    def __post_init__(self) -> None:
        choice("kind", self.kind, get_args(Kind))
        for name in ("height", "cell", "spacing"):
            positive(name, getattr(self, name))
        not_negative("clearing", self.clearing)
        not_negative("difficulty", self.difficulty)
        check(self.difficulty <= 1.0, "difficulty", self.difficulty, "from 0 to 1")
        check(self.cell >= LEAST_CELL, "cell", self.cell, f"at least {LEAST_CELL} m")
        check(self.spacing >= 2.0 * self.cell, "spacing", self.spacing, f"at least two cells, {2 * self.cell:g} m")
        size = tuple(self.size)
        check(len(size) == 2, "size", size, "two lengths (m)")
        for length in size:
            positive("size", length)
        check(min(size) >= 2.0 * self.cell, "size", size, f"two lengths of at least two cells, {2 * self.cell:g} m")
        points = (size[0] / self.cell + 1) * (size[1] / self.cell + 1)
        check(points <= MOST_POINTS, "size", size, f"such that there are at most {MOST_POINTS} points")
        whole = isinstance(self.seed, int) and not isinstance(self.seed, bool)
        check(whole and self.seed >= 0, "seed", self.seed, "a whole number >= 0")
        object.__setattr__(self, "size", size)

    @property
    def axes(self) -> tuple[Float[np.ndarray, " columns"], Float[np.ndarray, " rows"]]:
        """Coordinates x (columns,) and y (rows,) of the grid's points in m; an odd number, so that one is at 0."""
        x, y = (self.cell * np.arange(-half, half + 1) for half in (round(s / self.cell / 2.0) for s in self.size))
        return x, y

    def heights(self) -> Points:
        """Heights in m, (rows, columns): rows along y, columns along x. 0 at the origin."""
        x, y = np.meshgrid(*self.axes)
        raw = _KINDS[self.kind](self, x, y, np.random.default_rng(self.seed))
        if self.clearing > 0.0:
            raw = raw * _smooth((np.hypot(x, y) - self.clearing) / _BLEND)
        rows, columns = raw.shape
        heights = self.difficulty * self.height * raw
        return heights - heights[rows // 2, columns // 2]

    def add(self, spec: mujoco.MjSpec) -> None:
        """Put the ground under a body that stands on the plane "floor", which is lowered to go on around it."""
        heights = self.heights()
        low, tall = float(heights.min()), float(np.ptp(heights))
        x, y = self.axes
        field = spec.add_hfield(name="terrain", nrow=len(y), ncol=len(x), userdata=(heights - low).ravel().tolist())
        field.size = (x[-1], y[-1], max(tall, 1e-6), 0.1)
        floor = spec.geom("floor")
        check(floor is not None, "geoms of the body", [geom.name for geom in spec.geoms], "such that one is 'floor'")
        ground = spec.worldbody.add_geom(name="terrain", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="terrain")
        ground.pos, ground.rgba = (0.0, 0.0, low), _ROCK
        for property_ in ("contype", "conaffinity", "friction", "solref", "solimp"):
            setattr(ground, property_, getattr(floor, property_))
        floor.pos = (0.0, 0.0, low - _DROP)


@dataclasses.dataclass(frozen=True)
class OnTerrain(WrappedBody):
    """A body on uneven ground: a body like any other, whose floor is a height field.

    Any body with a geom "floor" will do. Seeds on different ground are a `BodyBatch` of several such bodies, which
    share everything but their models. Heights that a body measures are still above z = 0.

    **Arguments:** `body`, and the `terrain` under it.
    """

    terrain: Terrain = Terrain()

    def spec(self) -> mujoco.MjSpec:
        """A fresh, editable `mujoco.MjSpec` of the body on its ground."""
        spec = self.body.spec()
        self.terrain.add(spec)
        return spec


def _bumps(terrain: Terrain, x: Points, y: Points, noise: Noise) -> Points:
    return noise.random(x.shape)


def _slopes(terrain: Terrain, x: Points, y: Points, noise: Noise) -> Points:
    """Ramps between 0 and 1 that begin at the edge of the clearing with one that rises, on both sides."""
    reach = float(np.abs(x).max())
    count = 2 + math.ceil(reach / (0.25 * terrain.spacing))
    lengths = terrain.spacing / 2.0 * (0.75 + 0.5 * noise.random((2, count)))
    raw = np.zeros_like(x)
    for side, sign in zip(lengths, (1.0, -1.0), strict=True):
        ends = np.concatenate([[0.0], np.cumsum(side)])
        along = np.clip(sign * x - terrain.clearing, 0.0, None)
        raw = np.where(sign * x > 0.0, np.interp(along, ends, np.arange(count + 1) % 2), raw)
    return raw


def _steps(terrain: Terrain, x: Points, y: Points, noise: Noise) -> Points:
    side = max(1, round(terrain.spacing / 2.0 / terrain.cell))
    rows, columns = (math.ceil(n / side) for n in x.shape)
    plateaus = noise.random((rows, columns))
    return plateaus.repeat(side, 0).repeat(side, 1)[: x.shape[0], : x.shape[1]]


def _waves(terrain: Terrain, x: Points, y: Points, noise: Noise) -> Points:
    """The mean of sines, from 0 to 1."""
    way, phase = 2.0 * np.pi * noise.random((2, _WAVES, 1, 1))
    number = 2.0 * np.pi / terrain.spacing
    return 0.5 + 0.5 * np.sin(number * (x * np.cos(way) + y * np.sin(way)) + phase).mean(0)


_KINDS: dict[str, Callable[..., Any]] = {"bumps": _bumps, "slopes": _slopes, "steps": _steps, "waves": _waves}


def _smooth(share: np.ndarray) -> np.ndarray:
    """From 0 to 1 with level ends."""
    share = np.clip(share, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)
