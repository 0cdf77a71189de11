"""Section 6.4.3: when to add a unit, and when to stop."""

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from motorgrad.statistics import mean_of, median_of, share_of
from motorgrad_thesis._claims import Claim, above, more_than_half, negative, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Axes, Figure, draw_band, draw_intervals, subplots
from motorgrad_thesis.chapter_6.section_6_4._growing_study import INTERVAL, GrowthComparison, learning_phase

END = 0.05  # share of the decisions, the last, over which the end is averaged
QUIET = 0.1  # growth has stopped if this share of the decisions, the last, passes without an addition
WAYS: dict[str, dict[str, Any]] = {
    "clock": {},
    "first": {"growth.criterion": {"kind": "plateau", "patience": 1}},
    "plateau": {"growth.criterion": "plateau"},
    "short": {"growth.criterion": {"kind": "plateau", "window": 2_000, "patience": 6}},
}
CRITERION_LABELS = {
    "clock": "by the clock, every 10,000 decisions",
    "first": "at a plateau; stops at the first unit without improvement",
    "plateau": "at a plateau; stops after three in a row (the default)",
    "short": "at a plateau of 2,000 decisions; stops after six in a row",
}
MIN_SEEDS = 5  # for a mean over those with this many units


@experiment("sec-6.4-criteria", "when to add a unit, and when to stop", "section 6.4")
class Criteria(GrowthComparison):
    """When to add the next unit, and when to stop: by the clock, or once the reward no longer rises by more than its
    interval. All learners have the same number of decisions, in the layouts R3 and R1: their reward over decisions and
    against units, the final number of units, and the time of the last addition.
    """

    ways: ClassVar[Mapping[str, Mapping[str, Any]]] = WAYS

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name, run in self.runs(work):
            found["decision"], found[f"{name} reward"] = run.curve()
            found[f"{name} units"] = run.curve("units")[1]
        return found

    def figure(self, values: Values) -> Figure:
        """For each layout: reward over decisions, units over decisions, and reward against units."""
        from matplotlib.ticker import MaxNLocator

        figure, axes = subplots(10, 6.6, len(self.layouts), 3, squeeze=False, sharey="col")
        thousands = values["decision"] / 1e3
        span = max(1, round(INTERVAL / values["decision"][0]))
        for row, layout in zip(axes, self.layouts, strict=True):
            for number, way in enumerate(CRITERION_LABELS):
                reward = values[f"{layout} {way} reward"]
                units = values[f"{layout} {way} units"]
                draw_band(row[0], thousands, reward, f"C{number}", CRITERION_LABELS[way], records=span)
                draw_band(row[1], thousands, units, f"C{number}", CRITERION_LABELS[way])
                _by_units(row[2], reward, units, f"C{number}", least=round(0.8 * span))
            row[0].set_ylabel(f"{layout}: reward, last {INTERVAL:,} decisions")
            row[1].set(ylabel="units", ylim=(0, None))
            row[2].set(ylabel="reward")
        axes[0, 1].set_title("units over time", fontsize=10)
        axes[0, 2].set_title("reward at the end with this many units", fontsize=10)
        for each in axes[:, 1]:
            each.yaxis.set_major_locator(MaxNLocator(integer=True))
        for each, label in zip(axes[-1], ("thousand decisions", "thousand decisions", "units"), strict=True):
            each.set_xlabel(label)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=8.5)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for layout in self.layouts:
            yield from self._of(values, layout)

    def _of(self, values: Values, layout: str) -> Iterator[Claim]:
        ends = {way: final_reward(values, layout, way) for way in WAYS}
        lives = {way: values[f"{layout} {way} reward"].mean(1) for way in WAYS}
        sizes = {way: values[f"{layout} {way} units"][:, -1] for way in WAYS}
        yield negative(
            f"Stopping once a unit brings no improvement is naive: it stops too early ({layout}).",
            mean_of(ends["first"] - ends["clock"]),
            "final reward minus that by the clock",
            "reward per decision",
            note=f"{median_of(sizes['first']).words('units')}; {ends['first'].mean():.3f} and "
            f"{ends['clock'].mean():.3f}.",
            source="section 6.4.3",
            of="Stopping once a unit brings no improvement is naive: it stops too early.",
        )
        for way in ("plateau", "short"):
            units = values[f"{layout} {way} units"]
            quiet = units[:, values["decision"] <= (1 - QUIET) * values["decision"][-1]][:, -1] == units[:, -1]
            late = "Window and patience were chosen on other seeds, 100 to 123. " if way == "short" else ""
            yield more_than_half(
                f"Growth stops by itself before the pool is full ({layout}; {CRITERION_LABELS[way]}).",
                share_of((sizes[way] < self.units) & quiet),
                f"share of seeds with fewer than {self.units} units, and none added in the last tenth of the "
                "decisions,",
                note=f"{median_of(sizes[way]).words('units')}; the last was added after "
                f"{last_added(values, layout, way)} decisions.",
                kind="extension",
                source="sections 6.4.1 and 6.4.3, which leave the criterion open; our own",
            )
            yield above(
                -0.02,
                f"With these units, the final reward is as high ({layout}; {CRITERION_LABELS[way]}).",
                mean_of(ends[way] - ends["clock"]),
                "final reward minus that by the clock",
                "reward per decision",
                note=f"{late}{ends[way].mean():.3f}; by the clock {ends['clock'].mean():.3f}.",
                kind="extension",
            )
            yield positive(
                "Over the whole practice, the reward is higher, because disturbances are fewer "
                f"({layout}; {CRITERION_LABELS[way]}).",
                mean_of(lives[way] - lives["clock"]),
                "reward over all decisions minus that by the clock",
                "reward per decision",
                note=f"{late}{lives[way].mean():.3f}; by the clock {lives['clock'].mean():.3f}.",
                kind="extension",
            )


def final_reward(values: Values, layout: str, way: str) -> np.ndarray:
    """Mean reward over the last decisions, `(seeds,)`; by the clock, those after the last unit has settled."""
    late = values["decision"] > (1 - END) * values["decision"][-1]
    if way == "clock":
        late = learning_phase(values["decision"], round(values["decision"][-1] / INTERVAL) - 1)
    return values[f"{layout} {way} reward"][:, late].mean(1)


def last_added(values: Values, layout: str, way: str) -> str:
    """When the last unit was added, median over seeds, in words."""
    units = values[f"{layout} {way} units"]
    return f"{np.median(values['decision'][(units == units[:, -1:]).argmax(1)]):,.0f}"


def _by_units(axes: Axes, reward: np.ndarray, units: np.ndarray, colour: str, least: int) -> None:
    """Reward at the end of the time with each number of units, mean and interval over the seeds that had it for at
    least `least` records: longer than the newest unit takes to shrink."""
    count = []
    found = []
    for number in range(1, int(units.max()) + 1):
        there = (units == number).sum(1) >= least
        if there.sum() < MIN_SEEDS:
            continue
        last = [
            row[np.flatnonzero(had == number)[-2:]].mean() for row, had in zip(reward[there], units[there], strict=True)
        ]
        count.append(number)
        found.append(mean_of(last))
    if count:
        draw_intervals(axes, count, found, fmt="o-", markersize=3, color=colour, linewidth=1)
