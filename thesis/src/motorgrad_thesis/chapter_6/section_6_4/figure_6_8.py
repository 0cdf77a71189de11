"""Figure 6.8: the reward of a growing policy."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from motorgrad.statistics import mean_of, moving_mean, share_of
from motorgrad.tasks import FallingParticle
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, above, at_least, more_than_half, within
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Axes, Figure, draw_band, draw_intervals, new_figure
from motorgrad_thesis.chapter_6._local_study import median_row
from motorgrad_thesis.chapter_6._pairs import BothPairs, Pair, settings_of
from motorgrad_thesis.chapter_6.section_6_4._growing_study import (
    INTERVAL,
    RATES,
    GrowingStudy,
    after_units,
    disturbance,
    learning_phase,
)

INDEPENDENT = {1: 0.033, 5: 0.141, 9: 0.154, 13: 0.175, 19: 0.184}
"""Reward per decision of an independent model after this many units."""

WITHIN = 0.03
DROP = 0.13
DROP_WITHIN = 0.03
LARGE = 0.25  # part of the reward
PEAK = 13
RIGHT_FIRST = ((0.4, 0.0), (-0.4, 0.0))
STATIC = {"static": {}, "static like grown": {"policy": {"copies": 2, "p_max": 0.5}, "learning_rate": RATES}}
AVERAGES = (50, 500)  # episodes


@experiment("fig-6.8", "the reward of a policy that grows", "figure 6.8")
class GrowingReward(BothPairs, GrowingStudy):
    """The reward of a growing policy in R3 over episodes, with the additions marked: of the median seed and of all. For
    comparison, eight units that are present from the start, and growth with a first unit that pushes to the right.
    """

    def measure(self, work: Workspace, pair: Pair) -> Values:
        found: Values = {}
        for name, task in (
            ("grown", FallingParticle(layout="R3", units=self.units)),
            ("right first", FallingParticle(layout="R3", units=self.units, forces=RIGHT_FIRST)),
        ):
            run = self.learned(work, task, self.growing(task, **settings_of(pair)))
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
            found[f"{name} reward"] = self.learned(work, task, agent_for(task, **changes, **settings_of(pair))).curve()[
                1
            ]
        found["row"] = np.array(median_row(found["grown after"][:, -1]))
        return found

    def learned_reward(self, values: Values) -> Values:
        return {f"{self.units} units": values["grown after"][:, -1]}

    def draw(self, values: Values) -> Figure:
        """Moving averages of one seed as in the thesis; all seeds; and the reward after each unit."""
        independent = {units: INDEPENDENT[units] for units in self.counts(tuple(INDEPENDENT))}
        figure = new_figure(9.4, 6.6)
        panels: Any = figure.subplot_mosaic([["one", "one"], ["all", "after"]], width_ratios=[1.25, 1])
        _one_seed(panels["one"], values, self.units)
        _all_seeds(panels["all"], values, self.units)
        _after(panels["after"], values, self.units, independent, WITHIN)
        return figure

    def judge(self, values: Values, pair: Pair) -> Iterator[Claim]:
        after = values["grown after"]
        other = values["right first after"]
        for units in self.counts(tuple(INDEPENDENT)):
            expected = INDEPENDENT[units]
            yield within(
                expected - WITHIN,
                expected + WITHIN,
                f"Reward after {units} unit{'s' * (units > 1)}.",
                mean_of(after[:, units - 1]),
                unit="reward per decision",
                note=f"{mean_of(other[:, units - 1])} if the first unit pushes to the right.",
                kind="reference model",
            )
        yield within(
            DROP - DROP_WITHIN,
            DROP + DROP_WITHIN,
            f"The drop in reward as a unit is added is {DROP:g}.",
            mean_of(values["grown drop"].mean(1)),
            "the last record before an addition minus the first after it",
            "reward per decision",
            note=f"A record is {int(values['decision'][0]):,} decisions.",
            kind="reference model",
        )
        before = values["grown after"][:, :-1].mean(1)
        yield above(
            LARGE,
            "Each new unit disrupts the dynamics and causes a large drop in reward.",
            mean_of(values["grown drop"].mean(1) / before.mean()),
            "mean drop, relative to the mean reward in the learning phases",
            note="Large: by more than a quarter.",
        )
        yield from self._peak(after)
        yield from self._static(values)

    def _peak(self, after: np.ndarray) -> Iterator[Claim]:
        if self.units <= PEAK:
            return
        yield more_than_half(
            "Performance peaks after approximately 13 units.",
            share_of(np.abs(after.argmax(1) + 1 - PEAK) <= 1),
            f"share of seeds whose best learning phase is that of the {PEAK - 1}th to {PEAK + 1}th unit",
            untested="The thesis reads the number off one run of its own layout of rewards, which it does not give.",
        )
        yield at_least(
            0,
            "There is no true peak at 13 units.",
            mean_of(after[:, -1] - after[:, PEAK - 1]),
            f"reward after {self.units} units minus that after {PEAK}",
            "reward per decision",
            kind="reference model",
        )

    def _static(self, values: Values) -> Iterator[Claim]:
        for name, words in (
            ("static", "with the height 1 and the step sizes of figure 6.5"),
            ("static like grown", "with the height and the step sizes of the grown units"),
        ):
            last = learning_phase(values["decision"], self.units - 1)
            static, grown = (values[f"{each} reward"][:, last].mean(1) for each in (name, "grown"))
            yield above(
                -0.02,
                f"Two units at each of 2 × 2 places, present from the start, do as well in two dimensions ({words}).",
                mean_of(static - grown),
                "difference of final rewards after equally many decisions",
                "reward per decision",
                note=f"{static.mean():.3f}, grown {grown.mean():.3f}, in the last learning phase.",
                kind="reference model",
            )


def _one_seed(axes: Axes, values: Values, units: int) -> None:
    row = int(values["row"])
    episode = values["episode"][row]
    reward = values["grown reward"][row]
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
        ("static like grown", "C1", "the same, height and rates as growing"),
        ("grown", "C0", "growing"),
    ):
        draw_band(axes, thousands, values[f"{name} reward"], colour, label)
    _additions(axes, values["decision"], thousands, units)
    axes.set(xlabel="thousand decisions", ylabel="reward per decision", title="all seeds: median and quartiles")
    axes.legend(loc="lower right", fontsize=8)


def _after(axes: Axes, values: Values, units: int, independent: Mapping[int, float], within: float) -> None:
    count = np.arange(1, units + 1)
    for name, colour, label in (("right first", "C4", "first to the right"), ("grown", "C0", "first to the left")):
        found = [mean_of(column) for column in values[f"{name} after"].T]
        draw_intervals(axes, count, found, fmt="o-", markersize=3, color=colour, label=label)
    if independent:
        axes.errorbar(
            list(independent), list(independent.values()), within, fmt="s", color="0.2", markersize=5, capsize=3,
            label=f"an independent model, ± {within:g}", zorder=5, linewidth=0.8,
        )  # fmt: skip
    axes.set(xlabel="units", ylabel="reward in the learning phase", title="after each unit: mean and interval")
    axes.legend(loc="lower right", fontsize=8)


def _additions(axes: Axes, decision: np.ndarray, place: np.ndarray, units: int) -> None:
    """A line at the addition of each unit but the first."""
    for x in np.interp(INTERVAL * np.arange(1, units), decision, place):
        axes.axvline(x, color="0.85", linewidth=0.7, zorder=0)
