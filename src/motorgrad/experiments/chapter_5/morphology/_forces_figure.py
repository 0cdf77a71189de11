"""The figure of hexapods with muscles of several strengths."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments._claim import mean_of
from motorgrad.experiments._experiment import Values

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROWS = (
    ("speed", "speed along the heading (m/s)"),
    ("duty", "part of the time that\na foot is on the ground"),
    ("airborne", "part of the time\nin the air"),
    ("belly", "part of the time that\nthe belly is on the ground"),
)
TITLES = {"all": "all muscles", "lateral": "the lateral muscles alone"}


def draw_forces(values: Values, usual: Mapping[str, float]) -> "Figure":
    """Speed and contact against the force: of all muscles (left), of the lateral ones alone (right); `usual` is, for
    each, what the level 1 stands for."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 9.8), layout="constrained")
    axes = figure.subplots(len(ROWS), 2, sharex="col", sharey="row")
    levels = values["levels"]
    for column, (way, title) in enumerate(TITLES.items()):
        for row, (name, words) in enumerate(ROWS):
            _against(axes[row, column], levels, values[f"{way} {name}"])
            if not column:
                axes[row, 0].set_ylabel(words)
        axes[0, column].set_title(title)
    lateral, ratio = usual["all"] * levels, usual["lateral"] * levels
    vertical = usual["all"] / usual["lateral"] * levels
    axes[-1, 0].set_xticks(levels, [f"{a:.0f}\n{b:.0f}" for a, b in zip(lateral, vertical, strict=True)])
    axes[-1, 0].set_xlabel("greatest force of lateral (above)\nand of vertical muscles (below), N")
    axes[-1, 1].set_xticks(levels, [f"{one:.2g}" for one in ratio])
    axes[-1, 1].set_xlabel("lateral over vertical force")
    return figure


def _against(axes: "Axes", levels: np.ndarray, found: np.ndarray) -> None:
    """Every seed, and the mean with its interval, against the level."""
    spread = np.exp(np.linspace(-0.12, 0.12, found.shape[1]))
    axes.plot(levels[:, None] * spread, found, "o", color="0.7", markersize=3.5, markeredgewidth=0)
    means = [mean_of(each) for each in found]
    error = np.array([[m.value - m.low, m.high - m.value] for m in means]).T
    axes.errorbar(levels, [m.value for m in means], error, fmt="o-", color="C0", capsize=3, markersize=5)
    axes.axvline(1.0, color="0.85", linewidth=1, zorder=0)
    axes.set_xscale("log")
    axes.xaxis.minorticks_off()
    axes.set_ylim(bottom=min(0.0, float(found.min())))
