"""The settings of a planet, its surface, and the patch of ground near a body as MuJoCo has it."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

import dataclasses
import functools
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float

from motorgrad._errors import check, shown_path
from motorgrad._limits import MAX_HEIGHT_MAP_BYTES
from motorgrad._reading import array_in, content_of
from motorgrad.schema import Range, Settings, count, inner, number, static
from timsim.planet._elevation import Elevation, Kind, MapElevation, SeededElevation, Surface
from timsim.planet._geometry import Ellipsoid, Frame, frame_at, normal_at

FIELD = "patch"
"""The name of the height field, of its geom and of the body that carries it."""
_HIDDEN = 5  # a geom group that no viewer shows; the planet's tiles are drawn instead
_CLOSE = 1e-4  # m
_MAX_ITERATIONS = 12


@dataclasses.dataclass(frozen=True)
class Patch:
    """A square of ground around the foot of a frame, sampled on a grid of the local plane.

    Its heights include the curvature of the planet: they fall towards the edge.

    **Arguments:** `surface`; `reach` (m): half a side; `cell` (m): grid spacing.
    """

    surface: Surface
    reach: float
    cell: float

    @property
    def axis(self) -> Float[np.ndarray, " points"]:
        """The grid's coordinates along x and y from the foot, in m."""
        half = round(self.reach / self.cell)
        return self.cell * np.arange(-half, half + 1)

    @property
    def bounds(self) -> tuple[float, float]:
        """Below and above all possible heights, in m."""
        low, high = self.surface.elevation.least, self.surface.elevation.greatest
        # the lowest ground is curved too, with a smaller radius
        edge = np.sqrt(2.0) * self.axis[-1]
        round_ = self.surface.ellipsoid.tightest + min(0.0, low)
        drop = round_ - np.sqrt(max(0.0, round_**2 - edge**2))
        return min(0.0, low) - drop - 1e-3, max(0.0, high) + 1e-3

    def heights(self, frame: Frame) -> Float[np.ndarray, "rows columns"]:
        """Heights of the ground over the local plane in m, rows along y and columns along x.

        Elevation is along the ellipsoid's normal, not the plane's, so the ground over a place of the plane is found by
        iteration. Where the ground overhangs as seen from the plane, one of its heights is found.
        """
        ellipsoid = self.surface.ellipsoid
        up = frame.rotation[2]
        x, y = np.meshgrid(self.axis, self.axis)
        foot = frame.foot(ellipsoid)
        wanted = np.stack([x.ravel() + foot[0], y.ravel() + foot[1], np.zeros(x.size)], axis=1)
        aside = np.zeros_like(wanted)
        found = wanted
        for _ in range(_MAX_ITERATIONS):
            start = frame.to_planet(wanted - aside)
            base = start + _rise(start / ellipsoid.radii, up / np.asarray(ellipsoid.radii))[:, None] * up
            found = frame.to_local(self.surface.points(base / ellipsoid.radii))
            off = found - wanted
            off[:, 2] = 0.0
            aside = aside + off
            if np.abs(off).max() < _CLOSE:
                break
        return found[:, 2].reshape(x.shape)

    def add(self, spec: mujoco.MjSpec, like: mujoco.MjsGeom) -> None:
        """Add the height field to a model, on a body that can be moved; its contacts are like those of geom `like`."""
        low, high = self.bounds
        count = len(self.axis)
        field = spec.add_hfield(name=FIELD, nrow=count, ncol=count, userdata=np.zeros(count * count).tolist())
        field.size = (self.axis[-1], self.axis[-1], high - low, 0.1)
        body = spec.worldbody.add_body(name=FIELD, mocap=True, pos=(0.0, 0.0, low))
        geom = body.add_geom(name=FIELD, type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=FIELD, group=_HIDDEN)
        geom.mass = 0.0  # or the viewers' weight and centre of mass would be those of the ground
        for property_ in ("contype", "conaffinity", "friction", "solref", "solimp"):
            setattr(geom, property_, getattr(like, property_))

    def write(self, model: mujoco.MjModel, frame: Frame) -> Float[np.ndarray, " 3"]:
        """Write the ground of a frame into the model's field. **Returns:** the position of its body (`mocap_pos`)."""
        low, high = self.bounds
        field = model.hfield(FIELD)
        field.data[...] = np.clip((self.heights(frame) - low) / (high - low), 0.0, 1.0)
        return frame.foot(self.surface.ellipsoid) * (1.0, 1.0, 0.0) + (0.0, 0.0, low)


def _rise(start: Float[np.ndarray, "n 3"], way: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " n"]:
    """The distance from each start along `way` to where it leaves the unit sphere, or to the closest approach."""
    a = way @ way
    b = start @ way
    c = np.sum(start * start, axis=1) - 1.0
    return (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / a


# m
MIN_RADIUS = 1.0
MAX_RADIUS = 1e6
MIN_CELL = 0.05  # m
MAX_PATCH_POINTS = 250_000
MIN_TRIANGLES = 20_000


@dataclasses.dataclass(frozen=True)
class Detail(Settings):
    """The level of detail of a planet, and its budget."""

    tolerance: float = number(
        2.0,
        0,
        open_low=True,
        unit="pixels",
        help="error of the drawn ground in the picture, as far as the budget allows",
    )
    triangles: int = count(100_000, MIN_TRIANGLES, help="drawn at most at any time, for all browsers together")
    changes: int = count(8, 1, help="tiles sent at most in one update")
    milliseconds: float = number(10.0, 0, open_low=True, unit="ms", help="after which an update begins no further tile")
    cache: int = count(400, help="hidden tiles that a browser keeps at most, beyond those in use")


@dataclasses.dataclass(frozen=True)
class Planet(Settings):
    """A round world of three radii, with terrain from a seed or a map.

    **Raises:** `ValueError` that names the field and its allowed values; for a map, the file and the reason.

    ```py
    task = on_planet(mg.make("hexapod"), Planet(radii=(4.0, 4.0, 3.5), height=0.1))
    ```
    """

    radii: tuple[float, float, float] = static(
        (3.0, 3.0, 3.0),
        allowed=Range(MIN_RADIUS, MAX_RADIUS),
        unit="m",
        help="of the ellipsoid along x, y and z. The poles are on z",
    )
    kind: Kind = static(
        "bumps",
        help='"bumps", random heights with smooth ground between them; "steps", plateaus at random heights; '
        '"waves", eight sines of random directions and phases; "fractal", bumps on ever smaller bumps',
    )
    height: float = number(
        0.1,
        0,
        unit="m",
        help="from the lowest to the highest possible point; 0 is smooth. Where a body starts the ground is at the "
        "height of the ellipsoid",
    )
    spacing: float = number(
        1.0, 0, open_low=True, unit="m", help='between bumps, waves or plateaus; of "fractal" the widest'
    )
    seed: int = count(0, 0, 2**63 - 1, help="of the random numbers")
    clearing: float = number(
        0.6,
        0,
        unit="m",
        help="radius of the level disc on which a body starts; around it the ground rises within a metre",
    )
    map: Path | None = static(
        None,
        help="a NumPy file (.npy) of heights (rows, columns) in m, instead of the five settings above: from the north "
        "pole to the south pole, and around from longitude −180°",
    )
    latitude: float = number(0.0, -90, 90, unit="degrees", help="where a body starts")
    longitude: float = number(0.0, -360, 360, unit="degrees", help="where a body starts")
    heading: float = number(90.0, -360, 360, unit="degrees", help="direction of a body at the start, 0 north, 90 east")
    patch: float = number(
        1.5,
        0,
        open_low=True,
        unit="m",
        help="half a side of the square of ground on which its physics runs; the body must be well within it",
    )
    cell: float = number(0.1, MIN_CELL, unit="m", help="grid spacing of the patch; finer ground is not felt")
    travel: float = number(
        0.1, 0, 0.5, open_low=True, help="the share of `patch` that the body travels before the patch is moved"
    )
    detail: Detail = inner(Detail(), help="how finely it is drawn")

    def validate(self) -> None:
        check(self.spacing >= 2.0 * self.cell, "spacing", self.spacing, f"at least two cells, {2 * self.cell:g} m")
        tightest = self.ellipsoid.tightest
        allowed = f"from two cells, {2 * self.cell:g} m, to half of the least radius of curvature, {tightest / 2:g} m"
        check(2.0 * self.cell <= self.patch <= tightest / 2.0, "patch", self.patch, allowed)
        points = (2.0 * self.patch / self.cell + 1.0) ** 2
        check(points <= MAX_PATCH_POINTS, "patch", self.patch, f"such that it has at most {MAX_PATCH_POINTS:,} points")
        if self.map is None:
            check(self.height <= tightest / 4.0, "height", self.height, f"at most {tightest / 4:g} m on these radii")
        else:
            reach = max(abs(self.elevation.least), abs(self.elevation.greatest))
            allowed = f"heights of at most {tightest / 8:g} m up or down on these radii"
            check(reach <= tightest / 8.0, f"{self.map}", f"{reach:g} m", allowed)

    @property
    def ellipsoid(self) -> Ellipsoid:
        """The planet without elevation."""
        return Ellipsoid(self.radii)

    @functools.cached_property
    def elevation(self) -> Elevation:
        """Elevation above the ellipsoid."""
        if self.map is not None:
            return _read(self.map)
        start = self.ellipsoid.points(self.ellipsoid.tangent(normal_at(self.latitude, self.longitude)))
        numbers = (self.height, self.spacing, 4.0 * self.cell, self.seed, self.clearing)
        return SeededElevation(self.kind, *numbers, tuple(map(float, start)))

    @functools.cached_property
    def surface(self) -> Surface:
        """The ground."""
        return Surface(self.ellipsoid, self.elevation)

    @property
    def ground(self) -> Patch:
        """The patch of ground that a body's physics uses."""
        return Patch(self.surface, self.patch, self.cell)

    @property
    def lift(self) -> float:
        """How far a body must be raised at the start, in m, to stand on the highest ground of the clearing.

        It is 0 for seeded ground, which is level there; a map can have any height.
        """
        heights = self.ground.heights(self.start)
        axis = self.ground.axis
        return float(heights[np.hypot(*np.meshgrid(axis, axis)) <= self.clearing].max())

    @property
    def start(self) -> Frame:
        """The local frame at the start."""
        return frame_at(self.ellipsoid, self.latitude, self.longitude, self.heading)


def _read(path: Path) -> MapElevation:
    try:
        heights = array_in(content_of(path, MAX_HEIGHT_MAP_BYTES))
    except OSError as error:
        raise ValueError(f"map = {shown_path(path)}: {error.strerror or 'not a NumPy file'}") from None
    except ValueError as error:
        raise ValueError(f"map = {shown_path(path)}: must be a NumPy file (.npy) of numbers: {error}") from None
    try:
        return MapElevation(heights)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
