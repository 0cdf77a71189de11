"""The figure of the experiment on forgetting."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments._experiment import Values

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SMOOTH = 5  # records of the learner's own reward, averaged


def draw_forgetting(values: Values, gaps: Sequence[float], words: Mapping[str, str]) -> "Figure":
    """For every kind of policy and gap: the reward on A of frozen policies, while first A and then B is learnt, and
    that of the learner on B."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2.6 * len(words), 0.6 + 2.5 * len(gaps)), layout="constrained")
    grid = figure.subplots(len(gaps), len(words), sharex=True, sharey=True, squeeze=False)
    for number, (row, gap) in enumerate(zip(grid, gaps, strict=True)):
        for panel, (name, title) in zip(row, words.items(), strict=True):
            key = f"{gap:g} {name}"
            _band(panel, values[f"{key} checked"], values[f"{key} A"].T, "C0", "on the left (A), frozen")
            decision, reward = values[f"{key} decision"], values[f"{key} B"]
            kept = len(decision) // SMOOTH * SMOOTH
            smooth = reward[:, :kept].reshape(len(reward), -1, SMOOTH).mean(2)
            _band(panel, decision[SMOOTH - 1 : kept : SMOOTH], smooth, "C1", "on the right (B), learning")
            half = values[f"{key} checked"][-1] / 2000
            panel.axvline(half, color="0.7", linewidth=0.8, linestyle="--")
            for at, phase in ((half / 2, "learns A"), (1.5 * half, "learns B")):
                where = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "top"}
                panel.annotate(phase, (at, 0.99), color="0.4", fontsize=8.5, **where)
            if number == 0:
                panel.set_title(title, fontsize=9)
        row[0].set_ylabel(f"gap {gap:g}\nreward per decision")
    for panel in grid[-1]:
        panel.set_xlabel("thousand decisions")
    low, high = grid[0, 0].get_ylim()
    grid[0, 0].set_ylim(low, high + 0.08 * (high - low))
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=9)
    return figure


def _band(axes: "Axes", decision: np.ndarray, reward: np.ndarray, colour: str, label: str) -> None:
    low, high = np.percentile(reward, [25, 75], axis=0)
    axes.fill_between(decision / 1000, low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(decision / 1000, reward.mean(0), color=colour, label=label)
