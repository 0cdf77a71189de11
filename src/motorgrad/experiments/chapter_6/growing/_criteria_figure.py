"""The figure of criteria for adding units."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._claim import mean_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_6.growing._growing_figure import draw_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST = 5  # seeds, for a mean over those that had so many units


def draw_ways(values: Values, layouts: Sequence[str], words: Mapping[str, str], interval: int) -> "Figure":
    """For each layout: reward over decisions, units over decisions, and reward against units."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    figure = Figure(figsize=(10, 6.6), layout="constrained")
    axes: Any = figure.subplots(len(layouts), 3, squeeze=False, sharey="col")
    thousands = values["decision"] / 1e3
    span = max(1, round(interval / values["decision"][0]))
    for row, layout in zip(axes, layouts, strict=True):
        for number, way in enumerate(words):
            reward, units = values[f"{layout} {way} reward"], values[f"{layout} {way} units"]
            draw_band(row[0], thousands, reward, f"C{number}", words[way], span)
            draw_band(row[1], thousands, units, f"C{number}", words[way])
            _by_units(row[2], reward, units, f"C{number}", least=round(0.8 * span))
        row[0].set_ylabel(f"{layout}: reward, last {interval:,} decisions")
        row[1].set(ylabel="units", ylim=(0, None))
        row[2].set(ylabel="reward")
    axes[0, 1].set_title("units over time", fontsize=10)
    axes[0, 2].set_title("reward at the end of so many units", fontsize=10)
    for each in axes[:, 1]:
        each.yaxis.set_major_locator(MaxNLocator(integer=True))
    for each, label in zip(axes[-1], ("thousand decisions", "thousand decisions", "units"), strict=True):
        each.set_xlabel(label)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=8.5)
    return figure


def _by_units(axes: "Axes", reward: np.ndarray, units: np.ndarray, colour: str, least: int) -> None:
    """The reward at the end of the time with so many units, mean and interval over the seeds that had so many for at
    least so many records: longer than the newest took to shrink."""
    count, found = [], []
    for number in range(1, int(units.max()) + 1):
        there = (units == number).sum(1) >= least
        if there.sum() < LEAST:
            continue
        last = [
            row[np.flatnonzero(had == number)[-2:]].mean() for row, had in zip(reward[there], units[there], strict=True)
        ]
        count.append(number)
        found.append(mean_of(last))
    if count:
        error = [[each.value - each.low for each in found], [each.high - each.value for each in found]]
        axes.errorbar(count, [each.value for each in found], error, fmt="o-", markersize=3, color=colour, linewidth=1)
