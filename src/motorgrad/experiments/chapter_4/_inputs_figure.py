"""The figure of the experiment with too few negative inputs."""

from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments._claim import share_of
from motorgrad.experiments._experiment import Values

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WORDS = {
    "never": "never:\nfrom 0.1 kg",
    "once": "once:\nfrom 0 kg",
    "thesis": "thesis:\nfrom −2 kg",
    "often": "often:\nfrom −6 kg",
    "decay-0": "never, then\nfrom −2 kg",
}
COLOURS = ("C3", "C1", "C0", "C9", "C4", "C2", "C8", "C5")


def draw_inputs(values: Values, caught: np.ndarray) -> "Figure":
    """Shares of pools that are caught; where their units are; and what the pools do over the loads."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.6, 6.6), layout="constrained")
    top, bottom = figure.add_gridspec(2, 1)
    words = [WORDS.get(state, f"the same, gains\ndecay {state[6:]}") for state in map(str, values["state"])]
    _shares(figure.add_subplot(top), words, np.asarray(caught.any(axis=2)))
    left, right = (figure.add_subplot(place) for place in bottom.subgridspec(1, 2))
    _units(left, values, caught[0])
    _activation(right, values, words)
    return figure


def _shares(axes: "Axes", words: list[str], pools: np.ndarray) -> None:
    for place, each in enumerate(pools):
        share = share_of(each)
        error = [[share.value - share.low], [share.high - share.value]]
        axes.bar(place, share.value, 0.7, color=COLOURS[place % len(COLOURS)], alpha=0.7)
        axes.errorbar(place, share.value, error, color="0.2", capsize=4)
    axes.set_xticks(range(len(words)), words, fontsize=9)
    axes.set(ylim=(0, 1.02), ylabel="share of pools")
    axes.set_title(f"a unit fires at every load of 0 and below ({pools.shape[1]} pools, 95 % interval)", fontsize=10)


def _units(axes: "Axes", values: Values, caught: np.ndarray) -> None:
    threshold, gain = values["threshold"][0], values["gain"][0]
    for which, colour, words in ((~caught, "0.6", "others"), (caught, COLOURS[0], "fires below 0 too")):
        axes.scatter(threshold[which], gain[which], 12, color=colour, label=words)
    axes.axhline(0, color="0.7", linewidth=0.8, zorder=0)
    axes.set(xlabel="threshold, kg", ylabel="gain, per kg")
    axes.set_title("units that never saw a load of 0 or below", fontsize=10)
    axes.legend(fontsize=8, loc="lower left", handletextpad=0.2)


def _activation(axes: "Axes", values: Values, words: list[str]) -> None:
    load = values["load"]
    for row, (name, firing) in enumerate(zip(words, values["firing"], strict=True)):
        if str(values["state"][row]) not in ("once", "often"):
            colour = COLOURS[row % len(COLOURS)]
            axes.plot(load, firing.mean(axis=(0, 2)), color=colour, label=name.replace("\n", " "))
    axes.plot(load, values["best"], color="0.4", linewidth=1, linestyle=":", label="best", drawstyle="steps-mid")
    axes.set(xlabel="load, kg", ylabel="part of the pool that fires", ylim=(-0.03, 1.03))
    axes.set_title("mean over all pools", fontsize=10)
    axes.legend(fontsize=8)
