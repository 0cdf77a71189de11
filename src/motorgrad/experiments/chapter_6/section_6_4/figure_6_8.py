"""Figure 6.8: the reward of a policy that grows."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motorgrad.experiments._claims import Claim, above, mean_of, more_than_half, moving_mean, share_of
from motorgrad.experiments._experiment import Values, Workspace, experiment
from motorgrad.experiments._figures import Axes, Figure, new_figure
from motorgrad.experiments.chapter_6._local_study import median_row
from motorgrad.experiments.chapter_6.section_6_4._growing_study import (
    INTERVAL,
    RATES,
    GrowingStudy,
    after_units,
    disturbance,
    learning_phase,
)
from motorgrad.tasks import FallingParticle
from motorgrad.training import settings_for

INDEPENDENT = {1: 0.033, 5: 0.141, 9: 0.154, 13: 0.175, 19: 0.184}
"""Reward per decision of an independent model after so many units."""

WITHIN = 0.03
DROP, DROP_WITHIN = 0.13, 0.03
PEAK = 13
RIGHT_FIRST = ((0.4, 0.0), (-0.4, 0.0))
STATIC = {"static": {}, "static like grown": {"policy_settings": {"copies": 2, "p_max": 0.5}, "rates": RATES}}
AVERAGES = (50, 500)  # episodes


@experiment("fig-6.8", "the reward of a policy that grows", "figure 6.8")
class GrowingReward(GrowingStudy):
    """The reward in R3 of a policy that grows, against episodes, with the additions; that of a typical seed and of all.
    Beside it eight units that are there from the start, and what growth is worth if the first unit pushes to the right.

    **Arguments:**

    - `units`: of the pool, which is full in the end; 20 take 8,000 episodes.
    - `seeds`: learners of each kind.
    """

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name, task in (
            ("grown", FallingParticle(layout="R3", units=self.units)),
            ("right first", FallingParticle(layout="R3", units=self.units, forces=RIGHT_FIRST)),
        ):
            run = self.learnt(work, task, self.growing(task))
            decision, reward = run.curve()
            found |= {
                f"{name} reward": reward,
                f"{name} after": after_units(decision, reward, self.units),
                f"{name} drop": disturbance(decision, reward, self.units),
            }
            if name == "grown":
                found |= {"decision": decision, "episode": np.cumsum(run.curve("episodes")[1], axis=1)}
        for name, changes in STATIC.items():
            task = FallingParticle(layout="R3")
            found[f"{name} reward"] = self.learnt(work, task, settings_for(task, **changes)).curve()[1]
        found["row"] = np.array(median_row(found["grown after"][:, -1]))
        return found

    def figure(self, values: Values) -> Figure:
        independent = {units: INDEPENDENT[units] for units in self.counts(tuple(INDEPENDENT))}
        return draw_growing_reward(values, self.units, independent, WITHIN)

    def claims(self, values: Values) -> Sequence[Claim]:
        after, other = values["grown after"], values["right first after"]
        made = []
        for units in self.counts(tuple(INDEPENDENT)):
            expected, found = INDEPENDENT[units], mean_of(after[:, units - 1])
            made.append(
                Claim(
                    f"Reward after {units} unit{'s' * (units > 1)}.",
                    "an independent model",
                    f"within {WITHIN:g} of {expected:.3f}",
                    found,
                    abs(found.value - expected) <= WITHIN,
                    "reward per decision",
                    f"{mean_of(other[:, units - 1])} where the first unit pushes to the right.",
                )
            )
        drop = mean_of(values["grown drop"].mean(1))
        made.append(
            Claim(
                "A large drop in reward as each new unit disrupts the dynamics.",
                "figure 6.8; an independent model",
                f"within {DROP_WITHIN:g} of {DROP:g}: the last record before an addition less the first after it",
                drop,
                abs(drop.value - DROP) <= DROP_WITHIN,
                "reward per decision",
                f"A record is {int(values['decision'][0]):,} decisions.",
            )
        )
        return [*made, *self._peak(after), *self._static(values)]

    def _peak(self, after: np.ndarray) -> list[Claim]:
        if self.units <= PEAK:
            return []
        best = share_of(np.abs(after.argmax(1) + 1 - PEAK) <= 1)
        later = mean_of(after[:, -1] - after[:, PEAK - 1])
        return [
            more_than_half(
                "Performance peaks after approximately 13 units.",
                "figure 6.8",
                f"the best of all learning phases is that of the {PEAK - 1}th to {PEAK + 1}th unit: in most seeds",
                best,
                note="The thesis saw one run.",
            ),
            Claim(
                "There is no true peak at 13 units.",
                "an independent model",
                f"not less reward after {self.units} units than after {PEAK}: the interval of the difference is not "
                "below 0",
                later,
                later.high > 0,
                "reward per decision",
            ),
        ]

    def _static(self, values: Values) -> list[Claim]:
        made = []
        for name, words in (
            ("static", "with the height 1 and the step sizes of figure 6.5"),
            ("static like grown", "with the height and the step sizes of the grown units"),
        ):
            last = learning_phase(values["decision"], self.units - 1)
            static, grown = (values[f"{each} reward"][:, last].mean(1) for each in (name, "grown"))
            found = mean_of(static - grown)
            made.append(
                above(
                    -0.02,
                    f"Two units at each of 2 × 2 places, there from the start, do as well in two dimensions ({words}).",
                    "an independent model",
                    "not less reward at the end of as many decisions: the interval of the difference above −0.02",
                    found,
                    "reward per decision",
                    f"{static.mean():.3f}, grown {grown.mean():.3f}, in the last learning phase.",
                )
            )
        return made


def draw_growing_reward(values: Values, units: int, independent: Mapping[int, float], within: float) -> Figure:
    """One seed's moving averages as in the thesis; all seeds; and the reward after each unit."""

    figure = new_figure(9.4, 6.6)
    panels: Any = figure.subplot_mosaic([["one", "one"], ["all", "after"]], width_ratios=[1.25, 1])
    _one_seed(panels["one"], values, units)
    _all_seeds(panels["all"], values, units)
    _after(panels["after"], values, units, independent, within)
    return figure


def draw_band(
    axes: Axes, x: np.ndarray, values: np.ndarray, colour: str, label: str, records: int = 1, line: str = "-"
) -> None:
    """Median and quartiles over seeds of a curve, `(seeds, records)`; each point is the mean of so many records."""
    low, median, high = np.percentile(moving_mean(values, records), [25, 50, 75], axis=0)
    axes.fill_between(x[records - 1 :], low, high, color=colour, alpha=0.18, linewidth=0)
    axes.plot(x[records - 1 :], median, line, color=colour, label=label)


def _one_seed(axes: Axes, values: Values, units: int) -> None:
    row = int(values["row"])
    episode, reward = values["episode"][row], values["grown reward"][row]
    each = episode[-1] / len(episode)
    for wanted, colour, width in zip(AVERAGES, ("0.6", "C3"), (0.8, 1.8), strict=True):
        records = max(1, round(wanted / each))
        label = f"last {records * each:.0f} episodes"
        axes.plot(episode[records - 1 :], moving_mean(reward, records), color=colour, linewidth=width, label=label)
    _additions(axes, values["decision"], episode, units)
    axes.set(
        xlabel="episodes",
        ylabel="reward per decision",
        xlim=(0, episode[-1]),
        title=f"seed {row}; lines: a unit is added",
    )
    axes.legend(loc="lower right", ncols=2, fontsize=8)


def _all_seeds(axes: Axes, values: Values, units: int) -> None:
    thousands = values["decision"] / 1e3
    for name, colour, label in (
        ("static", "C2", "eight units from the start"),
        ("static like grown", "C1", "the same, height and rates as grown"),
        ("grown", "C0", "grown"),
    ):
        draw_band(axes, thousands, values[f"{name} reward"], colour, label)
    _additions(axes, values["decision"], thousands, units)
    axes.set(xlabel="thousand decisions", ylabel="reward per decision", title="all seeds, median and quartiles")
    axes.legend(loc="lower right", fontsize=8)


def _after(axes: Axes, values: Values, units: int, independent: Mapping[int, float], within: float) -> None:
    count = np.arange(1, units + 1)
    for name, colour, label in (("right first", "C4", "first to the right"), ("grown", "C0", "first to the left")):
        found = [mean_of(column) for column in values[f"{name} after"].T]
        error = [[each.value - each.low for each in found], [each.high - each.value for each in found]]
        axes.errorbar(count, [each.value for each in found], error, fmt="o-", markersize=3, color=colour, label=label)
    if independent:
        axes.errorbar(
            list(independent), list(independent.values()), within, fmt="s", color="0.2", markersize=5, capsize=3,
            label=f"an independent model, ± {within:g}", zorder=5, linewidth=0.8,
        )  # fmt: skip
    axes.set(xlabel="units", ylabel="reward in the learning phase", title="after each unit, mean and interval")
    axes.legend(loc="lower right", fontsize=8)


def _additions(axes: Axes, decision: np.ndarray, place: np.ndarray, units: int) -> None:
    """A line where each unit but the first was added."""
    for x in np.interp(INTERVAL * np.arange(1, units), decision, place):
        axes.axvline(x, color="0.85", linewidth=0.7, zorder=0)
