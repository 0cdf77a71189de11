"""Which tiles a camera cannot see: those outside its frustum, and those beyond the horizon."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from motorgrad.sim.planet._ellipsoid import unit
from motorgrad.sim.planet._surface import Surface
from motorgrad.sim.planet._tree import Tiles, caps

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
    """Centres (tiles, 3) and radii (tiles,) in m of balls that hold tiles, without their skirts."""
    middle, angle = caps(level, tiles)
    return surface.ellipsoid.points(middle), 2.0 * np.sin(angle / 2.0) * surface.ellipsoid.greatest + surface.reach


def in_frustum(camera: Camera, balls: Spheres) -> Bool[np.ndarray, " tiles"]:
    """Whether some of each ball may be in the picture, at any distance: false only for those that are not."""
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
    """Whether some of each tile may be above the horizon: false only for those that the planet hides.

    What hides them is an ellipsoid within the ground, of the same shape. In units of its radii it is the unit ball, and
    a point at distance ρ from the middle is seen from one at distance c if the angle between them is at most
    arccos(1/c) + arccos(1/ρ).

    **Arguments:** `slack` (m): how far drawn ground may lie below the true one.
    """
    ellipsoid, middle_angle = surface.ellipsoid, caps(level, tiles)
    within = 1.0 - (max(0.0, -surface.elevation.least) + slack) / ellipsoid.least
    eye = camera.position / (within * np.asarray(ellipsoid.radii))
    far = np.linalg.norm(eye)
    if within <= 0.0 or far <= 1.0:  # from inside nothing is hidden
        return np.ones(len(tiles), bool)
    middle, angle = middle_angle
    # on an ellipsoid, raising ground along its normal also moves it sideways in these units
    ratio = (ellipsoid.greatest / ellipsoid.least) ** 2
    raised = surface.reach / ellipsoid.least
    sideways = np.arcsin(min(1.0, raised * (ratio - 1.0) / (ratio + 1.0)))
    top = (1.0 + max(0.0, surface.elevation.greatest) / ellipsoid.least) / within
    between = 2.0 * np.arcsin(np.clip(np.linalg.norm(middle - unit(eye), axis=1) / 2.0, 0.0, 1.0))
    return between - angle - sideways <= np.arccos(1.0 / far) + np.arccos(1.0 / top)
