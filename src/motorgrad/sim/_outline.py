"""The outline of a geom, seen from afar: a convex polygon."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco

POINTS = 40


def outline(model: mujoco.MjModel, data: mujoco.MjData, geom: int, screen: np.ndarray) -> np.ndarray:
    """The silhouette of a sphere, capsule, ellipsoid, cylinder, box or (convex hull of a) mesh.

    **Arguments:** `screen`: `(2, 3)`, the picture's right and up as unit vectors of the world.

    **Returns:** `(POINTS, 2)`, metres. In each of as many directions of the picture it is the shape's farthest point
    that way (its support point), which needs no case for how a shape is turned.
    """
    turn = data.geom_xmat[geom].reshape(3, 3)
    # a small turn off the axes: boxes that stand straight then have one farthest corner, not an edge of them
    angles = 2 * np.pi * np.arange(POINTS) / POINTS + 1e-3
    ways = np.stack([np.cos(angles), np.sin(angles)], 1) @ screen @ turn  # (POINTS, 3), in the geom's own axes
    points = _support(model, geom, ways)
    return (points @ turn.T + data.geom_xpos[geom]) @ screen.T


def _support(model: mujoco.MjModel, geom: int, ways: np.ndarray) -> np.ndarray:
    """The farthest point of the geom, in its own axes, in each direction: `(n, 3)` of `(n, 3)`."""
    import mujoco

    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return size[0] * ways / _length(ways)
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return size**2 * ways / _length(size * ways)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return size[0] * ways / _length(ways) + np.outer(np.sign(ways[:, 2]), [0, 0, size[1]])
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        round_ = ways * [1, 1, 0]
        return size[0] * round_ / _length(round_) + np.outer(np.sign(ways[:, 2]), [0, 0, size[1]])
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        corners = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        return corners[np.argmax(ways @ corners.T, 1)]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return np.sign(ways) * size
    middle, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    return middle + np.sign(ways) * half  # a signed distance field: its box


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
