"""A joint drawn in its plane: two bones, the capsule, and a muscle's path as the library computes it."""

from typing import TYPE_CHECKING

import numpy as np

from motorgrad.bodies import path_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BONE, BONE_EDGE = "#e6dfcf", "#8c8372"


def bend(interior: float, upper: float, lower: float) -> tuple[np.ndarray, np.ndarray]:
    """Ends of two bones from a joint at the origin, opening to the right: `(2,)` each.

    **Arguments:** the angle between them in rad; their lengths.
    """
    half = interior / 2
    turned = np.array([np.cos(half), np.sin(half)])
    return upper * turned, lower * turned * (1, -1)


def flat_path(origin: np.ndarray, insertion: np.ndarray, radius: float, side: np.ndarray, arc: int = 60) -> np.ndarray:
    """`path_points` about the origin of a plane: two points where it is straight, else `arc + 2`, `(points, 2)`."""
    lifted = [np.array([x, 0.0, y]) for x, y in (origin, insertion, side)]
    return path_points(lifted[0], lifted[1], np.zeros(3), radius, lifted[2], arc)[:, [0, 2]]


def draw_bones(axes: "Axes", ends: tuple[np.ndarray, ...], radius: float, width: float = 9.0) -> None:
    """Bones from the joint at the origin to their ends, and the capsule around it; `width` in points."""
    from matplotlib.patches import Circle

    for rim, colour in ((1.5, BONE_EDGE), (0.0, BONE)):
        for end in ends:
            axes.plot(*zip((0, 0), end, strict=True), color=colour, linewidth=width + rim, solid_capstyle="round")
    axes.add_patch(Circle((0, 0), radius, facecolor="#f4f6fb", edgecolor="0.55", linewidth=1, zorder=2.5))
    axes.plot(0, 0, "o", color="0.35", markersize=3.5, zorder=2.6)


def draw_path(axes: "Axes", path: np.ndarray, colour: str) -> None:
    """A muscle along its path, with its two attachments."""
    axes.plot(*path.T, color=colour, linewidth=3, solid_capstyle="round", zorder=3)
    axes.plot(*path[[0, -1]].T, "o", color="white", markeredgecolor=colour, markersize=6, markeredgewidth=1.8, zorder=4)
