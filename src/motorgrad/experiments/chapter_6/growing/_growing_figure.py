"""The figure of the reward of policies that grow."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._claim import mean_of
from motorgrad.experiments._curves import moving_mean
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_6.growing._growing_study import INTERVAL

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AVERAGES = (50, 500)  # episodes


def draw_growth(values: Values, units: int, independent: Mapping[int, float], within: float) -> "Figure":
    """One seed's moving averages as in the thesis; all seeds; and the reward after each unit."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.4, 6.6), layout="constrained")
    panels: Any = figure.subplot_mosaic([["one", "one"], ["all", "after"]], width_ratios=[1.25, 1])
    _one_seed(panels["one"], values, units)
    _all_seeds(panels["all"], values, units)
    _after(panels["after"], values, units, independent, within)
    return figure


def draw_band(
    axes: "Axes", x: np.ndarray, values: np.ndarray, colour: str, label: str, records: int = 1, line: str = "-"
) -> None:
    """Median and quartiles over seeds of a curve, `(seeds, records)`; each point is the mean of so many records."""
    low, median, high = np.percentile(moving_mean(values, records), [25, 50, 75], axis=0)
    axes.fill_between(x[records - 1 :], low, high, color=colour, alpha=0.18, linewidth=0)
    axes.plot(x[records - 1 :], median, line, color=colour, label=label)


def _one_seed(axes: "Axes", values: Values, units: int) -> None:
    row = int(values["row"])
    episode, reward = values["episode"][row], values["grown reward"][row]
    each = episode[-1] / len(episode)
    for wanted, colour, width in zip(AVERAGES, ("0.6", "C3"), (0.8, 1.8), strict=True):
        records = max(1, round(wanted / each))
        label = f"last {records * each:.0f} episodes"
        axes.plot(episode[records - 1 :], moving_mean(reward, records), color=colour, linewidth=width, label=label)
    _additions(axes, values["decision"], episode, units)
    axes.set(
        xlabel="episodes",
        ylabel="reward per decision",
        xlim=(0, episode[-1]),
        title=f"seed {row}; lines: a unit is added",
    )
    axes.legend(loc="lower right", ncols=2, fontsize=8)


def _all_seeds(axes: "Axes", values: Values, units: int) -> None:
    thousands = values["decision"] / 1e3
    for name, colour, label in (
        ("static", "C2", "eight units from the start"),
        ("static like grown", "C1", "the same, height and rates as grown"),
        ("grown", "C0", "grown"),
    ):
        draw_band(axes, thousands, values[f"{name} reward"], colour, label)
    _additions(axes, values["decision"], thousands, units)
    axes.set(xlabel="thousand decisions", ylabel="reward per decision", title="all seeds, median and quartiles")
    axes.legend(loc="lower right", fontsize=8)


def _after(axes: "Axes", values: Values, units: int, independent: Mapping[int, float], within: float) -> None:
    count = np.arange(1, units + 1)
    for name, colour, label in (("right first", "C4", "first to the right"), ("grown", "C0", "first to the left")):
        found = [mean_of(column) for column in values[f"{name} after"].T]
        error = [[each.value - each.low for each in found], [each.high - each.value for each in found]]
        axes.errorbar(count, [each.value for each in found], error, fmt="o-", markersize=3, color=colour, label=label)
    if independent:
        axes.errorbar(
            list(independent), list(independent.values()), within, fmt="s", color="0.2", markersize=5, capsize=3,
            label=f"an independent model, ± {within:g}", zorder=5, linewidth=0.8,
        )  # fmt: skip
    axes.set(xlabel="units", ylabel="reward in the learning phase", title="after each unit, mean and interval")
    axes.legend(loc="lower right", fontsize=8)


def _additions(axes: "Axes", decision: np.ndarray, place: np.ndarray, units: int) -> None:
    """A line where each unit but the first was added."""
    for x in np.interp(INTERVAL * np.arange(1, units), decision, place):
        axes.axvline(x, color="0.85", linewidth=0.7, zorder=0)
