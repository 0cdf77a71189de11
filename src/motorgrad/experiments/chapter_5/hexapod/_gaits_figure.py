"""The figure of the gaits that hexapods learn."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_5.hexapod._synergy_study import GAITS, MODES
from motorgrad.experiments.chapter_6.growing._growing_figure import draw_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {"tripod": "#0072B2", "pronk": "#D55E00", "intermediate": "#bdbdbd", "stalled": "#4d4d4d"}
DRAWN = {"sample": "drawn", "mode": "most probable"}


def draw_gaits(values: Values, lags: Sequence[int]) -> "Figure":
    """Speeds during practice; the classes of all seeds; and how far each gets against how fast it walks."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(figsize=(9.8, 7.6), layout="constrained")
    panels: Any = figure.subplot_mosaic(
        [["practice"] * 3, ["classes", *MODES]], width_ratios=[1.1, 1, 1], height_ratios=[1, 1.1]
    )
    _practice(panels["practice"], values, lags)
    _classes(panels["classes"], values, lags)
    most = max(float(values[f"lag {lag} {mode} speed"].max()) for lag in lags for mode in MODES)
    for mode in MODES:
        _distances(panels[mode], values, lags, mode, most)
    panels["sample"].set_ylabel("net displacement in 20 s / 20 s (m/s)")
    shown = [Patch(color=colour, label=kind) for kind, colour in COLOURS.items()]
    figure.legend(handles=shown, loc="outside lower center", ncols=4, title="gait, frozen and from a fresh start")
    return figure


def _practice(axes: "Axes", values: Values, lags: Sequence[int]) -> None:
    for lag, colour in zip(lags, ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"), strict=False):
        draw_band(axes, values["time"], values[f"lag {lag} practice"], colour, f"lag {lag}")
    level = float(values["controller speed"][0])
    axes.axhline(level, color="0.3", linewidth=0.9, linestyle=(0, (5, 3)))
    axes.annotate(
        "fixed controller", (1, level), xycoords=("axes fraction", "data"), xytext=(0, 3), textcoords="offset points",
        ha="right", va="bottom", fontsize=8.5, color="0.3",
    )  # fmt: skip
    seeds = len(values[f"lag {lags[0]} practice"])
    axes.set(
        xlabel="simulated time of practice (s)",
        ylabel="speed along the heading (m/s)",
        ylim=(0, None),
        xlim=(0, values["time"][-1]),
    )
    axes.legend(loc="upper left", title=f"median and quartiles of {seeds} seeds", title_fontsize=8.5)


def _classes(axes: "Axes", values: Values, lags: Sequence[int]) -> None:
    """A bar for each lag and kind of action, of as many seeds as came to each class."""
    rows = [(lag, mode) for lag in lags for mode in MODES]
    for row, (lag, mode) in enumerate(rows):
        gaits, left = values[f"lag {lag} {mode} gait"], 0
        for kind in GAITS:
            count = int(np.count_nonzero(gaits == kind))
            axes.barh(row, count, left=left, color=COLOURS[kind])
            if count:
                colour = "black" if kind == "intermediate" else "white"
                axes.text(left + count / 2, row, str(count), ha="center", va="center", fontsize=8, color=colour)
            left += count
    axes.set_yticks(range(len(rows)), [f"lag {lag},\n{DRAWN[mode]}" for lag, mode in rows], fontsize=8)
    axes.invert_yaxis()
    axes.set(xlabel="seeds", xlim=(0, len(values[f"lag {lags[0]} sample gait"])))


def _distances(axes: "Axes", values: Values, lags: Sequence[int], mode: str, most: float) -> None:
    """A mark for each seed, in the colour of its class and of the shape of its lag."""
    for lag, marker in zip(lags, "os^Dv", strict=False):
        gaits = values[f"lag {lag} {mode} gait"]
        for kind in GAITS:
            own = gaits == kind
            speed, net = (values[f"lag {lag} {mode} {name}"][own] for name in ("speed", "net"))
            axes.plot(speed, net, marker, color=COLOURS[kind], markersize=4.5, alpha=0.85, zorder=3)
        axes.plot([], [], marker, color="0.4", markersize=4.5, label=f"lag {lag}")
    axes.plot([0, most], [0, most], color="0.8", linewidth=0.8, zorder=0)
    axes.plot(
        values["controller speed"], values["controller net"], "P", color="black", markersize=7,
        label="fixed controller", zorder=4,
    )  # fmt: skip
    axes.set(xlabel="speed along the heading (m/s)", title=f"{DRAWN[mode]} actions", ylim=(-0.05, 1.02 * most))
    axes.legend(loc="upper left", fontsize=8, handletextpad=0.3)
