"""Whether a body would stand: the polygon between its feet, and where its centre of mass is over it."""

from __future__ import annotations

import numpy as np


def support_polygon(points: np.ndarray, up: np.ndarray) -> np.ndarray:
    """The corners of the smallest convex polygon around points, seen along `up`.

    **Arguments:** `points` `(n, 3)`: where the body rests; `up` `(3,)`: away from gravity.

    **Returns:** rows of `points`, `(corners, 3)`, anticlockwise as seen from above; of points in a line the two ends,
    of no point none.
    """
    from scipy.spatial import ConvexHull, QhullError

    points = np.asarray(points, float).reshape(-1, 3)
    flat = points @ level_axes(up).T
    if len(points) > 2:
        try:
            return points[ConvexHull(flat).vertices]
        except QhullError:  # all in a line
            pass
    if len(points) < 2:
        return points
    along = flat[np.argmax(np.linalg.norm(flat - flat[0], axis=1))] - flat[0]
    place = flat @ along
    return points[[np.argmin(place), np.argmax(place)]] if np.ptp(place) > 0 else points[:1]


def margin(polygon: np.ndarray, point: np.ndarray, up: np.ndarray) -> float:
    """How far, in m, the point `(3,)` is inside the polygon `(corners, 3)`, seen along `up`; negative outside.

    The stability margin of legged locomotion (McGhee and Frank, 1968). It is -infinity without a polygon.
    """
    if not len(polygon):
        return -np.inf
    axes = level_axes(up)
    corners, place = polygon @ axes.T, axes @ point
    if len(corners) == 1:
        return -float(np.linalg.norm(place - corners[0]))
    edges = np.roll(corners, -1, axis=0) - corners
    from_corner = place - corners
    length = np.maximum(np.sum(edges**2, 1), 1e-18)
    near = corners + np.clip(np.sum(from_corner * edges, 1) / length, 0, 1)[:, None] * edges
    distance = float(np.linalg.norm(place - near, axis=1).min())
    inside = len(corners) > 2 and np.all(edges[:, 0] * from_corner[:, 1] - edges[:, 1] * from_corner[:, 0] >= 0)
    return distance if inside else -distance


def level_axes(up: np.ndarray) -> np.ndarray:
    """Two axes square to `up`, as rows `(2, 3)`, that make a right-handed system with it."""
    up = np.asarray(up, float) / np.linalg.norm(up)
    first = np.cross(np.eye(3)[np.argmin(np.abs(up))], up)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)])
