"""The figure of the search for a body."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.bodies import compile_model
from motorgrad.experiments._claim import mean_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_5.morphology._body_space import SPACE, WORDS, body_of, usual_numbers
from motorgrad.experiments.chapter_5.morphology._observations import PAIRS, differences
from motorgrad.sim import draw

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {"cma-es": "C0", "boltzmann": "C1", "uniform": "0.5"}
METHODS = {"cma-es": "CMA-ES", "boltzmann": "Boltzmann selection", "uniform": "random sampling"}
COMPARED = {
    "base": "wide and heavy against\nslim and light",
    "width": "wide against slim",
    "mass": "heavy against light",
    "joints": "vertical against lateral\njoints between sections",
}
MEASURED = {"speed": "m/s faster", "duty": "feet on the ground for longer\n(part of the time)", "tilt": "° more tilt"}
BODIES = {"usual": ("usual body", "C0", 0.12), "chance": ("bodies at random places", "C1", -0.12)}


def draw_morphology(values: Values, kinds: Sequence[str]) -> "Figure":
    """The searches and the bodies (above), which numbers were found and which helped (middle), what the thesis observed
    (below)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 13.5), layout="constrained")
    parts: Any = figure.subfigures(3, 1, height_ratios=[3.6, 4.8, 3.2])
    above = parts[0].subplots(2, 3, width_ratios=[2.6, 1.2, 1.2], height_ratios=[1, 1.6])
    grid = above[0, 0].get_gridspec()
    for axes in above[:, 0]:
        axes.remove()
    _searches(parts[0].add_subplot(grid[:, 0]), values, kinds)
    _bodies(above[:, 1:], values)
    found, helped = parts[1].subplots(1, 2, sharey=True)
    _found(found, values, kinds)
    _helped(helped, values)
    _observed(parts[2].subplots(1, len(MEASURED), sharey=True), values)
    return figure


def _searches(axes: "Axes", values: Values, kinds: Sequence[str]) -> None:
    """The best so far over the evaluations; at the right how fast the best bodies are when they walk again."""
    for row, kind in enumerate(kinds):
        curves = np.fmax.accumulate(values[f"{kind} scores"], axis=1)
        count = np.arange(1, curves.shape[1] + 1)
        colour = COLOURS[kind]
        axes.fill_between(count, curves.min(axis=0), curves.max(axis=0), color=colour, alpha=0.15, linewidth=0)
        axes.plot(count, np.median(curves, axis=0), color=colour, label=METHODS[kind])
        again = values[f"{kind} again"].mean(axis=1)
        place = np.full(len(again), count[-1] * (1.05 + 0.04 * row))
        axes.plot(place, again, "o", color=colour, markersize=4, clip_on=False)
    axes.axhline(values["usual"].mean(), color="0.25", linestyle="--", linewidth=1, label="the usual body")
    axes.set(xlabel="evaluations; dots: the best walk again", ylabel="speed of the best body so far (m/s)")
    axes.set_ylim(0.9 * values["usual"].mean(), None)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=9)


def _bodies(axes: Any, values: Values) -> None:
    """The usual body and the best one, from the side and from above, to the same scale."""
    best = dict(zip(SPACE.names, values["found"].tolist(), strict=True))
    for column, (numbers, title) in enumerate(((usual_numbers(), "the usual body"), (best, "the best found"))):
        body = body_of(numbers)
        assert body is not None
        shown = dataclasses.replace(body, drive="muscles")
        model = compile_model(shown)
        for row, elevation in enumerate((0.0, -90.0)):
            place = axes[row, column]
            firing = np.zeros(len(shown.groups))
            draw(place, model, model.key(0).qpos, firing, elevation=elevation, linewidth=1.3, ground=not row)
            place.set_aspect("equal", adjustable="box")
            # the whole of either body, and the floor
            place.set(xlim=(-0.7, 0.7), ylim=(-0.7, 0.7) if row else (-0.05, 0.4))
            place.set_axis_off()
        axes[0, column].set_title(title)


def _found(axes: "Axes", values: Values, kinds: Sequence[str]) -> None:
    """The numbers that each search calls the best, as places within the bounds."""
    rows = np.arange(SPACE.size)
    for line, kind in enumerate(kinds):
        places = SPACE.places(values[f"{kind} best"])
        height = rows[None] + 0.24 * (line - 1)
        axes.plot(places, np.broadcast_to(height, places.shape), "o", color=COLOURS[kind], markersize=4, alpha=0.8)
        axes.plot([], [], "o", color=COLOURS[kind], markersize=4, label=METHODS[kind])
    usual = SPACE.places(list(usual_numbers().values()))
    axes.plot(usual, rows, "|", color="0.1", markersize=20, markeredgewidth=1.6)
    axes.plot([], [], "|", color="0.1", markersize=9, markeredgewidth=1.6, label="the usual body")
    axes.set_yticks(rows, list(WORDS.values()))
    axes.set(xlim=(-0.03, 1.03), ylim=(SPACE.size - 0.5, -0.5), xlabel="the best of each search, within the bounds")
    bounds = [f"{each.low:g} … {each.high:g}" for each in SPACE.ranges.values()]
    bounds[-1] = ""
    for row, text in enumerate(bounds):
        axes.text(1.05, row, text, transform=axes.get_yaxis_transform(), va="center", fontsize=8, color="0.4")
        axes.axhline(row + 0.5, color="0.9", linewidth=0.7, zorder=0)
    axes.legend(loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=2, fontsize=9)


def _helped(axes: "Axes", values: Values) -> None:
    """What each number of the best body does to the usual one, and what its loss does to the best one."""
    usual, best = values["compared"]
    for name, words, colour, shift in (
        ("changed", "gained by the usual body with this number of the best", "C0", -0.14),
        ("undone", "lost by the best body with this number of the usual", "C3", 0.14),
    ):
        gained = values[name] - usual if name == "changed" else best - values[name]
        _intervals(axes, gained, np.arange(SPACE.size) + shift, colour, words)
    axes.axvline(0.0, color="0.6", linewidth=1, zorder=0)
    for row in range(SPACE.size):
        axes.axhline(row + 0.5, color="0.9", linewidth=0.7, zorder=0)
    axes.set_xlabel(f"m/s; the usual body {usual.mean():.2f}, the best {best.mean():.2f}")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize=9)


def _observed(places: Any, values: Values) -> None:
    """By how much the first of each pair is faster, stands for longer and tilts more than the second."""
    rows = np.arange(len(PAIRS))
    for axes, (measure, words) in zip(places, MEASURED.items(), strict=True):
        for bodies, (label, colour, shift) in BODIES.items():
            found = [differences(values, bodies, pair, measure) for pair in PAIRS]
            _intervals(axes, found, rows - shift, colour, label)
        axes.axvline(0.0, color="0.6", linewidth=1, zorder=0)
        axes.set(xlabel=words, ylim=(len(PAIRS) - 0.5, -0.5))
    places[0].set_yticks(rows, [COMPARED[pair] for pair in PAIRS])
    places[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=9)


def _intervals(axes: "Axes", found: Any, rows: np.ndarray, colour: str, label: str) -> None:
    """Means of rows of values, with their intervals."""
    means = [mean_of(each) for each in found]
    error = np.array([[m.value - m.low, m.high - m.value] for m in means]).T
    axes.errorbar(
        [m.value for m in means], rows, xerr=error, fmt="o", color=colour, markersize=4, capsize=2, label=label
    )
