"""The figure of learning curves. It loads matplotlib, so it is itself loaded when first used."""

import io
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from motorgrad._errors import counted
from motorgrad._files import write_atomically
from motorgrad._labels import literal, with_unit
from motorgrad.training.plots._plot_curves import UNITS, Axis, Curve, is_total

# Okabe and Ito's colours, which colour-blind people can tell apart; their yellow is too pale for lines on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
STYLES = ("solid", "dashed", "dotted", "dashdot")  # one more for every round of the colours
FEW_RUNS = 3  # with more, single seeds hide the medians
FEW_SEEDS = 64  # with more, a line for each is a blur
# inches, inches a panel, dots per inch: the text width of a paper
WIDTH = 6.5
HEIGHT = 2.6
DPI = 300
# characters in a row
LEGEND = 80
STATEMENT = 100

T = TypeVar("T")
LOOK: Any = {
    "font.size": 9,
    "axes.titlesize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "motorgrad",  # the same names for the same parts every time
    "pdf.fonttype": 42,
}
DATELESS: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}

X_LABELS = {
    "decisions": "decisions",
    "simulated": "simulated time (s)",
    "wall": "wall time (s)",
    "cpu": "processor time (s)",
}
Y_LABELS = {
    "reward": "mean reward\nper decision",
    "apex": "height of the foot\nat a hop's apex",
    "speed": "speed along\nthe heading",
    "net": "net displacement\nover 20 s",
    "stalls": "part of the seconds\nbelow 0.3 m/s",
    "episodes": "episodes ended\nper record",
    "simulated_time": "simulated time (s)",
    "wall_time": "wall time (s)",
    "cpu_time": "processor time (s)",
}


class LearningCurves(Figure):
    """A matplotlib figure that displays itself in a notebook, and knows its numbers: `curves`, a `Curve` for each
    quantity and run; `axis`, what x is; and `saved`, the file, if there is one."""

    curves: list[Curve]
    axis: Axis
    saved: Path | None = None

    def _repr_png_(self) -> bytes:
        return _drawn(self, "png", dpi=110)


def draw(panels: Sequence[Sequence[Curve]], axis: Axis, smooth: float | None) -> LearningCurves:
    """A panel for each quantity, a colour for each run."""
    with matplotlib.rc_context(LOOK):
        figure = LearningCurves(figsize=(WIDTH, HEIGHT * len(panels) + 0.9), layout="constrained")
        figure.curves = [curve for panel in panels for curve in panel]
        figure.axis = axis
        all_axes: list[Axes] = list(figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0])
        for axes, panel in zip(all_axes, panels, strict=True):
            for place, curve in enumerate(panel):
                style = STYLES[place // len(COLOURS) % len(STYLES)]
                _draw_curve(axes, curve, COLOURS[place % len(COLOURS)], style, len(panel) <= FEW_RUNS)
            axes.margins(x=0.01)
            quantity = panel[0].quantity
            words = quantity.replace("_", " ")
            words = Y_LABELS.get(quantity, f"{words}\nper record" if is_total(quantity) else words)
            units = {curve.unit for curve in panel}
            axes.set_ylabel(literal(with_unit(words, units.pop() if len(units) == 1 else "")))
            if not any(curve.seen.any() for curve in panel):
                axes.set_yticks([])
                axes.text(0.5, 0.5, "never occurred", transform=axes.transAxes, ha="center", color="0.4")
        bottom = all_axes[-1]
        bottom.set_xlabel(X_LABELS[axis])
        bottom.set_xlim(left=0)
        bottom.xaxis.set_major_locator(MaxNLocator(6))
        bottom.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
        all_axes[0].set_title(_statement(panels[0], axis, smooth), color="0.35", loc="left")
        _legend(figure, all_axes, panels)
    return figure


def save(figure: LearningCurves, path: Path, kind: str) -> None:
    """Write the figure, the same bytes for the same numbers."""
    content = _drawn(figure, kind, DPI)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, content)
    figure.saved = path


def _drawn(figure: Figure, kind: str, dpi: int) -> bytes:
    content = io.BytesIO()
    with matplotlib.rc_context(LOOK):
        figure.savefig(content, format=kind, dpi=dpi, metadata=DATELESS[kind])
    return content.getvalue()


def _draw_curve(axes: Axes, curve: Curve, colour: str, style: str, few: bool) -> None:
    low, median, high = curve.quartiles
    seeds = len(curve.values)
    if seeds > 1:
        if few and seeds <= FEW_SEEDS:
            axes.plot(curve.x, curve.values.T, color=colour, alpha=max(0.12, min(0.45, 3 / seeds)), linewidth=0.5)
        axes.fill_between(curve.x, low, high, color=colour, alpha=0.22, linewidth=0)
    axes.plot(curve.x, median, color=colour, linestyle=style, linewidth=1.6, label=literal(curve.label))
    # A record between two without a value, or the only one, is no line.
    gap = np.isnan(np.pad(median, 1, constant_values=np.nan))
    alone = ~gap[1:-1] & gap[:-2] & gap[2:]
    axes.vlines(curve.x[alone], low[alone], high[alone], color=colour, alpha=0.4, linewidth=2)
    axes.plot(curve.x[alone], median[alone], "o", color=colour, markersize=3)


def _statement(curves: Sequence[Curve], axis: Axis, smooth: float | None) -> str:
    """What a point, a line and a band are."""
    seeds = _common(len(c.values) for c in curves)
    windows = _common(c.window for c in curves)
    text = "one seed" if seeds == 1 else f"median and quartiles over {f'{seeds} ' if seeds else ''}seeds"
    text += f"; records of {counted(windows, 'decision')}" if windows else "; records as in the legend"
    text += f"; trailing mean over {smooth:,.10g} {UNITS[axis]}" if smooth else "; not smoothed further"
    return textwrap.fill(text, STATEMENT)


def _legend(figure: Figure, all_axes: Sequence[Axes], panels: Sequence[Sequence[Curve]]) -> None:
    handles, _ = all_axes[0].get_legend_handles_labels()
    first = panels[0]
    labels = []
    for place, curve in enumerate(first):
        notes = []
        if _common(len(c.values) for c in first) is None:
            notes.append(counted(len(curve.values), "seed"))
        if _common(c.window for c in first) is None:
            notes.append(f"records of {counted(curve.window, 'decision')}")
        if curve.done < 1:
            notes.append(f"unfinished, {int(100 * curve.done)} %")
        if curve.broken:
            notes.append(f"{curve.broken} of {counted(len(curve.values), 'seed')} not finite, and left out")
        never = [panel[place].quantity for panel in panels if not panel[place].seen.any()]
        notes += [f"{quantity.replace('_', ' ')} never occurred" for quantity in never if len(first) > 1]
        labels.append(literal(curve.label + (f" ({'; '.join(notes)})" if notes else "")))
    columns = max(1, min(len(labels), LEGEND // (max(map(len, labels)) + 6)))
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False)


def _common(values: Iterable[T]) -> T | None:
    """The value that all have, or `None`."""
    different = set(values)
    return different.pop() if len(different) == 1 else None
