"""The figure of a flow field for navigation."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._curves import moving_mean
from motorgrad.experiments._experiment import Values
from motorgrad.sim import draw_paths, draw_reward
from motorgrad.tasks import ParticleNavigation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SMOOTH = 5  # records
NOTHING = 1e-6  # a force below this is rounding


def draw_navigation(values: Values, task: ParticleNavigation, words: Mapping[str, str]) -> "Figure":
    """The expected force and paths before and after learning, and the share of episodes that end at the goal."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.1), layout="constrained")
    axes: Any = figure.subplots(1, 3, width_ratios=[1, 1, 1.1])
    for panel, when in zip(axes, ("before", "after"), strict=False):
        draw_reward(panel, task)
        flow = values[f"{when} flow"]
        most = float(np.linalg.norm(flow, axis=1).max())
        if most > NOTHING:
            x, y = values["places"].T
            panel.quiver(x, y, *flow.T, color="#0061B0", width=0.0045, scale=16 * most, zorder=1.5, alpha=0.75)
        draw_paths(panel, np.split(values[f"{when} paths"], values[f"{when} ends"][:-1]))
    axes[0].set_title("before learning: forces cancel; paths", fontsize=10)
    axes[1].set_title(f"learnt, seed {int(values['row'])}: mean force, paths", fontsize=10)
    _arrivals(axes[2], values, words)
    return figure


def _arrivals(axes: "Axes", values: Values, words: Mapping[str, str]) -> None:
    """All seeds, and their mean."""
    thousands = values["decision"] / 1e3
    for (name, label), colour in zip(words.items(), ("C1", "C0"), strict=True):
        shares, at = moving_mean(values[f"{name} arrivals"], SMOOTH), thousands[SMOOTH - 1 :]
        axes.plot(at, shares.T, color=colour, linewidth=0.5, alpha=0.35)
        axes.plot(at, shares.mean(0), color=colour, linewidth=2.2, label=label)
    axes.set(xlabel="thousand decisions", ylabel="episodes that end at the goal", ylim=(0, 1.02))
    axes.legend(title="thin: every seed, thick: mean", loc="lower right", fontsize=8, title_fontsize=8)
