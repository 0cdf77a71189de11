"""Section 4.4: one update at the end of every sweep, against one after every decision."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from motorgrad.bodies import Posture
from motorgrad.schema import Range, count, static
from motorgrad.statistics import mean_of, share_of
from motorgrad.tasks import ArmRecruitment
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, positive, within
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, SubFigure, draw_band, draw_intervals
from motorgrad_thesis.chapter_4._postures import BothPostures, arm_task
from motorgrad_thesis.chapter_4.figure_4_8 import pool_rewards

WAYS: dict[str, dict[str, Any]] = {"end": {}, "online": {"update_every": 1, "reduction": "mean"}}
"""What differs from the thesis's learner, which updates at the end of a sweep by the sum of its samples."""

WORDS = {"end": "at the end of a sweep", "online": "after every decision"}
COLOURS = {"end": "C0", "online": "C3"}
WAITING = "Waiting until the end of the episode helps to prevent convergence to a suboptimal policy."
ALIKE = 0.01  # of the best reward


@experiment("sec-4.4-updates", "updates at the end of a sweep", "section 4.4")
class Updates(BothPostures):
    """Pools learn to lift with one update at the end of every sweep, by the sum of its gradient samples, or with one
    after every decision. With the same step size both move about as far in a sweep, and an online learner sees the
    effect of its steps at once. Larger steps, up to one at every decision that is as large as that of a whole sweep,
    show where the difference begins. With the upper arm held vertically and horizontally.
    """

    units: int = count(4, 1, 64, help="number of units in each pool")
    factors: tuple[float, ...] = static(
        (1.0, 4.0, 16.0, 80.0),
        allowed=Range(0, open_low=True),
        help="step sizes, relative to the thesis's, rising from 1. A sweep has about 80 decisions",
    )
    seeds: int = count(40, 2, 10_000, help="number of pools for each step size and kind of update")
    steps: int = count(200_000, 200, 10**9, unit="decisions", help="length of the practice of each pool")

    def validate(self) -> None:
        super().validate()
        self.check_rising("factors", 2)

    quick = smoke(factors=(1.0, 80.0), seeds=3, steps=2_000)
    size = (9, 3.1)

    def measure(self, work: Workspace, posture: Posture) -> Values:
        task = arm_task(posture, self.units)
        found: Values = {"factor": np.array(self.factors)}
        for way, changes in WAYS.items():
            runs = [
                work.train(task, agent_for(task, learning_rate=step(factor), **changes), self.steps, self.seeds)
                for factor in self.factors
            ]
            pools = [pool_rewards(task, run) for run in runs]
            decision, reward = runs[0].curve("reward")
            found |= {
                "best": pools[0]["best"],
                "decision": decision,
                f"{way} curve": reward,
                f"{way} reward": np.array([each["reward"] for each in pools]),
                f"{way} caught": np.array([(each["gain"] < 0).any(1) for each in pools]),
            }
        return found

    def draw(self, figure: SubFigure, values: Values, posture: Posture) -> None:
        """Learning with the first step size; then over the step size what pools earn after learning, and how many have
        a unit of negative gain."""
        learning, earned, caught = figure.subplots(1, 3)
        best = float(values["best"])
        records = max(1, len(values["decision"]) // 20)
        for way, words in WORDS.items():
            colour = COLOURS[way]
            draw_band(learning, values["decision"] / 1e3, values[f"{way} curve"], colour, words, records=records)
            shift = 0.95 if way == "end" else 1.05
            style = {"fmt": "o-", "markersize": 4, "color": colour, "linewidth": 1}
            rewards = [mean_of(100 * row / best) for row in values[f"{way} reward"]]
            draw_intervals(earned, shift * values["factor"], rewards, label=words, **style)
            shares = [share_of(row) for row in values[f"{way} caught"]]
            draw_intervals(caught, shift * values["factor"], shares, **style)
        learning.axhline(best, color="0.4", linewidth=1, linestyle=":")
        learning.set(xlabel="thousand decisions", ylabel="reward", title="the thesis's step")
        learning.legend(fontsize=8, loc="lower right", title="update", title_fontsize=8)
        earned.set(ylabel="% of the best reward", title="after learning")
        caught.set(ylabel="share of pools", ylim=(0, 1), title="with a unit of negative gain")
        for axes in (earned, caught):
            _step_axis(axes, values["factor"])
        for axes in (learning, earned, caught):
            axes.title.set_fontsize(10)

    def judge(self, values: Values, posture: Posture) -> Iterator[Claim]:
        best = float(values["best"])
        caught = {way: values[f"{way} caught"] for way in WAYS}
        gain = (values["end reward"] - values["online reward"]) / best
        for row, factor in enumerate(values["factor"]):
            thesis = factor == 1
            words = "the thesis's step" if thesis else f"{factor:g} times the thesis's step"
            yield positive(
                f"With updates at the end of a sweep, pools earn more after learning ({words}).",
                mean_of(gain[row]),
                "reward minus that with an update after every decision",
                "of the best reward",
                note=f"Means: {values['end reward'][row].mean():.3f} and {values['online reward'][row].mean():.3f} of "
                f"{best:.3f}. Pools of both kinds start alike.",
                kind="thesis" if thesis else "extension",
                of=WAITING,
            )
            yield positive(
                f"With updates at the end of a sweep, fewer pools have a unit of negative gain ({words}).",
                mean_of(caught["online"][row] * 1.0 - caught["end"][row]),
                "share of pools with updates after every decision minus that with updates at the end",
                note=f"Shares: {share_of(caught['online'][row])} and {share_of(caught['end'][row])}.",
                kind="thesis" if thesis else "extension",
                of=WAITING,
            )
        yield within(
            -ALIKE,
            ALIKE,
            "With the thesis's step, it makes no difference when the parameters are updated.",
            mean_of(gain[0]),
            "reward with updates at the end minus that with an update after every decision",
            "of the best reward",
            note="Stated after a look at other seeds.",
            kind="extension",
            source="our own observation",
        )


def step(factor: float) -> dict[str, float]:
    """The thesis's step sizes on the arm, so many times as large."""
    return {group: factor * rate for group, rate in ArmRecruitment().learner["learning_rate"].items()}


def _step_axis(axes: Axes, factors: np.ndarray) -> None:
    axes.set_xscale("log")
    axes.set_xticks(factors, [f"{factor:g}" for factor in factors])
    axes.minorticks_off()
    axes.set_xlabel("step size / the thesis's")
