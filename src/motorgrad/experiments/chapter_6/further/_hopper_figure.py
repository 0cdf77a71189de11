"""The figure of hoppers with local units."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_6.growing._growing_figure import draw_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANELS = (("flexors", 0, 0), ("extensors", 0, 1), ("flexors", 1, 0), ("extensors", 1, 1))
"""Muscles; on the ground (0) or in the air (1); which group."""
PLACES = ("on the ground", "in the air")
STYLES = (("0.35", "-"), ("C0", "-"), ("C2", "-"), ("0.35", "--"), ("C0", "--"), ("C2", "--"))
SHOWN = 400  # states


def draw_local_hoppers(
    values: Values,
    words: Mapping[str, str],
    pictured: Sequence[str],
    ranges: Sequence[tuple[float, float]],
    added: np.ndarray,
) -> "Figure":
    """Heights over practice; and of those that are `pictured`, where in angle and velocity each pair of muscles is
    active, with states visited."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.4, 13.4), layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=[1, 3.2])
    above, below = halves
    shown: Any = None
    axes = above.subplots()
    for (name, label), (colour, line) in zip(words.items(), STYLES, strict=True):
        draw_band(axes, values["time"], values[f"{name} heights"], colour, label, line=line)
    for time in added:
        axes.axvline(time, color="0.88", linewidth=0.7, zorder=0)
    axes.set(xlabel="simulated s of practice; lines: a unit is added", ylabel="mean height of hops, m", ylim=(0, None))
    axes.legend(loc="upper left", fontsize=8.5)
    panels: Any = below.subplots(len(pictured), len(PANELS), sharex=True, sharey=True)
    for row, name in zip(panels, pictured, strict=True):
        for axes, (muscles, place, group) in zip(row, PANELS, strict=True):
            shown = _muscle(axes, values, name, place, group, ranges)
            axes.set_title(f"{muscles}, {PLACES[place]}", fontsize=9)
        row[0].set_ylabel(
            words[name].replace(", ", ",\n").replace(" over", "\nover") + "\nvelocity × scale", fontsize=8
        )
    for axes in panels[-1]:
        axes.set_xlabel("knee angle, rad from 90°", fontsize=9)
    below.colorbar(shown, ax=panels, shrink=0.5, label="probability that they are active")
    return figure


def _muscle(
    axes: "Axes", values: Values, name: str, place: int, group: int, ranges: Sequence[tuple[float, float]]
) -> Any:
    """When a pair of muscles is active, and the states in which the hopper was, on the ground or in the air."""
    extent = (*ranges[1], *ranges[2])
    active = values[f"{name} active"][place, :, :, group]
    shown = axes.imshow(active, origin="lower", extent=extent, aspect="auto", cmap="viridis", vmin=0, vmax=1)
    states = values[f"{name} states"]
    states = states[states[:, 0] == (1.0, -1.0)[place]][:SHOWN]
    axes.plot(states[:, 1], states[:, 2], ".", color="white", markersize=2.2, alpha=0.6)
    axes.set(xlim=ranges[1], ylim=ranges[2])
    return shown
