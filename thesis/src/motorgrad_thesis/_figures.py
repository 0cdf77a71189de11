"""Drawing shared by experiments: the style, empty figures, bands, intervals, diagrams, and a joint with its muscles.

Importing this file does not import matplotlib: `motorgrad list` and the command line's help must stay quick.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.bodies import path_points
from motorgrad.statistics import Measured, moving_mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
else:
    Axes = Figure = SubFigure = Any

FLEXOR = "#3b6fb6"
EXTENSOR = "#c8452f"
"""Colours of the two kinds of muscle."""
BONE = "#e6dfcf"
BONE_EDGE = "#8c8372"
STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "svg.fonttype": "path",  # formulas look the same where fonts are missing
    "svg.hashsalt": "motorgrad",  # the same figure gives the same bytes
    "figure.dpi": 100,
}
Point = tuple[float, float]


def new_figure(width: float, height: float, dpi: int | None = None) -> Figure:
    """An empty figure of this size in inches with a constrained layout."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=dpi, layout="constrained")


def subplots(width: float, height: float, rows: int = 1, columns: int = 1, **grid: Any) -> tuple[Figure, Any]:
    """Such a figure with its axes, one or an array of them; `grid` as in matplotlib's `subplots`."""
    figure = new_figure(width, height)
    return figure, figure.subplots(rows, columns, **grid)


def draw_band(
    axes: Axes,
    x: np.ndarray,
    values: np.ndarray,
    colour: Any,
    label: str | None = None,
    *,
    records: int = 1,
    mean: bool = False,
    **style: Any,
) -> None:
    """Median and quartiles over seeds of the curves `values`, `(seeds, records)`.

    **Arguments:** `records`, the length of the moving average; `mean`, whether to draw the mean instead of the
    median; `style`, of the line.
    """
    smooth = moving_mean(values, records)
    x = x[records - 1 :]
    low, middle, high = np.percentile(smooth, [25, 50, 75], axis=0)
    axes.fill_between(x, low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(x, smooth.mean(0) if mean else middle, color=colour, label=label, **style)


def draw_intervals(axes: Axes, x: Any, measured: Sequence[Measured], across: bool = False, **style: Any) -> None:
    """Measured numbers at `x` with their intervals as error bars; `across` puts the numbers on the horizontal axis."""
    values = [each.value for each in measured]
    errors = np.reshape([[each.value - each.low, each.high - each.value] for each in measured], (-1, 2)).T
    errors = np.maximum(errors, 0.0)  # rounding may put the end of an interval just beyond the value
    if across:
        axes.errorbar(values, x, xerr=errors, **style)
    else:
        axes.errorbar(x, values, errors, **style)


def draw_arrow(
    axes: Axes,
    start: Point,
    end: Point,
    colour: str,
    head: bool = True,
    size: float = 11,
    width: float = 1.2,
    gap: float = 0.0,
) -> None:
    """An arrow of a diagram.

    **Arguments:** `head`, whether it has one; `size` of the head, `width` of the line, `gap` at both ends, in points.
    """
    from matplotlib.patches import FancyArrowPatch

    style: dict[str, Any] = {"mutation_scale": size, "linewidth": width, "shrinkA": gap, "shrinkB": gap, "zorder": 2}
    axes.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>" if head else "-", color=colour, **style))


def bend(interior: float, upper: float, lower: float) -> tuple[np.ndarray, np.ndarray]:
    """The ends `(2,)` of two bones that meet at the origin and open to the right.

    **Arguments:** the angle between them in rad; their lengths.
    """
    half = interior / 2
    turned = np.array([np.cos(half), np.sin(half)])
    return upper * turned, lower * turned * (1, -1)


def flat_path(origin: np.ndarray, insertion: np.ndarray, radius: float, side: np.ndarray, arc: int = 60) -> np.ndarray:
    """`path_points` about the origin of a plane, `(points, 2)`: two points for a straight path, else `arc + 2`."""
    lifted = [np.array([x, 0.0, y]) for x, y in (origin, insertion, side)]
    return path_points(lifted[0], lifted[1], np.zeros(3), radius, lifted[2], arc)[:, [0, 2]]


def draw_bones(axes: Axes, ends: tuple[np.ndarray, ...], radius: float, width: float = 9.0) -> None:
    """Bones from the joint at the origin to their ends, and the joint's capsule; `width` in points."""
    from matplotlib.patches import Circle

    for rim, colour in ((1.5, BONE_EDGE), (0.0, BONE)):
        for end in ends:
            axes.plot(*zip((0, 0), end, strict=True), color=colour, linewidth=width + rim, solid_capstyle="round")
    axes.add_patch(Circle((0, 0), radius, facecolor="#f4f6fb", edgecolor="0.55", linewidth=1, zorder=2.5))
    axes.plot(0, 0, "o", color="0.35", markersize=3.5, zorder=2.6)


def draw_path(axes: Axes, path: np.ndarray, colour: str) -> None:
    """A muscle along its path, with its two attachments."""
    axes.plot(*path.T, color=colour, linewidth=3, solid_capstyle="round", zorder=3)
    axes.plot(*path[[0, -1]].T, "o", color="white", markeredgecolor=colour, markersize=6, markeredgewidth=1.8, zorder=4)
