"""Plots beside the bodies of a film or a replay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad._labels import literal
from timsim.film._appearance import FIRING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MAX_PLOT_LINES = 12  # more cannot be told apart


@dataclass(frozen=True, eq=False)
class Plot:
    """Numbers over time, drawn beside the bodies of a film or a replay.

    **Arguments:**

    - `title`: what is shown, such as "reward".
    - `time`: `(n,)` s on the clock of the motions, increasing.
    - `values`: `(n, lines)` or `(n,)`; NaN leaves a gap. Of more than 12 lines, the 12 that vary most are drawn.
    - `names`: of the lines; may be left out for one line.
    - `unit`: such as "N"; "" for pure numbers.

    **Raises:** `ValueError` where shapes disagree or time does not increase.
    """

    title: str
    time: np.ndarray
    values: np.ndarray
    names: Sequence[str] = field(default=())
    unit: str = ""

    def __post_init__(self) -> None:
        check_arguments(Plot, vars(self))
        time = np.asarray(self.time, float)
        values = np.asarray(self.values, float)
        values = values[:, None] if values.ndim == 1 else values
        names = tuple(self.names) or (self.title,)
        increasing = time.ndim == 1 and time.size > 0 and bool(np.all(np.diff(time) > 0))
        check(increasing, f"time of the plot {self.title!r}", time.shape, "(n,) and increasing, n at least 1")
        allowed = f"({time.size}, {len(names)}): as many rows as times, a column for each name"
        check(values.shape == (time.size, len(names)), f"values.shape of {self.title!r}", values.shape, allowed)
        for name, value in (("time", time), ("values", values), ("names", names)):
            object.__setattr__(self, name, value)


MAX_LINE_POINTS = 2_000  # that are drawn, which are more than a strip has pixels
SHAPE = 0.62  # width of a strip, as a share of its height
MIN_STRIP_WIDTH = 6.0  # in lines of text
INK = "#3b444d"
PRESENT = "#d9730d"
DPI = 100


class PlotStrip:
    """Plots one below the other, as pictures with a line at the present moment.

    **Arguments:** `plots`, at least one; `height` in pixels.

    **Attributes:** `width` in pixels, even.
    """

    def __init__(self, plots: Sequence[Plot], height: int) -> None:
        self._letters = min(9.0, max(5.0, height / 60))
        self._line = 2 * self._letters * DPI / 72  # pixels of a line of text, with room
        self.width = 2 * round(max(SHAPE * height, MIN_STRIP_WIDTH * self._line) / 2)
        self._height = height
        self.show(plots)

    def show(self, plots: Sequence[Plot]) -> None:
        """Draw other plots, with the same width and height."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        size = self.width / DPI, self._height / DPI
        figure = Figure(size, dpi=DPI, facecolor="white")
        axes: Any = figure.subplots(len(plots), 1, squeeze=False)[:, 0]
        letters, line = self._letters, self._line
        figure.subplots_adjust(  # a layout engine would take far longer
            left=2.4 * line / self.width,
            right=1 - 0.6 * line / self.width,
            top=1 - line / self._height,
            bottom=1.8 * line / self._height,
            hspace=0.5,
        )
        for each, plot in zip(axes, plots, strict=True):
            _fill(each, plot, letters)
        axes[-1].set_xlabel("time (s)", fontsize=letters, color=INK)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        self._still = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        self._places = []
        for each in axes:
            box = each.get_window_extent()
            top, bottom = (round(self._height - edge) for edge in (box.y1, box.y0))
            self._places.append((each.get_xlim(), box.x0, box.x1, top, bottom))

    def at(self, time: float) -> np.ndarray:
        """The picture `(height, width, 3)`, uint8, at a time in s on the clock of the plots."""
        picture = self._still.copy()
        for (low, high), left, right, top, bottom in self._places:
            if low <= time <= high:
                across = round(left + (time - low) / (high - low) * (right - left))
                thick = max(1, self._height // 400)
                picture[max(top, 0) : bottom, max(across, 0) : across + thick] = (217, 115, 13)
        return picture


def _fill(axes: Axes, plot: Plot, letters: float) -> None:
    spread = np.nanmax(plot.values, axis=0, initial=-np.inf) - np.nanmin(plot.values, axis=0, initial=np.inf)
    chosen = np.sort(np.argsort(-np.nan_to_num(spread, neginf=0.0), kind="stable")[:MAX_PLOT_LINES])
    step = max(1, -(-len(plot.time) // MAX_LINE_POINTS))
    shown = plot.values[::step, chosen]
    shares = len(chosen) > 1 and not plot.unit and np.nanmin(shown) >= 0 and np.nanmax(shown) <= 1
    if shares and len(plot.time) > 1:  # such as activations, whose lines would hide one another: a row for each
        from matplotlib.colors import LinearSegmentedColormap

        span = (plot.time[0], plot.time[-1], len(chosen) - 0.5, -0.5)
        colours = LinearSegmentedColormap.from_list("muscles", ["white", tuple(FIRING)])
        axes.imshow(shown.T, cmap=colours, vmin=0, vmax=1, extent=span, aspect="auto", interpolation="nearest")
        axes.set_yticks(range(len(chosen)), [literal(str(plot.names[line])[:9]) for line in chosen])
    else:
        axes.plot(plot.time[::step], shown, linewidth=1.0, label=[literal(str(plot.names[line])) for line in chosen])
        axes.locator_params(nbins=4)  # text takes most of the time
        if 1 < len(chosen) <= 4:
            axes.legend(fontsize=letters - 1, frameon=False, loc="upper left", ncols=2, handlelength=1.2)
    unit = f" ({plot.unit})" if plot.unit else ""
    axes.set_title(literal(f"{plot.title}{unit}"), fontsize=letters + 0.5, loc="left", color=INK, pad=3)
    axes.tick_params(labelsize=letters - 0.5, colors=INK, length=2, pad=2)
    axes.margins(x=0)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
