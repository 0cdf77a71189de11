"""The figure of the experiment with units of different sizes."""

import itertools
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments._claim import mean_of
from motorgrad.experiments._experiment import Values

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_sizes(values: Values, words: Mapping[str, str], orders: Mapping[str, np.ndarray]) -> "Figure":
    """For every line the load from which each unit fires, over its size, and the rank correlations of all pools.

    A grey line joins the units of a pool; units of negative gain are hollow.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6.8), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    size = values["size"]
    for place, (name, title) in zip(axes.flat, words.items(), strict=True):
        loads = values[f"{name} load"]
        shift = np.geomspace(0.88, 1 / 0.88, len(loads))
        for seed, row in enumerate(loads):
            place.plot(size * shift[seed], row, color="0.85", linewidth=0.5, zorder=1)
        for unit, positive in itertools.product(range(len(size)), (True, False)):
            which = (values[f"{name} gain"][:, unit] > 0) == positive
            colour = f"C{unit}"
            face = colour if positive else "white"
            place.scatter(size[unit] * shift[which], loads[which, unit], 12, face, edgecolor=colour, zorder=2)
        mean = mean_of(orders[name])
        place.set_title(f"{title}\nrank correlation {mean.value:+.2f} [{mean.low:+.2f} … {mean.high:+.2f}]", fontsize=9)
        place.set_xscale("log", base=2)
        place.set_xticks(size, [f"{part:.2f}" for part in size])
        place.minorticks_off()
        place.set_ylim(-0.03 * float(values[f"{name} high"]), 1.03 * float(values[f"{name} high"]))
    for row, unit in zip(axes, ("", ", kg"), strict=True):
        row[0].set_ylabel(f"fires from this load on{unit}")
    for place in axes[1]:
        place.set_xlabel("size, part of the whole force (hollow: gain below 0)")
    return figure
