"""Diagrams of finite MDPs, drawn from their transitions."""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from tools.figures._style import arrow

Point = tuple[float, float]
RADIUS = 0.2


def states(axes: Axes, places: Sequence[Point], names: Sequence[str], rewards: Iterable[float]) -> None:
    """The states as circles, the rewarded ones shaded."""
    for place, name, reward in zip(places, names, rewards, strict=True):
        axes.add_patch(Circle(place, RADIUS, facecolor="#009E7333" if reward else "white", edgecolor="0.3", zorder=3))
        words = f"{name}\n$r$ = {reward:g}" if reward else name
        axes.text(*place, words, ha="center", va="center", fontsize=8, zorder=4)


def moves(
    axes: Axes, places: Sequence[Point], matrix: np.ndarray, colour: str, bend: float, label: bool = True
) -> None:
    """An arrow for every transition of one action, as wide as it is probable; staying is a loop below the state."""
    for before, after in zip(*np.nonzero(matrix), strict=True):
        chance = float(matrix[before, after])
        start = places[before]
        end = places[after]
        if before == after:
            foot = [(start[0] + side * 0.12, start[1] - RADIUS + 0.04) for side in (-1, 1)]
            arrow(axes, foot[0], foot[1], colour, 1.6, linewidth=0.5 + 1.3 * chance)
            if label:
                axes.text(start[0] + 0.24, start[1] - RADIUS - 0.12, f"{chance:g}", color=colour, fontsize=8)
            continue
        out = _rim(start, end, bend)
        back = _rim(end, start, -bend)
        arrow(axes, out, back, colour, bend, linewidth=0.5 + 1.3 * chance)
        if label:
            across = np.array([end[1] - start[1], start[0] - end[0]])
            away = 0.5 * bend + 0.11 / np.linalg.norm(across)  # the top of the arc, and a little beyond
            middle = (np.array(start) + end) / 2 + away * across
            axes.text(middle[0], middle[1], f"{chance:g}", ha="center", va="center", color=colour, fontsize=8)


def frame(axes: Axes, places: Sequence[Point], margin: float = 0.45) -> None:
    """Room for everything, and no axes."""
    x, y = np.array(places).T
    axes.set(xlim=(x.min() - margin, x.max() + margin), ylim=(y.min() - margin, y.max() + margin), aspect="equal")
    axes.set_axis_off()


def _rim(centre: Point, other: Point, bend: float) -> Point:
    """Where an arrow bent by `bend` leaves a circle on its way to another."""
    angle = math.atan2(other[1] - centre[1], other[0] - centre[0]) - math.atan(2 * bend)
    return centre[0] + (RADIUS + 0.02) * math.cos(angle), centre[1] + (RADIUS + 0.02) * math.sin(angle)
