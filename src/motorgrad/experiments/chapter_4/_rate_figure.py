"""The figure of the experiment with graded units."""

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import expit

from motorgrad.experiments._experiment import Values
from motorgrad.tasks import LinearRecruitment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOADS = np.linspace(0, 1, 201)
KINDS = (("binary", "C1", "fire or not"), ("graded", "C0", "graded"))


def draw_rate(values: Values) -> "Figure":
    """For every number of units the error over decisions, the noise of graded units, and the mean force of each pool.

    Bars at the right: the error without noise, by the mean or the most probable action.
    """
    from matplotlib.figure import Figure

    units = [int(count) for count in values["units"]]
    figure = Figure(figsize=(3 * len(units) + 0.6, 7.6), layout="constrained")
    axes = figure.subplots(3, len(units), squeeze=False, height_ratios=[1.3, 1, 1])
    decision = values["decision"] / 1e3
    for column, count in enumerate(units):
        above, noise, below = axes[:, column]
        for kind, colour, label in KINDS:
            low, median, high = np.percentile(values[f"{count} {kind} error"], [25, 50, 75], axis=0)
            above.fill_between(decision, low, high, color=colour, alpha=0.2, linewidth=0)
            above.plot(decision, median, color=colour, label=label)
            above.plot(
                decision[-1] * 1.06,
                np.median(values[f"{count} {kind} without noise"]),
                "_",
                color=colour,
                markersize=12,
            )
            for threshold, gain in zip(
                values[f"{count} {kind} threshold"], values[f"{count} {kind} gain"], strict=True
            ):
                force = expit(gain * (LOADS[:, None] - threshold)).mean(1)
                below.plot(LOADS, force, color=colour, linewidth=0.6, alpha=0.5)
        above.axhline(values["least"][column], color="0.4", linewidth=0.9, linestyle="--")
        above.set(title=f"{count} unit{'s' * (count > 1)}", xlabel="thousand decisions", ylim=(0, None))
        low, median, high = np.percentile(np.median(values[f"{count} deviation"], axis=2), [25, 50, 75], axis=0)
        noise.fill_between(decision, low, high, color="C0", alpha=0.2, linewidth=0)
        noise.plot(decision, median, color="C0")
        noise.set(xlabel="thousand decisions", ylim=(0, None))
        below.plot(LOADS, LinearRecruitment(units=count).target(LOADS), color="0.3", linewidth=1, linestyle="--")
        below.set(xlabel="load", ylim=(-0.12, 1.12))
    axes[0, 0].set_ylabel("mean error of the force")
    axes[1, 0].set_ylabel("deviation of the noise")
    axes[2, 0].set_ylabel("mean force")
    axes[0, 0].legend(fontsize=8)
    return figure
