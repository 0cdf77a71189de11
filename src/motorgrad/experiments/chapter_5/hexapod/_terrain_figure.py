"""The figure of the fixed controller on uneven ground."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._claim import mean_of, share_of
from motorgrad.experiments._experiment import Values

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOOKS = {"mended": ("#0072B2", "o-", "mended"), "worded": ("#CC79A7", "s--", "as worded")}


def draw_terrain(values: Values, kinds: Sequence[str], clearance: float) -> "Figure":
    """Speed, phase, and the shares of grounds with a tripod gait and of those where it stands still, over the height
    of each kind of ground; means and shares with their intervals."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.8, 8.6), layout="constrained")
    panels: Any = figure.subplots(4, len(kinds), sharex=True, sharey="row")
    for column, kind in zip(panels.T, kinds, strict=True):
        for wording, (colour, line, words) in LOOKS.items():
            gait = values[f"{kind} {wording} gait"]
            phases = zip(values[f"{kind} {wording} phase"], gait != "stalled", strict=True)
            measured = [
                [mean_of(row) for row in values[f"{kind} {wording} net"]],
                [mean_of(row[walks]) if walks.sum() > 1 else None for row, walks in phases],
                [share_of(row) for row in gait == "tripod"],
                [share_of(row) for row in values[f"{kind} {wording} still"]],
            ]
            for axes, each in zip(column, measured, strict=True):
                shift = 0.2 if wording == "worded" else -0.2  # so that intervals do not cover each other
                _points(axes, 100 * values["height"] + shift, each, colour, line, words)
        for axes in column:
            axes.axvline(100 * clearance, color="0.75", linewidth=0.9, linestyle=":", zorder=0)
        column[0].set_title(kind)
        column[-1].set_xlabel("height (cm)")
    labels = ("net displacement\n/ time (m/s)", "phase of those that\nwalk (cycles)", "share with\na tripod gait")
    for axes, words in zip(panels[:, 0], (*labels, "share that stands\nstill at the end"), strict=True):
        axes.set_ylabel(words)
    panels[0, 0].set_ylim(0, None)
    panels[1, 0].set_ylim(0, 0.52)
    for row in (2, 3):
        panels[row, 0].set_ylim(-0.04, 1.04)
    handles, words = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside upper center", ncols=2)
    return figure


def _points(axes: "Axes", x: np.ndarray, measured: Sequence[Any], colour: str, line: str, words: str) -> None:
    known = [number for number, each in enumerate(measured) if each is not None]
    measured, x = [measured[number] for number in known], x[known]
    centre = np.array([each.value for each in measured])
    ends = np.array([[each.value - each.low, each.high - each.value] for each in measured]).T.reshape(2, -1)
    axes.errorbar(
        x, centre, np.maximum(ends, 0.0), fmt=line, color=colour, markersize=3.5, linewidth=1.2, elinewidth=0.9,
        label=words,
    )  # fmt: skip
