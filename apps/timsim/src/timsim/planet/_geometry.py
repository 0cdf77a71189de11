"""The geometry of a planet: its ellipsoid, and the local frame in which a body moves."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

import dataclasses
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

Points = Float[np.ndarray, "*any 3"]
_STEPS = 60  # limit on Newton's method, which mostly needs five steps


@dataclasses.dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid about the origin, with its axes along x, y and z.

    A point on it is `radii * direction` for a unit `direction`, which on a sphere is also the normal. Level ground is
    the ellipsoid itself; up is its normal.

    **Arguments:** `radii` (3,) in m, along x, y and z.
    """

    radii: tuple[float, float, float]

    @property
    def least(self) -> float:
        """The smallest radius in m."""
        return min(self.radii)

    @property
    def greatest(self) -> float:
        """The largest radius in m."""
        return max(self.radii)

    @property
    def tightest(self) -> float:
        """The smallest radius of curvature in m, at the ends of the longest axis."""
        return self.least**2 / self.greatest

    def points(self, directions: Points) -> Points:
        """The points on the ellipsoid for unit directions."""
        return directions * self.radii

    def normals(self, directions: Points) -> Points:
        """The outward unit normals at the points of unit directions."""
        return unit(directions / self.radii)

    def tangent(self, normals: Points) -> Points:
        """The unit directions of the points with these normals: the inverse of `normals`."""
        return unit(normals * np.asarray(self.radii))

    def foot(self, points: Points) -> Points:
        """The unit directions of the nearest points on the ellipsoid, for points not near its centre.

        The nearest point is `r² x / (r² + t)` for the root t of a decreasing, convex function. Newton's method starts
        where one of its terms alone is 1, from where it approaches the root monotonically.
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
    """Normalise vectors to length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def normal_at(latitude: float, longitude: float) -> Float[np.ndarray, " 3"]:
    """The unit normal at a geographic latitude and longitude in degrees; north is along z."""
    north, east = np.radians((latitude, longitude))
    return np.array([np.cos(north) * np.cos(east), np.cos(north) * np.sin(east), np.sin(north)])


_UP = np.array([0.0, 0.0, 1.0])


class Frame(NamedTuple):
    """Local coordinates relative to the planet's: `local = rotation @ planet + shift`.

    Local z is the ellipsoid's normal at the frame's foot, which is at z = 0. The pose of the planet in local
    coordinates, a position and a quaternion, carries the same information.
    """

    rotation: Float[np.ndarray, "3 3"]
    shift: Float[np.ndarray, " 3"]

    @classmethod
    def of_pose(cls, pose: Float[np.ndarray, " 7"]) -> "Frame":
        """The frame in which the planet has this pose: position and quaternion as in `qpos`."""
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, np.asarray(pose[3:], float))
        return cls(matrix.reshape(3, 3), np.array(pose[:3], float))

    @property
    def pose(self) -> Float[np.ndarray, " 7"]:
        """The planet's pose in this frame."""
        return np.concatenate([self.shift, quaternion(self.rotation)])

    def to_local(self, points: Points) -> Points:
        """Convert points from the planet's coordinates to local ones."""
        return points @ self.rotation.T + self.shift

    def to_planet(self, points: Points) -> Points:
        """Convert points from local coordinates to the planet's."""
        return (points - self.shift) @ self.rotation

    def foot(self, ellipsoid: Ellipsoid) -> Float[np.ndarray, " 3"]:
        """Where the local plane touches the ellipsoid, in local coordinates; its z is 0."""
        return self.to_local(ellipsoid.points(ellipsoid.tangent(self.rotation[2])))

    def up(self, ellipsoid: Ellipsoid, point: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
        """The ellipsoid's normal under a local point, in local coordinates."""
        return self.rotation @ ellipsoid.normals(ellipsoid.foot(self.to_planet(point)))

    def levelled(self, ellipsoid: Ellipsoid, point: Float[np.ndarray, " 3"]) -> "Frame":
        """The frame that is level under a local point and keeps its x and y.

        It is turned by the smallest such rotation, so that a body going straight ahead keeps its heading.
        """
        foot = ellipsoid.foot(self.to_planet(point))
        rotation = least_rotation(self.rotation @ ellipsoid.normals(foot)) @ self.rotation
        # orthogonalise, so that rounding does not accumulate
        left, _, right = np.linalg.svd(rotation)
        rotation = left @ right
        place = np.array([point[0], point[1], 0.0])
        return Frame(rotation, place - rotation @ ellipsoid.points(foot))

    def move_to(self, other: "Frame") -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, " 3"]]:
        """The rotation and the shift from this frame's local coordinates to another's."""
        turn = other.rotation @ self.rotation.T
        return turn, other.shift - turn @ self.shift


def frame_at(ellipsoid: Ellipsoid, latitude: float, longitude: float, heading: float) -> Frame:
    """The frame at a place, with its origin on the ellipsoid.

    **Arguments:** geographic `latitude` and `longitude` in degrees; `heading` of local x in degrees, from north to
    east. At the poles "north" is along the meridian of longitude 0, at the north pole away from it.
    """
    up = normal_at(latitude, longitude)
    axis = np.array([0.0, 0.0, 1.0]) if abs(up[2]) < 1.0 - 1e-9 else np.array([-up[2], 0.0, 0.0])
    north = unit(axis - (axis @ up) * up)
    angle = np.radians(heading)
    ahead = np.cos(angle) * north + np.sin(angle) * np.cross(north, up)
    rotation = np.stack([ahead, np.cross(up, ahead), up])
    return Frame(rotation, -rotation @ ellipsoid.points(ellipsoid.tangent(up)))


def least_rotation(way: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """The rotation by the smallest angle that turns a unit vector, not straight down, upwards."""
    x, y, z = np.cross(way, _UP)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + way[2])


def quaternion(rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, " 4"]:
    """The quaternion of a rotation, w first."""
    found = np.empty(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(rotation).ravel())
    return found
