"""An upright board, one metre at its longer side, on which the plane of a particle is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from motorgrad.worlds import Walls

LIFT = 0.05  # m, from the floor to its lower side
PIXELS = 640
FACING = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
"""The turn that lays what is flat, seen along z, onto the board: its y becomes the world's z."""


class Board:
    """Takes places in a plane to places in the world: x to the right, y upwards; the viewer stands at negative y.

    **Arguments:** `walls`, of the box that the board shows.

    **Attributes:** `scale`, metres for a unit of the plane; `half`, `(2,)` m, half its sides.
    """

    def __init__(self, walls: Walls) -> None:
        (left, right), (bottom, top) = walls.spans
        self.scale = 1.0 / max(right - left, top - bottom)
        self._middle, self._bottom = (left + right) / 2, bottom
        self.half = np.array([right - left, top - bottom]) * self.scale / 2

    def place(self, points: np.ndarray, before: float = 0.0) -> np.ndarray:
        """Places `(n, 3)` of points `(n, 2)`, so many metres before the board."""
        points = np.asarray(points, float).reshape(-1, 2)
        across = (points[:, 0] - self._middle) * self.scale
        return np.stack([across, np.full(len(points), -before), (points[:, 1] - self._bottom) * self.scale + LIFT], 1)

    def direction(self, ways: np.ndarray) -> np.ndarray:
        """Directions `(n, 3)` of directions `(n, 2)`, as long."""
        ways = np.asarray(ways, float).reshape(-1, 2)
        return np.stack([ways[:, 0], np.zeros(len(ways)), ways[:, 1]], axis=1)

    def glb(self, task: Any) -> bytes:
        """The board with the task's reward painted on it, in its own coordinates: flat, seen along z."""
        import trimesh

        from motorgrad.sim.scene._glb import textured

        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * self.half
        mesh = trimesh.Trimesh(np.c_[corners, np.zeros(4)], [(0, 1, 2), (0, 2, 3)], process=False)
        return textured(mesh, (corners / self.half + 1) / 2, self._picture(task), glows=True)

    def _picture(self, task: Any) -> np.ndarray:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        from motorgrad.sim._plane import draw_reward

        sides = 2 * self.half / self.half.max() / 2
        figure = Figure(figsize=tuple(PIXELS * sides / 100), dpi=100, facecolor="white")
        canvas = FigureCanvasAgg(figure)
        draw_reward(figure.add_axes((0.0, 0.0, 1.0, 1.0)), task)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3] / 255
