"""Level of detail: which tiles the cameras can see, how finely to draw them, and in what order to send them."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from timsim.planet._elevation import Surface
from timsim.planet._geometry import unit
from timsim.planet._tiles import ROOTS, Key, Tiles, caps, quarters

Spheres = tuple[Float[np.ndarray, "tiles 3"], Float[np.ndarray, " tiles"]]


class Camera(NamedTuple):
    """A camera in the planet's coordinates.

    - `position` (3,) in m.
    - `rotation` (3, 3): columns to the right, down and ahead.
    - `fov`: from the lower to the upper edge of the picture, rad; `aspect`: width over height.
    - `pixels`: height of the picture.
    """

    position: Float[np.ndarray, " 3"]
    rotation: Float[np.ndarray, "3 3"]
    fov: float
    aspect: float
    pixels: int


def spheres(surface: Surface, level: int, tiles: Tiles) -> Spheres:
    """Centres (tiles, 3) and radii (tiles,) in m of bounding spheres of tiles, without their skirts."""
    middle, angle = caps(level, tiles)
    return surface.ellipsoid.points(middle), 2.0 * np.sin(angle / 2.0) * surface.ellipsoid.greatest + surface.reach


def in_frustum(camera: Camera, balls: Spheres) -> Bool[np.ndarray, " tiles"]:
    """Whether part of each sphere may be in the picture, at any distance; false only if none is."""
    centres, radii = balls
    right, down, ahead = ((centres - camera.position) @ camera.rotation).T
    up = np.tan(camera.fov / 2.0)
    seen = ahead >= -radii
    for across, slope in ((right, up * camera.aspect), (down, up)):
        seen &= slope * ahead - np.abs(across) >= -radii * np.hypot(1.0, slope)
    return seen


def above_horizon(
    camera: Camera, surface: Surface, level: int, tiles: Tiles, slack: float
) -> Bool[np.ndarray, " tiles"]:
    """Whether part of each tile may be above the horizon; false only for those that the planet hides.

    They are hidden by an ellipsoid within the ground, of the same shape. In units of its radii it is the unit sphere,
    and a point at distance ρ from the centre is visible from one at distance c if the angle between them is at most
    arccos(1/c) + arccos(1/ρ).

    **Arguments:** `slack` (m): how far the drawn ground may lie below the true one.
    """
    ellipsoid = surface.ellipsoid
    middle_angle = caps(level, tiles)
    within = 1.0 - (max(0.0, -surface.elevation.least) + slack) / ellipsoid.least
    eye = camera.position / (within * np.asarray(ellipsoid.radii))
    far = np.linalg.norm(eye)
    if within <= 0.0 or far <= 1.0:  # nothing is hidden from inside
        return np.ones(len(tiles), bool)
    middle, angle = middle_angle
    # on an ellipsoid, raising ground along its normal also shifts it sideways in these units
    ratio = (ellipsoid.greatest / ellipsoid.least) ** 2
    raised = surface.reach / ellipsoid.least
    sideways = np.arcsin(min(1.0, raised * (ratio - 1.0) / (ratio + 1.0)))
    top = (1.0 + max(0.0, surface.elevation.greatest) / ellipsoid.least) / within
    between = 2.0 * np.arcsin(np.clip(np.linalg.norm(middle - unit(eye), axis=1) / 2.0, 0.0, 1.0))
    return between - angle - sideways <= np.arccos(1.0 / far) + np.arccos(1.0 / top)


_NEAR = 1e-3  # m, the least distance of a tile


class _Level(NamedTuple):
    """The visible tiles of a level: the index of each one's parent among all tiles, and how urgently it should be
    divided.
    """

    tiles: Tiles
    parent: Int[np.ndarray, " tiles"]
    urgency: Float[np.ndarray, " tiles"]
    wanting: Bool[np.ndarray, " tiles"]


def select_tiles(
    surface: Surface,
    errors: Float[np.ndarray, " levels"],
    cameras: Sequence[Camera],
    tolerance: float,
    most: int,
) -> list[Key]:
    """The tiles that the cameras need, the most urgent first; no two overlap.

    A tile is divided into four while the error of its mesh exceeds `tolerance` pixels in some picture. Tiles with the
    largest errors are divided first, until there are `most` tiles.

    **Arguments:** `errors` (levels,) in m of each level's meshes; `tolerance` in pixels; `most` tiles, at least 6.

    **Returns:** tiles that some camera may see, which cover everything it sees.
    """
    levels: list[_Level] = []
    tiles = ROOTS
    parent = np.full(6, -1)
    urgency = np.full(6, np.inf)
    count = 0
    for level, error in enumerate(errors):
        seen, pixels = _visibility(surface, float(errors[0]), cameras, level, tiles, float(error))
        # no tile is divided before its parent
        tiles = tiles[seen]
        parent = parent[seen]
        urgency = np.minimum(urgency, pixels)[seen]
        wanting = (urgency > tolerance) & (level < len(errors) - 1)
        if np.count_nonzero(wanting) > most:  # the others would not be divided in the end
            wanting &= urgency >= np.partition(urgency, -most)[-most]
        levels.append(_Level(tiles, parent, urgency, wanting))
        parent = np.repeat(count + np.flatnonzero(wanting), 4)
        count += len(tiles)
        tiles = quarters(tiles[wanting])
        urgency = np.repeat(urgency[wanting], 4)
        if not len(tiles):
            break
    return _cut(levels, most)


def _visibility(
    surface: Surface, slack: float, cameras: Sequence[Camera], level: int, tiles: Tiles, error: float
) -> tuple[Bool[np.ndarray, " tiles"], Float[np.ndarray, " tiles"]]:
    """For each tile, whether some camera may see it, and the largest error of its mesh in pixels."""
    seen = np.zeros(len(tiles), bool)
    pixels = np.zeros(len(tiles))
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


class Plan(NamedTuple):
    """The next changes: tiles to `send`, in this order, tiles to `drop`, and the only tiles to `show`."""

    send: list[Key]
    drop: list[Key]
    show: set[Key]


class Cover:
    """The tiles that were sent, and those of them that are shown, without holes or overlaps.

    The nearest ancestor that has arrived stands in for a missing tile. So the six faces are sent first, and every tile
    after its parent; and no more tiles are shown than wanted.

    **Arguments:** `cache`: how many unused tiles are kept; `settle` (s): after how long a sent tile is assumed to have
    arrived.
    """

    def __init__(self, cache: int, settle: float):
        self._cache, self._settle = cache, settle
        self._sent: dict[Key, float] = {}
        self._used: dict[Key, None] = {}  # in the order of last use

    @property
    def sent(self) -> set[Key]:
        """The tiles that were sent and not dropped."""
        return set(self._sent)

    def plan(self, wanted: Iterable[Key], now: float) -> Plan:
        """What to do in order to show `wanted`, at the time `now` in s."""
        wanted = list(wanted)
        chain = [(*reversed(key.ancestors), key) for key in wanted]
        needed = dict.fromkeys(key for each in chain for key in each)
        for key in needed:
            self._used.pop(key, None)
            self._used[key] = None
        missing = sorted((key for key in needed if key not in self._sent), key=lambda key: key.level)
        idle = [key for key in self._used if key in self._sent and key not in needed]
        drop = idle[: max(0, len(idle) - self._cache)]
        for key in drop:
            del self._used[key]
        shown = {key for each in chain if (key := self._nearest(each, now)) is not None}
        return Plan(missing, drop, {key for key in shown if not shown.intersection(key.ancestors)})

    def note(self, sent: Iterable[Key], dropped: Iterable[Key], now: float) -> None:
        """Record what was done."""
        self._sent |= dict.fromkeys(sent, now)
        for key in dropped:
            del self._sent[key]

    def _nearest(self, chain: tuple[Key, ...], now: float) -> Key | None:
        """The last tile of a chain, from a face down, up to which all have arrived."""
        found = None
        for key in chain:
            if self._sent.get(key, now) > now - self._settle:
                break
            found = key
        return found
