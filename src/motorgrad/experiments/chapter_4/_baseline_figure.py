"""The figure of the experiment with baselines that forget."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from motorgrad.experiments._claim import mean_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_4._drift_figure import draw_least, draw_lines, shade

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLES = {"strength": "the muscle changes", "load": "the load changes"}


def draw_baselines(values: Values, of: Sequence[str]) -> "Figure":
    """A column for each thing that changes: how far the baselines are behind, the error of the force, and how the error
    differs from that with the mean of all rewards."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 7.6), layout="constrained")
    axes = figure.subplots(3, len(of), sharex=True, sharey="row", height_ratios=[1, 1.3, 1])
    for column, each in zip(axes.T, of, strict=True):
        _draw(column, values, each)
        column[0].set_title(TITLES[each], fontsize=11)
    axes[0, 0].set(ylabel="|baseline − mean reward|", yscale="log", ylim=(1e-3, None))
    axes[1, 0].set(ylabel="mean error of the force", ylim=(0, None))
    axes[2, 0].set(ylabel="error less that\nwith the mean of all")
    figure.legend(*axes[1, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize=8)
    figure.supxlabel(
        "shaded: the muscle is weak, or the load is added; dotted: the least possible error\n"
        "above: median and quartiles of the pools; below: mean with 95 % interval",
        fontsize=9,
        color="0.4",
    )
    return figure


def _draw(axes: "Sequence[Axes]", values: Values, of: str) -> None:
    upper, middle, lower = axes
    lines, decision, error = [str(line) for line in values["line"]], values["decision"], values[f"error {of}"]
    draw_lines(upper, decision, values[f"behind {of}"][:-1], lines[:-1])
    draw_lines(middle, decision, error, lines)
    draw_least(middle, values["changes"], decision[-1], values[f"least {of}"])
    for row in range(1, len(lines) - 1):
        found = [mean_of(each) for each in (error[row] - error[0]).T]
        lower.plot(decision / 1e6, [each.value for each in found], color=f"C{row}", linewidth=1.3)
        low, high = [each.low for each in found], [each.high for each in found]
        lower.fill_between(decision / 1e6, low, high, color=f"C{row}", alpha=0.18, linewidth=0)
    for each in axes:
        shade(each, values["changes"], decision[-1])
    lower.set_xlabel("decisions, million")
    lower.axhline(0, color="0.4", linewidth=0.8)
