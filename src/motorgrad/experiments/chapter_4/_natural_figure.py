"""The drawing of large pools: error over time, time against size, and what each part is worth."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments._experiment import Values

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEARNERS = {
    "plain": ("OLGARB", "#c8452f", "s"),
    "natural": ("natural step", "#7f8c8d", "^"),
    "normal": ("natural step, input baseline,\nnormalised advantages", "#3b6fb6", "o"),
}
PARTS = ("#3b6fb6", "#e08e2b", "#7f8c8d", "#5b9c51", "#c8452f")


def draw(values: Values, dissected: int, parts: Sequence[str], equal: float) -> "Figure":
    """Three panels; the last is for `dissected` units and learners by the names of `parts`; `equal` is the error that
    counts as equally spaced."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.4), layout="constrained")
    over, against, without = figure.subplots(1, 3)
    for name, (label, colour, _) in LEARNERS.items():
        _band(over, values[f"{name}_decision"], values[f"{name}_error"], colour, label)
    over.set(xscale="log", title="16 units")
    for name, (label, colour, marker) in LEARNERS.items():
        _against(against, values, name, label, colour, marker)
    _doublings(against, values["normal_units"])
    against.set(
        ylim=(None, 1e10),
        xlabel="units",
        ylabel="decisions until equally spaced for good",
        title="time against size of the pool",
    )
    for place, (part, colour) in enumerate(zip(parts, PARTS, strict=True)):
        label = f"{part}, α {float(values[f'without_{place}_rate']):g}"
        _band(without, values[f"without_{place}_decision"], values[f"without_{place}_error"], colour, label)
    without.set(title=f"{dissected} units, one part replaced")
    for axes in (over, without):
        axes.axhline(equal, color="0.5", linewidth=0.8, linestyle=":")
        axes.set(yscale="log", xlabel="decisions", ylim=(0.01, 1500))
    without.set(xlim=(0, None))
    without.xaxis.set_major_formatter(lambda x, _: f"{x / 1000:g}k")
    over.set_ylabel("greatest distance from its place (spacings)")
    for axes in (over, against, without):
        axes.legend(fontsize=8, loc="upper right")
    return figure


def _band(axes: "Axes", decision: np.ndarray, errors: np.ndarray, colour: str, label: str) -> None:
    """Median and quartiles over seeds; nothing is drawn where they are infinite."""
    low, middle, high = np.quantile(errors, (0.25, 0.5, 0.75), axis=0, method="inverted_cdf")
    axes.plot(decision, np.where(np.isfinite(middle), middle, np.nan), color=colour, label=label, linewidth=1.4)
    axes.fill_between(decision, low, np.where(np.isfinite(high), high, 1e9), color=colour, alpha=0.18, linewidth=0)


def _against(axes: "Axes", values: Values, name: str, label: str, colour: str, marker: str) -> None:
    """Median times with all seeds' range; an arrow from the last decision where half the seeds did not get there."""
    units, times, budget = (values[f"{name}_{what}"] for what in ("units", "times", "budget"))
    middle = np.median(times, axis=1)
    there = np.isfinite(middle)
    ends = np.where(np.isfinite(times), times, budget[:, None])
    error = np.abs(np.stack([ends.min(1), ends.max(1)]) - middle)[:, there]
    axes.errorbar(
        units[there], middle[there], error, fmt=f"{marker}-", color=colour, markersize=4, capsize=2, label=label
    )
    for size, last in zip(units[~there], budget[~there], strict=True):
        axes.annotate(
            "", (size, last * 3), (size, last), arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 1.4}
        )
        axes.plot(size, last, marker, color=colour, markersize=4, markerfacecolor="white")


def _doublings(axes: "Axes", units: np.ndarray) -> None:
    axes.set(xscale="log", yscale="log")
    axes.set_xticks(units, [str(size) for size in units])
    axes.set_xticks([], minor=True)
