"""Tiles: the six faces of a cube around the planet as quad-trees, the mesh of a tile, and its error."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

import functools
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float, Int, UInt8
from PIL import Image
from scipy.ndimage import zoom

from timsim.planet._elevation import Surface, hills
from timsim.planet._geometry import Points, unit

CELLS = 16  # cells along a side of a tile
Tiles = Int[np.ndarray, "tiles 3"]  # tiles of one level: face, column, row
# along the columns, along the rows, outwards: right-handed, so that triangles face outwards
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
    """A tile: one of the 2^level × 2^level of a face."""

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
    """The tiles of a level, one by one."""
    return [Key(level, *map(int, tile)) for tile in tiles]


def quarters(tiles: Tiles) -> Tiles:
    """The four tiles of the next level in each of these, tile by tile."""
    corners = 2 * tiles[:, None, 1:] + _QUARTERS
    faces = np.broadcast_to(tiles[:, None, :1], (*corners.shape[:2], 1))
    return np.concatenate([faces, corners], axis=-1).reshape(-1, 3)


def directions(faces: Int[np.ndarray, "*any"], across: np.ndarray, up: np.ndarray) -> Points:
    """Unit directions of places on faces, from -1 to 1 across and up; coordinate lines are great circles.

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
    """For each tile a direction (tiles, 3) and the angle (tiles,) in rad from it that contains the whole tile.

    Sides are great circles, so that no place of a tile is farther away than its corners.
    """
    found = places(level, tiles, np.array([0.5, 0.0, 1.0, 0.0, 1.0]), np.array([0.5, 0.0, 0.0, 1.0, 1.0]))
    middle = found[:, :1]
    corners = found[:, 1:]
    chords = np.linalg.norm(corners - middle, axis=-1).max(axis=1)
    return middle[:, 0], 2.0 * np.arcsin(chords / 2.0)


HEM = 2  # cells beyond each side
SIDE = CELLS + 2 * HEM
TRIANGLES = 2 * SIDE * SIDE + 8 * SIDE
"""Triangles of a tile with its hem and skirts."""
_FIRST = 0.06  # how far the hem's middle sinks, as a share of its end
_SAMPLES = 1000  # cells that are sampled for the error of a level
_LOW, _MIDDLE, _HIGH = np.array([(104, 122, 92), (171, 160, 132), (226, 224, 218)], float)
# m of ground that the texture covers, its squares a side, and its pixels
REPEAT = 0.8
SQUARES = 4
PIXELS = 128
_TINT = 0.16  # variation of brightness, which makes motion visible


class Tile(NamedTuple):
    """A mesh.

    - `centre` (3,): in the planet's coordinates, m; `vertices` (n, 3) are relative to it.
    - `normals` (n, 3): of the ground, outwards; those of neighbours agree along their seam, so that it does not show.
    - `faces` (m, 3): indices of vertices, facing outwards.
    - `uv` (n, 2): places in the repeated texture, which continues from tile to tile.
    - `colours` (n, 3) of vertices, red, green and blue in linear light.
    """

    centre: Float[np.ndarray, " 3"]
    vertices: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]
    uv: Float[np.ndarray, "n 2"]
    colours: UInt8[np.ndarray, "n 3"]


def make_tile(surface: Surface, key: Key, hem: float, skirt: float) -> Tile:
    """The mesh of a tile: its grid, row by row, with a hem, then skirts down along the hem's four sides.

    The hem is two more cells of ground on each side. The first lies just under the neighbour's, so that both sides of a
    seam are lit alike; the second sinks, so that its end, and the skirt on it, do not stick out of a coarser neighbour.
    Skirts have vertices of their own, so that they do not affect the shading.

    **Arguments:** `key`; `hem` (m): how far its end sinks; `skirt` (m): how far skirts reach down from there.
    """
    share = np.arange(-HEM, CELLS + HEM + 1) / CELLS
    across, up = (each.ravel() for each in np.meshgrid(share, share))
    tile = np.array([[key.face, key.column, key.row]])
    ways = places(key.level, tile, across, up)[0]
    ground, heights = surface.points_and_heights(ways)
    colours = _colours(surface, ground, heights)
    normals = _normals(ground)
    repeats = max(1, round(surface.ellipsoid.least * np.pi / 2.0 / REPEAT))  # whole along a face, to join at its edges
    uv = repeats / 2**key.level * np.stack([key.column + across, key.row + up], axis=1)
    uv -= np.floor(uv.min(axis=0))  # small numbers, for single precision
    centre = surface.ellipsoid.points(places(key.level, tile, np.array([0.5]), np.array([0.5]))[0, 0])
    down = -surface.ellipsoid.normals(ways[RIM])
    ground[RIM] += hem * down
    ground[BESIDE] -= _FIRST * hem * surface.ellipsoid.normals(ways[BESIDE])
    top = ground[RIM]
    vertices = np.concatenate([ground, top, top + skirt * down]) - centre
    normals, uv, colours = (np.concatenate([each, each[RIM], each[RIM]]) for each in (normals, uv, colours))
    return Tile(centre, vertices.astype(np.float32), normals, FACES, uv.astype(np.float32), colours)


def _normals(ground: Points) -> Points:
    """The normals of a grid of points, row by row."""
    grid = ground.reshape(SIDE + 1, SIDE + 1, 3)
    across = np.gradient(grid, axis=1)
    up = np.gradient(grid, axis=0)
    return unit(np.cross(across, up).reshape(-1, 3))


def mesh_errors(surface: Surface, deepest: int) -> Float[np.ndarray, " levels"]:
    """For each level, the distance of its triangles from the true ground, in m.

    It is the maximum over random cells, measured where a triangle is farthest from its corners: in the middle of cells
    and of their sides. No level has a smaller error than a deeper one.
    """
    noise = np.random.default_rng(0)
    faces = noise.integers(0, 6, _SAMPLES)
    found = []
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


def _rim(within: int) -> Int[np.ndarray, " rim"]:
    """The grid's vertices along its rim, or `within` cells inside, anticlockwise from outside, without repeating the
    first.
    """
    grid = np.arange((SIDE + 1) ** 2).reshape(SIDE + 1, SIDE + 1)
    grid = grid[within : SIDE + 1 - within, within : SIDE + 1 - within]
    return np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])


RIM = _rim(0)
BESIDE = _rim(1)


def _faces() -> Int[np.ndarray, "m 3"]:
    grid = np.arange((SIDE + 1) ** 2).reshape(SIDE + 1, SIDE + 1)
    a = grid[:-1, :-1].ravel()
    b = grid[:-1, 1:].ravel()
    c = grid[1:, 1:].ravel()
    d = grid[1:, :-1].ravel()
    top = (SIDE + 1) ** 2 + np.arange(4 * SIDE)
    beside = np.roll(top, -1)
    bottom = top + 4 * SIDE
    under = np.roll(bottom, -1)
    sides = [(a, b, c), (a, c, d), (top, bottom, under), (top, under, beside)]
    return np.concatenate([np.stack(side, axis=1) for side in sides]).astype(np.uint32)


FACES = _faces()


def _colours(surface: Surface, points: np.ndarray, heights: np.ndarray) -> UInt8[np.ndarray, "n 3"]:
    """From green in the valleys to white on the tops, in slightly lighter and darker patches."""
    low, high = surface.elevation.least, surface.elevation.greatest
    share = ((heights - low) / (high - low) if high > low else np.full_like(heights, 0.5))[:, None]
    ramp = np.where(share < 0.5, _LOW + 2 * share * (_MIDDLE - _LOW), _MIDDLE + (2 * share - 1) * (_HIGH - _MIDDLE))
    patches = hills(points, surface.ellipsoid.least / 8.0, 7) + hills(points, 0.3, 8)
    shades = np.clip(ramp * (1.0 + _TINT * (patches[:, None] - 1.0)) / 255.0, 0.0, 1.0)
    return np.round(255.0 * shades**2.2).astype(np.uint8)  # vertex colours are in linear light


@functools.cache
def ground_texture() -> Image.Image:
    """The repeated detail of the ground: squares, and a grain that is visible near by."""
    noise = np.random.default_rng(0).normal(size=(PIXELS, PIXELS))
    grain = noise.copy()
    for step in (2, 4):
        grain += np.asarray(zoom(noise[::step, ::step], step, order=1, mode="grid-wrap", grid_mode=True))
    square = np.arange(PIXELS) * SQUARES // PIXELS
    shade = 0.93 + 0.02 * grain / np.std(grain) - 0.06 * ((square[:, None] + square) % 2)
    picture = np.round(255 * np.clip(shade, 0, 1)).astype(np.uint8)
    image = Image.fromarray(np.repeat(picture[..., None], 3, axis=2))
    image.format = "JPEG"
    return image


def tile_glb(tile: Tile) -> bytes:
    """A tile as GLB, coloured by vertices times a texture, and smoothly shaded."""
    mesh = trimesh.Trimesh(tile.vertices, tile.faces, vertex_normals=tile.normals, process=False)
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=ground_texture(), metallicFactor=0.0, roughnessFactor=0.95, doubleSided=False
    )
    mesh.visual = trimesh.visual.TextureVisuals(uv=tile.uv, material=material)
    opaque = np.full(len(tile.colours), 255, np.uint8)
    mesh.visual.vertex_attributes["color"] = np.c_[tile.colours, opaque]
    return mesh.export(file_type="glb", include_normals=True)  # type: ignore[return-value]
