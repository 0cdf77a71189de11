"""The ground near a body as MuJoCo has it: a height field over the local plane."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses

import mujoco
import numpy as np
from jaxtyping import Float

from motorgrad.sim.planet._frame import Frame
from motorgrad.sim.planet._surface import Surface

FIELD = "patch"
"""The name of the height field, of its geom and of the body that carries it."""

_HIDDEN = 5  # a group of geoms that no viewer shows: the planet's tiles are seen instead
_CLOSE = 1e-4  # m
_MOST = 12


@dataclasses.dataclass(frozen=True)
class Patch:
    """A square of ground around the foot of a frame, sampled on a grid of the local plane.

    The heights hold the roundness of the planet too: they fall towards the edge.

    **Arguments:** `surface`; `reach` (m): half a side; `cell` (m): between two points of the grid.
    """

    surface: Surface
    reach: float
    cell: float

    @property
    def axis(self) -> Float[np.ndarray, " points"]:
        """Places of the grid along x and y from the foot, in m."""
        half = round(self.reach / self.cell)
        return self.cell * np.arange(-half, half + 1)

    @property
    def bounds(self) -> tuple[float, float]:
        """Below and above every height that can be, in m."""
        low, high = self.surface.elevation.least, self.surface.elevation.greatest
        # the lowest ground is a round body too, and smaller
        edge, round_ = np.sqrt(2.0) * self.axis[-1], self.surface.ellipsoid.tightest + min(0.0, low)
        drop = round_ - np.sqrt(max(0.0, round_**2 - edge**2))
        return min(0.0, low) - drop - 1e-3, max(0.0, high) + 1e-3

    def heights(self, frame: Frame) -> Float[np.ndarray, "rows columns"]:
        """Heights of the ground over the local plane in m, rows along y and columns along x.

        Elevation stands on the ellipsoid's normal, not on the plane's: what is over a place of the plane is searched
        for by steps, each as far as the last found was off. Overhangs as seen from the plane have one of their heights.
        """
        ellipsoid, up = self.surface.ellipsoid, frame.rotation[2]
        x, y = np.meshgrid(self.axis, self.axis)
        foot = frame.foot(ellipsoid)
        wanted = np.stack([x.ravel() + foot[0], y.ravel() + foot[1], np.zeros(x.size)], axis=1)
        aside = np.zeros_like(wanted)
        found = wanted
        for _ in range(_MOST):
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
        """Put the field into a model, on a body that can be moved; it is touched as the geom `like` is."""
        low, high = self.bounds
        count = len(self.axis)
        field = spec.add_hfield(name=FIELD, nrow=count, ncol=count, userdata=np.zeros(count * count).tolist())
        field.size = (self.axis[-1], self.axis[-1], high - low, 0.1)
        body = spec.worldbody.add_body(name=FIELD, mocap=True, pos=(0.0, 0.0, low))
        geom = body.add_geom(name=FIELD, type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=FIELD, group=_HIDDEN)
        for property_ in ("contype", "conaffinity", "friction", "solref", "solimp"):
            setattr(geom, property_, getattr(like, property_))

    def lay(self, model: mujoco.MjModel, frame: Frame) -> Float[np.ndarray, " 3"]:
        """Write the ground of a frame into the model's field. **Returns:** where its body must be (`mocap_pos`)."""
        low, high = self.bounds
        field = model.hfield(FIELD)
        field.data[...] = np.clip((self.heights(frame) - low) / (high - low), 0.0, 1.0)
        return frame.foot(self.surface.ellipsoid) * (1.0, 1.0, 0.0) + (0.0, 0.0, low)


def _rise(start: Float[np.ndarray, "n 3"], way: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " n"]:
    """How far from each start along the way the unit sphere is left; where it is missed, how far to the nearest."""
    a, b, c = way @ way, start @ way, np.sum(start * start, axis=1) - 1.0
    return (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / a
