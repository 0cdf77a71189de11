"""Uneven ground and slopes under any body."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
import math
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from motorgrad._errors import check, shown_path
from motorgrad.bodies._batch import BodyBatch
from motorgrad.bodies._body import Body, WrappedBody
from motorgrad.bodies._elevation_file import known_elevation, read_elevation
from motorgrad.schema import Range, Settings, count, number, static

Kind = Literal["bumps", "slopes", "steps", "waves"]
MIN_CELL = 0.1  # m; MuJoCo finds at most 50 contacts per pair, which a finer grid exhausts on the first triangles
MAX_GRID_POINTS = 4_000_000
_ROCK = (0.74, 0.72, 0.66, 1.0)
_DROP = 0.01  # m, from the field's lowest point down to the plane around it, so that nothing touches both
_BLEND = 1.0  # m, over which the ground rises to its full height around the clearing
_WAVES = 8

Noise = np.random.Generator
Points = Float[np.ndarray, "rows columns"]


@dataclasses.dataclass(frozen=True)
class Terrain(Settings):
    """Uneven ground, as a grid of heights made from a few numbers and a seed, or read from a file.

    **Raises:** `ValueError` in one line that names the setting, or the file and what is wrong with it.

    **Warns** where a file's points are closer than `cell`, so that finer detail is lost, and where `difficulty` is 0.

    ```python
    np.savetxt("ridge.csv", [[0, 0.1, 0], [0, 0.3, 0]], delimiter=",")
    ground = mg.bodies.Terrain(map="ridge.csv", in_metres=True, size=(4.0, 2.0), clearing=0.0)
    print(ground.heights().round(2)[-1, ::10])  # → [-0.2 -0.15 -0.1 -0.15 -0.2 ]
    ```
    """

    kind: Kind = static(
        "bumps",
        help='"bumps", a random height at every grid point; "slopes", ramps along x that alternate up and '
        'down, each half of `spacing` long, give or take a quarter; "steps", square plateaus at random '
        'heights, half of `spacing` wide, with risers one cell wide; "waves", eight sines of random '
        "directions and phases, with the wavelength `spacing`",
    )
    height: float = number(
        0.1,
        0,
        open_low=True,
        unit="m",
        help="distance from the lowest to the highest possible point at full difficulty",
    )
    difficulty: float = number(1.0, 0, 1, help="a factor of the heights, 0 for level ground")
    spacing: float = number(
        1.0,
        0,
        open_low=True,
        unit="m",
        help="distance from one ridge, wave or pair of plateaus to the next; without effect on bumps",
    )
    cell: float = number(0.1, MIN_CELL, unit="m", help="distance between two grid points")
    size: tuple[float, float] = static(
        (24.0, 12.0),
        allowed=Range(0, open_low=True),
        unit="m",
        help="size of the field along x and y, centred on the origin",
    )
    clearing: float = number(
        0.6,
        0,
        unit="m",
        help="radius of the level disc at the origin, on which a body starts; around it the ground rises to its full "
        "height within one metre. With 0 the ground is uneven everywhere, with height 0 at the origin",
    )
    seed: int = count(
        0, 0, 2**63 - 1, help="seed of the random numbers; the same seed gives the same ground at every difficulty"
    )
    map: Path | None = static(
        None,
        help="a file of elevations, instead of `kind`, `spacing` and `seed`: a grey picture of 8 or 16 bits (.png), a "
        "NumPy file (.npy), a table of numbers (.csv) or an ESRI grid (.asc), of (rows, columns). It is stretched over "
        "`size`, its first row at the greatest y and its first column at the least x. Black, or the least number, is "
        "the lowest point, and white, or the greatest number, the highest. It is kept as an absolute path",
    )
    in_metres: bool = static(
        False, help="whether the numbers of a file that is no picture are heights in m, whatever `height` is"
    )
    checksum: str | None = static(
        None,
        help="checksum of the file. It is filled in. Ground from a file with another one is refused, so that a run "
        "never continues on ground that has changed",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.map is not None:
            path = self.map.absolute()
            object.__setattr__(self, "map", path)
            found = read_elevation(path, self.checksum)
            object.__setattr__(self, "checksum", found.checksum)
            fits = found.white is None or not self.in_metres
            check(fits, "in_metres", True, "false for a picture: give its `height`")
            self._tell_what_is_lost(found.numbers.shape)

    def validate(self) -> None:
        if self.map is None:
            check(self.spacing >= 2.0 * self.cell, "spacing", self.spacing, f"at least two cells, {2 * self.cell:g} m")
            check(not self.in_metres, "in_metres", True, "false without a `map`")
            check(self.checksum is None, "checksum", self.checksum, "left out without a `map`")
        size = self.size
        check(min(size) >= 2.0 * self.cell, "size", size, f"two lengths of at least two cells, {2 * self.cell:g} m")
        points = (size[0] / self.cell + 1) * (size[1] / self.cell + 1)
        check(points <= MAX_GRID_POINTS, "size", size, f"such that there are at most {MAX_GRID_POINTS} points")

    @property
    def axes(self) -> tuple[Float[np.ndarray, " columns"], Float[np.ndarray, " rows"]]:
        """Coordinates x (columns,) and y (rows,) of the grid points in m. Their number is odd, so that one is at 0."""
        x, y = (self.cell * np.arange(-half, half + 1) for half in (round(s / self.cell / 2.0) for s in self.size))
        return x, y

    def heights(self) -> Points:
        """Heights in m, (rows, columns): rows along y, columns along x; 0 at the origin."""
        x, y = np.meshgrid(*self.axes)
        rows, columns = x.shape
        if self.map is None:
            raw = _HEIGHT_FUNCTIONS[self.kind](self, x, y, np.random.default_rng(self.seed))
        else:
            raw = self._mapped(x, y)
            raw = raw - raw[rows // 2, columns // 2]  # or the clearing would be a pit down to the lowest point
        if self.clearing > 0.0:
            raw = raw * _smooth((np.hypot(x, y) - self.clearing) / _BLEND)
        heights = self.difficulty * (1.0 if self.in_metres else self.height) * raw
        return heights - heights[rows // 2, columns // 2]

    def _mapped(self, x: Points, y: Points) -> Points:
        """Heights of the file in units of `height`, or in m, linear between its points."""
        from scipy.ndimage import map_coordinates  # loading it would slow down every command's start

        assert self.map is not None
        assert self.checksum is not None
        found = known_elevation(self.map, self.checksum)
        numbers = found.numbers if self.in_metres else found.shares
        (rows, columns), (length, width) = numbers.shape, self.size
        row = np.clip((0.5 - y / width) * (rows - 1), 0.0, rows - 1.0)
        column = np.clip((0.5 + x / length) * (columns - 1), 0.0, columns - 1.0)
        return map_coordinates(numbers, (row, column), order=1)

    def _tell_what_is_lost(self, shape: tuple[int, ...]) -> None:
        file = f"map = {shown_path(self.map or '')}"
        if self.difficulty == 0.0:
            warnings.warn(f"{file}: the ground is level, as its difficulty is 0", stacklevel=4)
        apart = min(self.size[0] / (shape[1] - 1), self.size[1] / (shape[0] - 1))
        if apart < self.cell * (1.0 - 1e-9):
            ground = f"those of the ground {self.cell:g} m (`cell`): finer detail is lost"
            warnings.warn(f"{file}: its points are {apart:.3g} m apart, {ground}", stacklevel=4)

    def add(self, spec: mujoco.MjSpec) -> None:
        """Add the ground to a description with a floor, which is lowered and continues around the field: its geom
        "floor", or the only plane of the world. Height 0 of the ground is at the height of the floor."""
        heights = self.heights()
        low = float(heights.min())
        tall = float(np.ptp(heights))
        x, y = self.axes
        field = spec.add_hfield(name="terrain", nrow=len(y), ncol=len(x), userdata=(heights - low).ravel().tolist())
        field.size = (x[-1], y[-1], max(tall, 1e-6), 0.1)
        floor = _floor_of(spec)
        ground = spec.worldbody.add_geom(name="terrain", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="terrain")
        level = float(floor.pos[2])
        ground.pos = (0.0, 0.0, level + low)
        ground.rgba = _ROCK
        for property_ in ("contype", "conaffinity", "friction", "solref", "solimp"):
            setattr(ground, property_, getattr(floor, property_))
        floor.pos = (0.0, 0.0, level + low - _DROP)


def _floor_of(spec: mujoco.MjSpec) -> mujoco.MjsGeom:
    planes = [geom for geom in spec.worldbody.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE]
    floor = spec.geom("floor") or (planes[0] if len(planes) == 1 else None)
    names = [geom.name for geom in spec.geoms]
    check(floor is not None, "geoms of the body", names, "a list with 'floor', or with one plane of the world")
    return floor


@dataclasses.dataclass(frozen=True)
class OnTerrain(WrappedBody):
    """A body on uneven ground: a body like any other, whose floor is a height field.

    It works with any body that has a geom "floor", or one plane in its world. For seeds on different ground,
    pass several such bodies to `BodyBatch`; they differ only in their models. Heights measured by a body are still
    relative to z = 0.

    **Arguments:**

    - `body`: the body.
    - `terrain`: the ground under it.

    ```python
    body = mg.bodies.OnTerrain(mg.bodies.Hexapod(), mg.bodies.Terrain("steps", height=0.05))
    ```
    """

    terrain: Terrain = Terrain()

    def spec(self) -> mujoco.MjSpec:
        """A new, editable `mujoco.MjSpec` of the body on its ground."""
        spec = self.body.spec()
        self.terrain.add(spec)
        return spec


def _bumps(terrain: Terrain, x: Points, y: Points, noise: Noise) -> Points:
    return noise.random(x.shape)


def _slopes(terrain: Terrain, x: Points, y: Points, noise: Noise) -> Points:
    """Ramps between 0 and 1, starting with a rising one at the edge of the clearing on both sides."""
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


_HEIGHT_FUNCTIONS: dict[Kind, Callable[[Terrain, Points, Points, Noise], Points]] = {
    "bumps": _bumps,
    "slopes": _slopes,
    "steps": _steps,
    "waves": _waves,
}


def _smooth(share: np.ndarray) -> np.ndarray:
    """A smooth step from 0 to 1."""
    share = np.clip(share, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


class SlopeBatch(BodyBatch):
    """Simulations on a plane whose slope can change at every decision, independently for each seed.

    Walking up a plane is equivalent to walking on a level one with gravity tilted backwards, so only the direction of
    gravity changes, and its magnitude remains the model's. Positions, velocities and sensors are relative to the plane,
    so the trunk's attitude against true gravity is its attitude to the plane combined with the slope.

    **Arguments** and attributes are those of `BodyBatch`, with one body for all seeds.
    """

    def __init__(self, body: Body, seeds: int, substeps: int = 10, threads: int = 0):
        check(not isinstance(body, Sequence), "body", body, "one body for all seeds")
        super().__init__(body, seeds, substeps, threads)

    def _bind(self) -> None:
        super()._bind()
        self._gravity = self._batch.expand("opt.gravity")
        self._level = np.array(self.model.opt.gravity)

    def step(self, control: npt.ArrayLike) -> None:
        """Advance every simulation by one decision.

        **Arguments:** `control` (seeds, groups + 2): as in `BodyBatch.step`; the last two columns are the angle in
        rad at which the plane rises, and the direction in which it does, in rad from x towards y.
        """
        control = np.asarray(control)
        shape = (self.seeds, len(self.groups) + 2)
        check(control.shape == shape, "control.shape", control.shape, f"(seeds, groups + 2) = {shape}")
        slope = control[:, -2].astype(float)
        ahead = control[:, -1].astype(float)
        size = np.linalg.norm(self._level)
        self._gravity[:, 0] = -size * np.sin(slope) * np.cos(ahead)
        self._gravity[:, 1] = -size * np.sin(slope) * np.sin(ahead)
        self._gravity[:, 2] = -size * np.cos(slope)
        super().step(control[:, :-2])

    def reset(
        self,
        rows: Sequence[int] | np.ndarray | None = None,
        position: npt.ArrayLike | None = None,
        velocity: npt.ArrayLike | None = None,
        activation: npt.ArrayLike | None = None,
    ) -> None:
        """Put simulations into the start pose, or into another, on a level plane; as `BodyBatch.reset`."""
        self._gravity[slice(None) if rows is None else rows] = self._level
        super().reset(rows, position, velocity, activation)
