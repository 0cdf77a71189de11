"""Section 4.4.1: learners that query the loads at which they learn."""

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from motorgrad.schema import count, number
from motorgrad.statistics import median_of
from motorgrad.tasks import LinearRecruitment, spacing_error
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, at_most, below
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, subplots
from motorgrad_thesis.chapter_4._pools import (
    NATURAL,
    SPACED,
    equally_spaced_from,
    force_error,
    parameter_history,
    spacing_deviation,
)

METHOD_LABELS = {"plain": "plain gradient", "natural": "natural gradient"}
NO_WORSE = 1.05


@experiment("sec-4.4.1-active-learning", "loads that the learner queries", "section 4.4.1")
class ActiveLearning(Experiment):
    """A pool queries the loads at which it learns, the more often the more uncertain it is there, by the entropy of its
    action. Does it become equally spaced in fewer decisions than with uniform loads? And does it lift all loads equally
    well in the end?
    """

    reading: ClassVar[str] = "The linear mapping is 1.2 x − 0.1, its coefficients swapped, as for figure 4.3."

    plain_units: int = count(4, 2, 64, help="number of units in the pools that learn by the plain gradient")
    plain_steps: int = count(5_000_000, 200, 10**9, unit="decisions", help="for which these learn")
    natural_units: int = count(8, 2, 64, help="number of units in the pools that learn by the natural gradient")
    natural_steps: int = count(400_000, 200, 10**9, unit="decisions", help="for which these learn")
    explore: float = number(0.1, 0, 1, help="the share of loads that are drawn uniformly nevertheless")
    cells: int = count(32, 2, 10_000, help="number of cells in which the entropy is evaluated")
    seeds: int = count(24, 2, 10_000, help="number of pools of each kind")

    quick = smoke(plain_units=2, plain_steps=2_000, natural_units=3, natural_steps=2_000, seeds=3)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        asks = {"policy": {"kind": "querying-motoneurons", "explore": self.explore, "cells": self.cells}}
        for name, units, steps, changes in (
            ("plain", self.plain_units, self.plain_steps, {}),
            ("natural", self.natural_units, self.natural_steps, NATURAL),
        ):
            for loads in ("uniform", "queried"):
                task = LinearRecruitment(units=units, loads=loads)
                how: dict[str, Any] = {**changes, **(asks if loads == "queried" else {})}
                run = work.train(task, agent_for(task, **how), steps, self.seeds)
                threshold, gain = parameter_history(run)
                decision = run.curve()[0]
                found[f"{name} decision"] = decision
                found[f"{name} {loads} spacing"] = spacing_error(threshold, task)
                found[f"{name} {loads} error"] = force_error(threshold, gain, task)
                found[f"{name} {loads} from"] = equally_spaced_from(decision, spacing_deviation(threshold, gain, task))
        return found

    def figure(self, values: Values) -> Figure:
        """Spacing and error over decisions, and the time at which each pool becomes equally spaced."""
        sizes = {"plain": self.plain_units, "natural": self.natural_units}
        words = {name: f"{words}, {sizes[name]} units" for name, words in METHOD_LABELS.items()}
        figure, axes = subplots(9, 6, len(words), 3, width_ratios=[1.3, 1.3, 1])
        kinds = (("uniform", "C1", "uniform loads"), ("queried", "C0", "queried loads"))
        for row, (name, title) in zip(axes, words.items(), strict=True):
            decision = values[f"{name} decision"] / 1e6
            for loads, colour, label in kinds:
                for place, quantity in ((row[0], "spacing"), (row[1], "error")):
                    draw_band(place, decision, values[f"{name} {loads} {quantity}"], colour, label)
            uniform, queried = (np.minimum(values[f"{name} {k} from"] / 1e6, decision[-1]) for k, _, _ in kinds)
            most = 1.05 * max(uniform.max(), queried.max())
            row[2].plot([0, most], [0, most], color="0.6", linewidth=0.8, linestyle="--")
            row[2].plot(uniform, queried, "o", markersize=3.5, color="C0", alpha=0.7, clip_on=False)
            row[0].axhline(SPACED, color="0.6", linewidth=0.8, linestyle="--")
            row[0].set(yscale="log", ylabel="greatest deviation (spacings)", xlabel="million decisions", title=title)
            row[1].set(ylabel="error of the force, uniform loads", xlabel="million decisions", ylim=(0, None))
            row[2].set(xlabel="uniform loads", ylabel="queried loads", xlim=(0, most), ylim=(0, most), aspect="equal")
            row[2].set_title("million decisions until equally\nspaced for good, each pool", fontsize=9)
            row[0].title.set_fontsize(9)
        axes[0, 1].legend(fontsize=8)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for name, words in METHOD_LABELS.items():
            steps = values[f"{name} decision"][-1]
            found = [values[f"{name} {loads} from"] for loads in ("uniform", "queried")]
            never = [int(np.isinf(times).sum()) for times in found]
            times = [np.minimum(times, steps) for times in found]
            late = f"Never, and counted as {steps:,}: {never[0]} with uniform loads, {never[1]} with queried ones."
            yield below(
                1,
                f"Querying loads in proportion to the policy's entropy shortens learning ({words}).",
                median_of(times[1] / times[0]),
                "decisions until equally spaced for good, relative to uniform loads from the same start,",
                note=f"Medians {np.median(times[1]):,.0f} and {np.median(times[0]):,.0f}. {late}",
                kind="thesis" if name == "plain" else "extension",
                of="Querying loads in proportion to the policy's entropy shortens learning.",
            )
            yield at_most(
                NO_WORSE,
                f"Over uniform loads, the learned force is no worse ({words}).",
                median_of(values[f"{name} queried error"][:, -1] / values[f"{name} uniform error"][:, -1]),
                "root mean square error in the end, relative to uniform loads,",
                kind="extension",
            )
