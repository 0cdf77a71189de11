"""The figure of the experiment with loads that the learner asks for."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_4._linear_study import SPACED

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_active(values: Values, words: Mapping[str, str]) -> "Figure":
    """For every learner: the spacing and the error over decisions, and from when on every pool is equally spaced."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots(len(words), 3, width_ratios=[1.3, 1.3, 1])
    kinds = (("uniform", "C1", "uniform loads"), ("queried", "C0", "loads asked for"))
    for row, (name, title) in zip(axes, words.items(), strict=True):
        decision = values[f"{name} decision"] / 1e6
        for loads, colour, label in kinds:
            for place, quantity in ((row[0], "spacing"), (row[1], "error")):
                low, median, high = np.percentile(values[f"{name} {loads} {quantity}"], [25, 50, 75], axis=0)
                place.fill_between(decision, low, high, color=colour, alpha=0.2, linewidth=0)
                place.plot(decision, median, color=colour, label=label)
        uniform, queried = (np.minimum(values[f"{name} {k} from"] / 1e6, decision[-1]) for k, _, _ in kinds)
        most = 1.05 * max(uniform.max(), queried.max())
        row[2].plot([0, most], [0, most], color="0.6", linewidth=0.8, linestyle="--")
        row[2].plot(uniform, queried, "o", markersize=3.5, color="C0", alpha=0.7, clip_on=False)
        row[0].axhline(SPACED, color="0.6", linewidth=0.8, linestyle="--")
        row[0].set(yscale="log", ylabel="threshold furthest off, in spacings", xlabel="million decisions", title=title)
        row[1].set(ylabel="error of the force, all loads alike", xlabel="million decisions", ylim=(0, None))
        row[2].set(xlabel="uniform loads", ylabel="loads asked for", xlim=(0, most), ylim=(0, most), aspect="equal")
        row[2].set_title("million decisions until equally\nspaced for good, each pool", fontsize=9)
        row[0].title.set_fontsize(9)
    axes[0, 1].legend(fontsize=8)
    return figure
