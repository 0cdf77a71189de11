"""The ground of a planet: elevation on an ellipsoid."""

import dataclasses

import numpy as np
from jaxtyping import Float

from motorgrad.sim.planet._elevation import Elevation
from motorgrad.sim.planet._ellipsoid import Ellipsoid

Points = Float[np.ndarray, "*any 3"]
Heights = Float[np.ndarray, "*any"]


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
        """Both at once."""
        base, normals = self.ellipsoid.points(directions), self.ellipsoid.normals(directions)
        heights = self.elevation(base, normals)
        return base + heights[..., None] * normals, heights

    def altitude(self, points: Points) -> Heights:
        """How high points are above the ellipsoid, in m along its normal; negative within."""
        foot = self.ellipsoid.foot(points)
        return np.sum((points - self.ellipsoid.points(foot)) * self.ellipsoid.normals(foot), axis=-1)

    @property
    def reach(self) -> float:
        """The greatest elevation up or down, in m."""
        return max(abs(self.elevation.least), abs(self.elevation.greatest))
