"""Drawing for sinks. This module loads matplotlib, so it is imported on first use."""

import io
import itertools
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from motorgrad._labels import literal

# Okabe and Ito's colours, which colour-blind people can tell apart; their yellow is too pale for lines on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
LOOK: Any = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False}
MAX_LINE_POINTS = 4000  # longer lines are drawn by the minimum and maximum of each stretch
MAX_LEGEND_NAMES = 12


class Picture(Figure):
    """A matplotlib figure that displays itself in a notebook."""

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        with matplotlib.rc_context(LOOK):
            self.savefig(content, format="png", dpi=110)
        return content.getvalue()


def picture(width: float = 6.5, height: float = 3.0, rows: int = 1) -> tuple[Picture, Any]:
    """An empty figure of this size in inches, and its axes; for several `rows`, an array of them with one x axis."""
    with matplotlib.rc_context(LOOK):
        figure = Picture(figsize=(width, height), layout="constrained")
        return figure, figure.subplots(rows, sharex=rows > 1)


def draw_series(
    axes: Axes, times: Float[np.ndarray, " samples"], values: Float[np.ndarray, "seeds samples"], place: int, name: str
) -> None:
    """Draw a signal over time: a line for one seed; for several seeds the median and a band between the quartiles."""
    colour = COLOURS[place % len(COLOURS)]
    style = ("solid", "dashed", "dotted", "dashdot")[place // len(COLOURS) % 4]
    low, middle, high = np.quantile(values, (0.25, 0.5, 0.75), axis=0) if len(values) > 1 else [values[0]] * 3
    if len(values) > 1:
        at, least = thinned(times, low)
        _, most = thinned(times, high)
        axes.fill_between(at, least, most, color=colour, alpha=0.2, linewidth=0)
    axes.plot(*thinned(times, middle), color=colour, linestyle=style, linewidth=1.2, label=literal(name))


def thinned(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A line of at most `MAX_LINE_POINTS` points that looks the same: the minimum and maximum of every stretch, in
    order.
    """
    if len(times) <= MAX_LINE_POINTS:
        return times, values
    edges = np.linspace(0, len(times), MAX_LINE_POINTS // 2 + 1).astype(int)
    kept = []
    for start, stop in itertools.pairwise(edges):
        part = values[start:stop]
        kept += sorted({start + int(np.argmin(part)), start + int(np.argmax(part))})
    return times[kept], values[kept]


def finish(axes: Axes, x: str, y: str, seeds: int, names: Sequence[str]) -> None:
    """Set labels, and a legend where there are several names."""
    axes.set(xlabel=literal(x), ylabel=literal(names[0] if not y and len(names) == 1 else y))
    if seeds > 1:
        axes.set_title(f"median and quartiles of {seeds} seeds", loc="left", fontsize=8, color="0.35")
    if 1 < len(names) <= MAX_LEGEND_NAMES:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
