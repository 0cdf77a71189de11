"""The figure of the experiment with large loads only."""

from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments._claim import share_of
from motorgrad.experiments._experiment import Values

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLES = {"height": "paid by height", "complete": "paid only where complete"}


def draw_loads(values: Values, silent: float) -> "Figure":
    """Above: what a common probability earns. Below: the part of each pool that fires after learning, and how many are
    silent."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6.4), layout="constrained")
    axes = figure.subplots(2, 2, sharex="row", sharey="row")
    for column, (paid, title) in enumerate(TITLES.items()):
        _pay(axes[0, column], values, paid)
        axes[0, column].set_title(title, fontsize=11)
        _active(axes[1, column], values, paid, silent)
    axes[0, 0].set_ylabel("mean reward at large loads")
    axes[1, 0].set_ylabel("part that fires at large loads\nafter learning")
    axes[0, 0].legend(title="units")
    axes[1, 0].legend(title="learnt from")
    return figure


def _pay(axes: "Axes", values: Values, paid: str) -> None:
    for row, size in enumerate(values["size"]):
        axes.plot(values["probability"], values[f"{paid} pay"][row], color=f"C{row}", label=str(size))
    axes.axvline(0.5, color="0.6", linewidth=0.8, linestyle="--")
    axes.text(0.51, 5.9, "start", color="0.4", fontsize=9)
    axes.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    axes.set_xlabel("probability that each unit fires")


def _active(axes: "Axes", values: Values, paid: str, silent: float) -> None:
    spread = np.linspace(-0.13, 0.13, values[f"{paid} large"].shape[1])
    for shift, seen, colour in ((-0.2, "large", "C3"), (0.2, "all", "C0")):
        for place, active in enumerate(values[f"{paid} {seen}"]):
            axes.plot(
                place + shift + spread, np.sort(active), ".", color=colour, markersize=5,
                label=f"{seen} loads" if place == 0 else None,
            )  # fmt: skip
            share = share_of(active < silent)
            words = f"{round(share.value * share.count)} of {share.count}\nsilent"
            axes.text(place + shift, 1.04, words, ha="center", va="bottom", fontsize=7.5, color=colour)
    axes.set_xticks(range(len(values["size"])), [str(size) for size in values["size"]])
    axes.set(xlabel="units in the pool", ylim=(-0.04, 1.22), yticks=np.linspace(0, 1, 6))
