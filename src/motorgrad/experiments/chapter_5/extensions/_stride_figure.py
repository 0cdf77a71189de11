"""The figure of stride periods over slopes."""

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_6.growing._growing_figure import draw_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOOKS = {"slope": ("C0", "learnt, follows the pitch"), "constant": ("C1", "learnt, one number")}


def draw_stride(values: Values) -> "Figure":
    """Learning curves; speed and period over the slope; and speed over fixed periods."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 7), layout="constrained")
    panels: Any = figure.subplots(2, 2)
    _learning(panels[0, 0], values)
    _speeds(panels[0, 1], values)
    _grid(panels[1, 0], values)
    _periods(panels[1, 1], values)
    return figure


def _learning(axes: "Axes", values: Values) -> None:
    records = max(1, len(values["time"]) // 20)
    for kind, (colour, label) in LOOKS.items():
        draw_band(axes, values["time"], values[f"{kind} curve"], colour, label, records)
    axes.set(xlabel="simulated s of practice", ylabel="speed while exploring, m/s", ylim=(0, None))
    axes.legend(loc="lower right", fontsize=8.5)


def _speeds(axes: "Axes", values: Values) -> None:
    slopes, fixed, grid = values["slopes"], values["fixed speed"].mean(1), values["grid"]
    best = fixed[:-1].mean(1).argmax()
    axes.plot(slopes, fixed[:-1].max(0), color="0.75", linewidth=5, label="best fixed period of each slope")
    axes.plot(slopes, fixed[best], "--", color="0.2", label=f"best fixed period of all, {grid[best]:g} s")
    axes.plot(slopes, fixed[-1], ":", color="0.2", label=f"period it began with, {grid[-1]:g} s")
    for kind, (colour, label) in LOOKS.items():
        _quartiles(axes, slopes, values[f"{kind} speed"], colour, label)
    axes.set(xlabel="slope, degrees (positive uphill)", ylabel="speed, m/s", xticks=slopes)
    axes.set_ylim(0, 1.35 * axes.get_ylim()[1])
    axes.legend(loc="upper right", fontsize=8.5)


def _grid(axes: "Axes", values: Values) -> None:
    grid, slopes, speed = values["grid"][:-1], values["slopes"], values["fixed speed"][:-1].mean(1)
    for index, slope in enumerate(slopes):
        shade = 0.15 + 0.7 * index / max(1, len(slopes) - 1)
        colour = (shade, 0.3, 1.0 - shade)
        axes.plot(grid, speed[:, index], "o-", color=colour, markersize=3, label=f"{slope:+g}°")
    axes.set(xlabel="fixed period of a stride, s", ylabel="speed, m/s")
    axes.legend(title="slope", fontsize=8.5)


def _periods(axes: "Axes", values: Values) -> None:
    slopes, speed = values["slopes"], values["fixed speed"][:-1].mean(1)
    axes.plot(slopes, values["grid"][speed.argmax(0)], "s", color="0.5", label="best fixed period of each slope")
    for kind, (colour, label) in LOOKS.items():
        _quartiles(axes, slopes, values[f"{kind} period"], colour, label)
    axes.set(xlabel="slope, degrees (positive uphill)", ylabel="period of a stride, s", ylim=(0, None), xticks=slopes)
    axes.legend(loc="lower left", fontsize=8.5)


def _quartiles(axes: "Axes", x: np.ndarray, values: np.ndarray, colour: str, label: str) -> None:
    """Median over seeds, with quartiles as bars."""
    low, middle, high = np.percentile(values, [25, 50, 75], axis=0)
    axes.errorbar(
        x, middle, [middle - low, high - middle], color=colour, capsize=3, marker="o", markersize=4, label=label
    )
