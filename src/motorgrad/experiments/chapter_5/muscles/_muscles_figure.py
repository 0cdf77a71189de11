"""The figure of learning to walk on 24 muscles."""

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_5.muscles._muscle_study import FULL
from motorgrad.experiments.chapter_6.growing._growing_figure import draw_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
WORDS = {"mode": "most probable actions", "sample": "actions that are drawn"}


def draw_muscles(values: Values) -> "Figure":
    """Speed while learning; and of every seed, frozen, how fast it walks and how far it gets."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.8, 7.2), layout="constrained")
    panels: Any = figure.subplot_mosaic([["practice", "practice"], ["mode", "sample"]], height_ratios=[1, 1.15])
    names = [FULL, *(str(name) for name in values["variants"])]
    _practice(panels["practice"], values, names)
    for mode in WORDS:
        _frozen(panels[mode], values, names, mode)
    panels["mode"].set_ylabel("m/s")
    top = 1.15 * max(panels[mode].get_ylim()[1] for mode in WORDS)  # room for the legends
    for mode in WORDS:
        panels[mode].set_ylim(-0.05, top)
    return figure


def _practice(axes: "Axes", values: Values, names: list[str]) -> None:
    for name, colour in zip(names, COLOURS, strict=False):
        curves = values[f"{name} practice"]
        if name == FULL:
            draw_band(axes, values[f"{name} time"], curves, colour, f"{name}, {len(curves)} seeds")
        else:
            axes.plot(values[f"{name} time"], np.median(curves, 0), color=colour, linewidth=1.2, label=name)
    changed = f"; changed learners, {int(values['compared'])} seeds each" if len(names) > 1 else ""
    axes.set(
        xlabel="simulated time of practice (s)",
        ylabel="speed along the heading (m/s)",
        ylim=(0, None),
        xlim=(0, values[f"{FULL} time"][-1]),
    )
    axes.legend(loc="upper left", ncols=2, title=f"medians{changed}", title_fontsize=8.5)


def _frozen(axes: "Axes", values: Values, names: list[str], mode: str) -> None:
    """Of each learner two columns of marks, a mark for each seed, and the medians as bars."""
    for place, (name, colour) in enumerate(zip(names, COLOURS, strict=False)):
        for shift, quantity, filled in ((-0.17, "speed", False), (0.17, "net", True)):
            found = values[f"{name} {mode} {quantity}"]
            across = place + shift + 0.12 * np.linspace(-1, 1, len(found))
            face = colour if filled else "none"
            axes.plot(across, found, "o", markersize=3.8, color=colour, markerfacecolor=face, alpha=0.75)
            axes.plot([place + shift - 0.15, place + shift + 0.15], [np.median(found)] * 2, color=colour, linewidth=2)
    axes.set_xticks(range(len(names)), [name.replace(" ", "\n") for name in names], fontsize=8)
    axes.plot([], [], "o", color="0.4", markersize=3.8, markerfacecolor="none", label="speed along the heading")
    axes.plot([], [], "o", color="0.4", markersize=3.8, label="net displacement over 20 s")
    axes.set_title(WORDS[mode])
    axes.legend(loc="upper right", fontsize=8, handletextpad=0.2)
