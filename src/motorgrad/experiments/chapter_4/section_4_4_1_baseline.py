"""Section 4.4.1: a baseline that forgets, where the muscle changes."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._claim import Claim, mean_of
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_4._drift_figure import draw_least, draw_lines, shade
from motorgrad.experiments.chapter_4._pools import NATURAL, least_error
from motorgrad.tasks import Drift, LinearRecruitment
from motorgrad.training import settings_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OURS = "our own expectation, from section 3.1.2"


@dataclasses.dataclass(frozen=True)
class ForgettingBaseline(Experiment):
    """A muscle loses part of its strength and regains it, again and again, while its pool learns the linear mapping.
    The baseline is the mean of all rewards, as in OLGARB, or moves by a fixed step. How well does it follow the
    rewards, and how well does the pool follow the muscle? For comparison also the natural gradient.

    **Arguments:**

    - `units`: in each pool.
    - `seeds`: pools of each kind.
    - `steps` (decisions): for which each pool learns.
    - `period` (decisions): of the muscle: strong in the first half, weak in the second.
    - `amount`: by how much its strength changes, as a part.
    - `rates` (per decision): the fixed steps γ.
    """

    name: ClassVar[str] = "sec-4.4.1-baseline"
    title: ClassVar[str] = "a baseline that forgets"
    source: ClassVar[str] = "section 4.4.1"

    units: int = 2
    seeds: int = 20
    steps: int = 4_000_000
    period: int = 2_000_000
    amount: float = -0.5
    rates: tuple[float, ...] = (0.001, 0.01, 0.1)

    def __post_init__(self) -> None:
        check(2 <= self.seeds <= 10_000, "seeds", self.seeds, "in 2 … 10,000")
        check(self.period <= self.steps <= 10**9, "steps", self.steps, "at least one period, at most 1,000,000,000")
        check(len(self.rates) > 0, "rates", self.rates, "at least one")
        check(self.amount != 0, "amount", self.amount, "not 0: the muscle must change")
        for changes in self.learners().values():
            settings_for(self.task, **changes)

    @classmethod
    def quick(cls) -> Self:
        return cls(seeds=3, steps=4_000, period=2_000, rates=(0.01,))

    @property
    def task(self) -> LinearRecruitment:
        return LinearRecruitment(units=self.units, drift=Drift(self.amount, self.period, "steps"))

    def learners(self) -> dict[str, dict[str, Any]]:
        """Of every line, what is not as in the thesis's learner."""
        fixed = {f"γ = {rate:g}": {"baseline": "fixed-step", "baseline_rate": rate} for rate in self.rates}
        return {"mean of all": {}, **fixed, "mean of all, natural gradient": NATURAL}

    def run(self, work: Workspace) -> Values:
        runs = [
            work.train(self.task, settings_for(self.task, **changes), self.steps, self.seeds)
            for changes in self.learners().values()
        ]
        reward, level = (np.stack([run.curve(name)[1] for run in runs]) for name in ("reward", "baseline"))
        return {
            "decision": runs[0].curve()[0],
            "line": np.array(list(self.learners())),
            "changes": np.arange(1, 2 * self.steps // self.period) * (self.period // 2),
            "error": np.stack([run.curve("error")[1] for run in runs]),
            "behind": np.abs(level - reward),
            "least": np.array([least_error(self.task, 1.0), least_error(self.task, 1.0 + self.amount)]),
        }

    def figure(self, values: Values) -> "Figure":
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8, 7.6), layout="constrained")
        upper, middle, lower = figure.subplots(3, 1, sharex=True, height_ratios=[1, 1.3, 1])
        lines, decision, error = [str(line) for line in values["line"]], values["decision"], values["error"]
        draw_lines(upper, decision, values["behind"][:-1], lines[:-1])
        draw_lines(middle, decision, error, lines)
        draw_least(middle, values["changes"], decision[-1], values["least"])
        for row in range(1, len(lines) - 1):
            found = [mean_of(each) for each in (error[row] - error[0]).T]
            lower.plot(decision / 1e6, [each.value for each in found], color=f"C{row}", linewidth=1.3)
            low, high = [each.low for each in found], [each.high for each in found]
            lower.fill_between(decision / 1e6, low, high, color=f"C{row}", alpha=0.18, linewidth=0)
        for axes in (upper, middle, lower):
            shade(axes, values["changes"], decision[-1])
        upper.set(ylabel="|baseline − mean reward|", yscale="log", ylim=(1e-3, None))
        middle.set(ylabel="mean error of the force", ylim=(0, None))
        lower.set(ylabel="error less that\nwith the mean of all", xlabel="decisions, million")
        lower.axhline(0, color="0.4", linewidth=0.8)
        upper.set_title(
            "shaded: the muscle is weak; median and quartiles of the pools; dotted: the least possible",
            fontsize=9,
            color="0.4",
        )
        lower.set_title("mean with 95 % interval", fontsize=9, color="0.4")
        middle.legend(fontsize=8, ncols=2)
        return figure

    def claims(self, values: Values) -> Sequence[Claim]:
        after = values["decision"] > values["changes"][0]
        behind, error = (values[name][:, :, after].mean(axis=2) for name in ("behind", "error"))
        lines, made = [str(line) for line in values["line"]], []
        for row in range(1, len(lines) - 1):
            nearer = mean_of(behind[0] - behind[row])
            better = mean_of(error[0] - error[row])
            made += [
                Claim(
                    f"A fixed step ({lines[row]}) tracks a change of the average reward faster than the mean of all.",
                    "section 4.4.1",
                    "after the first change the baseline is nearer to the present rewards: difference above 0",
                    nearer,
                    nearer.low > 0,
                    "reward",
                    f"Mean distance {behind[row].mean():.4f}, with the mean of all {behind[0].mean():.4f}.",
                ),
                Claim(
                    f"Pools that learn with it ({lines[row]}) follow the muscle better.",
                    "section 4.4.1",
                    "less mean error after the first change: difference above 0",
                    better,
                    better.low > 0,
                    "of the pool's force",
                    f"Mean error {error[row].mean():.4f}, with the mean of all {error[0].mean():.4f}.",
                ),
            ]
        natural = mean_of(error[0] - error[-1])
        return [
            *made,
            Claim(
                "With the natural gradient pools follow the muscle better than with the plain one.",
                OURS,
                "less mean error after the first change: difference above 0",
                natural,
                natural.low > 0,
                "of the pool's force",
                f"Mean error {error[-1].mean():.4f}, with the plain one {error[0].mean():.4f}.",
            ),
        ]
