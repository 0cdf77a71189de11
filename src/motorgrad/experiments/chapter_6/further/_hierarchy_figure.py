"""The figure of hierarchies: gates, what is done behind them, and how it is learnt."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_6.growing._growing_figure import draw_band
from motorgrad.sim import draw_paths, draw_reward
from motorgrad.tasks import FallingParticle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SMOOTH = 10  # records
LINES = {
    "ungated": ("0.5", "-"),
    "gated": ("C0", "-"),
    "flat gated": ("C0", ":"),
    "deep": ("C3", "-"),
    "flat deep": ("C3", ":"),
}
LEVELS = ("#222222", "#B07500")


def draw_hierarchy(values: Values, tasks: Mapping[str, FallingParticle], words: Mapping[str, str]) -> "Figure":
    """For each hierarchy: its gates with paths, and where each pool at its end acts and pushes; the reward of all."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 7.2), layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=[1.65, 1])
    above, below = halves
    shown: Any = None
    rows: Any = above.subplots(len(tasks), 5)
    for axes, (name, task) in zip(rows, tasks.items(), strict=True):
        pools = len(values[f"{name} open"])
        _gates(axes[0], values, name, task)
        axes[0].set_title(f"{len(values[f'{name} level'])} gates, paths: seed {int(values[f'{name} row'])}", fontsize=9)
        for number, panel in enumerate(axes[1:]):
            if number >= pools:
                panel.set_axis_off()
                continue
            shown = _pool(panel, values[f"{name} open"][number], values[f"{name} push"][number])
            panel.set_title(f"pool {number + 1} of {pools}", fontsize=9)
    above.colorbar(shown, ax=rows, shrink=0.6, label="push to the right,\ntimes how open")
    _curves(below.subplots(), values, words)
    return figure


def _gates(axes: "Axes", values: Values, name: str, task: FallingParticle) -> None:
    """The reward, paths, and each gate's ellipse of one width, by level."""
    from matplotlib.patches import Ellipse

    draw_reward(axes, task)
    draw_paths(axes, np.split(values[f"{name} paths"], values[f"{name} ends"][:-1]))
    rows = zip(*(values[f"{name} {part}"] for part in ("level", "centre", "width")), strict=True)
    for level, centre, width in rows:
        ellipse = Ellipse(tuple(centre), *(2 * width), fill=False, color=LEVELS[level % 2], linewidth=2 - level % 2)
        axes.add_patch(ellipse)


def _pool(axes: "Axes", opened: np.ndarray, push: np.ndarray) -> Any:
    """Where a pool pushes to the left (blue) and to the right (red), as much as its gates are open."""
    shown = axes.imshow(opened * push, origin="lower", extent=(0, 1, 0, 1), cmap="RdBu_r", vmin=-1, vmax=1)
    axes.contour(
        opened, [0.25, 0.5, 0.75], extent=(0, 1, 0, 1), colors="0.3", linewidths=(0.6, 1.2, 0.6), linestyles="-"
    )
    axes.set(xticks=(), yticks=())
    for spine in axes.spines.values():
        spine.set_visible(True)
    return shown


def _curves(axes: "Axes", values: Values, words: Mapping[str, str]) -> None:
    counts = dict(zip(words, values["parameters"], strict=True))
    for name, (colour, line) in LINES.items():
        label = f"{words[name]} ({counts[name]} parameters)"
        draw_band(axes, values["decision"] / 1e3, values[f"{name} reward"], colour, label, SMOOTH, line)
    axes.set(xlabel="thousand decisions", ylabel="reward per decision")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
