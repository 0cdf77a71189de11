"""The picture of section 5.2.2: heights and learning times against the action period."""

from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments.chapter_5._hopper_study import HIGH, SMOOTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_periods(values: dict[str, np.ndarray], marked: float) -> "Figure":
    """Heights after several amounts of practice (left), practice until hopping (right), with one period marked."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.5, 4.2), layout="constrained")
    heights, times = figure.subplots(1, 2)
    period, practice = 1000 * values["period"], values["practice"]
    shades = colormaps["viridis_r"](np.linspace(0.15, 0.95, len(practice)))
    for index, (shade, seconds) in enumerate(zip(shades, practice, strict=True)):
        low, middle, high = np.percentile(values["height"][:, :, index], [25, 50, 75], axis=1)
        heights.fill_between(period, low, high, color=shade, alpha=0.18, linewidth=0)
        heights.plot(period, middle, "o-", color=shade, markersize=4, label=f"{seconds:,.4g} s")
    heights.set(ylabel="height of hops (m)", ylim=(0, None))
    heights.legend(title="after practice of", fontsize=9)
    passed = values["passed"]
    spread = np.exp(np.linspace(-0.08, 0.08, passed.shape[1]))
    times.plot(period[:, None] * spread, passed, "o", color="0.6", markersize=3.5, markeredgewidth=0)
    times.plot(period, np.median(passed, axis=1), "o-", color=shades[-1], markersize=5, label="median")
    times.plot([], [], "o", color="0.6", markersize=3.5, label="one seed")
    if passed.max() > 0.98 * practice[-1]:
        times.axhline(practice[-1], color="0.7", linewidth=1, linestyle="--")
        times.text(
            period[-1], practice[-1], "not within the practice", ha="right", va="bottom", color="0.45", fontsize=9
        )
    times.set(yscale="log", ylabel=f"practice until hops pass {HIGH} m,\nin means over {SMOOTH:g} s (s)")
    times.legend()
    for axes in (heights, times):
        _periods(axes, period, 1000 * marked)
    return figure


def _periods(axes: "Axes", period: np.ndarray, marked: float) -> None:
    axes.set_xscale("log")
    axes.set_xticks(period, [f"{one:g}" for one in period])
    axes.xaxis.minorticks_off()
    axes.set_xlabel("action period (ms)")
    if period[0] <= marked <= period[-1]:
        axes.axvline(marked, color="0.8", linewidth=1, zorder=0)
        axes.text(
            marked,
            1.0,
            "the thesis's",
            transform=axes.get_xaxis_transform(),
            fontsize=8,
            color="0.5",
            va="bottom",
            ha="center",
        )
