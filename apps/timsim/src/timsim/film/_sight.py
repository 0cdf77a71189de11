"""Projections of the world onto a picture: orthographic, or as a camera sees it."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from timsim.film._viewpoint import Viewpoint

NEAREST = 0.02  # share of the camera's distance to its target; what is nearer, or behind it, is not drawn


class Sight(Protocol):
    """A way to project the world."""

    @property
    def axes(self) -> np.ndarray:
        """Rows: the picture's right, its up, and towards the viewer; `(3, 3)`."""
        ...

    def flat(self, points: np.ndarray) -> np.ndarray:
        """Places `(n, 2)` in the picture, in m, of points `(n, 3)`."""
        ...

    def screen(self, point: np.ndarray) -> np.ndarray:
        """Right and up, as rows `(2, 3)`, across the line of sight to a point `(3,)`."""
        ...

    def depth(self, points: np.ndarray) -> np.ndarray:
        """How far points `(n, 3)` are, `(n,)`, up to a constant; NaN where they cannot be seen."""
        ...


class Parallel:
    """An orthographic projection along `axes` `(3, 3)`: metres to the right and up."""

    def __init__(self, axes: np.ndarray) -> None:
        self.axes = axes

    def flat(self, points: np.ndarray) -> np.ndarray:
        return points @ self.axes[:2].T

    def screen(self, point: np.ndarray) -> np.ndarray:
        del point
        return self.axes[:2]

    def depth(self, points: np.ndarray) -> np.ndarray:
        return -points @ self.axes[2]


class Perspective:
    """What a camera sees, in metres at its target's distance from the middle of the picture."""

    def __init__(self, viewpoint: Viewpoint) -> None:
        self.axes, self._distance = viewpoint.axes, viewpoint.distance
        self._place = np.array(viewpoint.position)

    def flat(self, points: np.ndarray) -> np.ndarray:
        across = (points - self._place) @ self.axes[:2].T
        depth = np.maximum(-(points - self._place) @ self.axes[2], NEAREST * self._distance)
        return across * (self._distance / depth)[:, None]

    def screen(self, point: np.ndarray) -> np.ndarray:
        near = self._place - point
        near = near / max(float(np.linalg.norm(near)), 1e-9)
        right = np.cross(self.axes[1], near)
        right = right / max(float(np.linalg.norm(right)), 1e-9)
        return np.stack([right, np.cross(near, right)])

    def depth(self, points: np.ndarray) -> np.ndarray:
        depth = -(points - self._place) @ self.axes[2]
        return np.where(depth > NEAREST * self._distance, depth, np.nan)
