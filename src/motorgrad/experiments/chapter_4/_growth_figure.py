"""The figure of the experiment with pools that grow."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments._claim import median_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_4._linear_study import SPACED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 25  # of a curve in each phase


def draw_growth(values: Values, words: Mapping[str, str]) -> "Figure":
    """For every way to learn: the error of the force over decisions, and how far from equal spacing pools ended."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots(2, len(words), sharey="row", height_ratios=[1.5, 1])
    for column, (name, title) in enumerate(words.items()):
        phases = len(values[f"{name} grown spacing"])
        for kind, colour, label in (("start", "C1", "complete from the start"), ("grown", "C0", "grown unit by unit")):
            decision, error = _thinned(values[f"{name} {kind} decision"], values[f"{name} {kind} error"], phases)
            low, median, high = np.percentile(error, [25, 50, 75], axis=0)
            axes[0, column].fill_between(decision / 1e6, low, high, color=colour, alpha=0.2, linewidth=0)
            axes[0, column].plot(decision / 1e6, median, color=colour, label=label)
        phase = values[f"{name} grown decision"][-1] / phases / 1e6
        for count in range(1, phases):
            axes[0, column].axvline(count * phase, color="0.85", linewidth=0.7, zorder=0)
        axes[0, column].set(title=title, xlabel="million decisions")
        axes[0, column].title.set_fontsize(9)
        for found, shift, colour in (
            (values[f"{name} grown spacing"], 0, "C0"),
            (values[f"{name} start spacing"][None], phases - 1, "C1"),
        ):
            measured = [median_of(row) for row in found]
            error = [[m.value - m.low for m in measured], [m.high - m.value for m in measured]]
            place = np.arange(1, len(found) + 1) + shift + (0.2 if shift else 0)
            axes[1, column].errorbar(
                place, [m.value for m in measured], error, fmt="o-", markersize=4, color=colour, linewidth=0.8
            )
        axes[1, column].axhline(SPACED, color="0.6", linewidth=0.8, linestyle="--")
        axes[1, column].set(xlabel="units", yscale="log")
    axes[0, 0].set(ylabel="mean error of the force", ylim=(0, None))
    axes[0, 0].legend(fontsize=8)
    axes[1, 0].set_ylabel("threshold furthest off, in spacings")
    return figure


def _thinned(decision: np.ndarray, values: np.ndarray, phases: int) -> tuple[np.ndarray, np.ndarray]:
    """Means over neighbouring records, so that a curve has `POINTS` in each phase; the decisions that they end with."""
    size = max(1, len(decision) // (phases * POINTS))
    kept = len(decision) // size * size
    return decision[size - 1 : kept : size], values[:, :kept].reshape(len(values), -1, size).mean(2)
