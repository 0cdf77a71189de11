"""The ellipsoid under the terrain."""

import dataclasses

import numpy as np
from jaxtyping import Float

Points = Float[np.ndarray, "*any 3"]
_STEPS = 60  # of Newton's method, which mostly needs five


@dataclasses.dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid about the origin, its axes along x, y and z.

    A point on it is `radii * direction` for a unit `direction`, which on a sphere is also the way out. Level ground is
    the ellipsoid itself, so that up is its `normal`.

    **Arguments:** `radii` (3,) in m, along x, y and z.
    """

    radii: tuple[float, float, float]

    @property
    def least(self) -> float:
        """The least radius in m."""
        return min(self.radii)

    @property
    def greatest(self) -> float:
        """The greatest radius in m."""
        return max(self.radii)

    @property
    def tightest(self) -> float:
        """The least radius of curvature in m, at the ends of the longest axis."""
        return self.least**2 / self.greatest

    def points(self, directions: Points) -> Points:
        """The points on the ellipsoid of unit directions."""
        return directions * self.radii

    def normals(self, directions: Points) -> Points:
        """The unit normals, outwards, at the points of unit directions."""
        return unit(directions / self.radii)

    def tangent(self, normals: Points) -> Points:
        """The unit directions of the points that have these normals: the inverse of `normals`."""
        return unit(normals * np.asarray(self.radii))

    def foot(self, points: Points) -> Points:
        """The unit directions of the points of the ellipsoid nearest to any points but those near its middle.

        The nearest point is `r² x / (r² + t)` for the root t of a function that falls and is convex from where one of
        its terms alone is 1: from there Newton's method only comes nearer.
        """
        squares = np.square(self.radii)
        scaled = points * np.asarray(self.radii)
        root = np.max(np.abs(scaled) - squares, axis=-1)
        with np.errstate(invalid="ignore", divide="ignore"):
            for _ in range(_STEPS):
                parts = np.nan_to_num(scaled / (squares + root[..., None]), posinf=1.0, neginf=-1.0)
                value = np.sum(np.square(parts), axis=-1) - 1.0
                slope = 2.0 * np.sum(np.nan_to_num(np.square(parts) / (squares + root[..., None])), axis=-1)
                step = np.nan_to_num(value / slope)
                root = root + step
                if np.all(np.abs(step) <= 1e-15 * squares.max()):
                    break
            return unit(np.nan_to_num(scaled / (squares + root[..., None])))


def unit(vectors: Points) -> Points:
    """Vectors of length 1 along these."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def towards(latitude: float, longitude: float) -> Float[np.ndarray, " 3"]:
    """The unit normal at a geographic latitude and longitude in degrees; north is along z."""
    north, east = np.radians((latitude, longitude))
    return np.array([np.cos(north) * np.cos(east), np.cos(north) * np.sin(east), np.sin(north)])
