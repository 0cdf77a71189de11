"""Section 4.4.1: a baseline that forgets, where the muscle or the load changes."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._claim import Claim, mean_of
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_4._baseline_figure import draw_baselines
from motorgrad.experiments.chapter_4._pools import NATURAL, least_error
from motorgrad.tasks import Drift, LinearRecruitment
from motorgrad.training import settings_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OURS = "our own expectation, from section 3.1.2"
OF: tuple[Literal["strength", "load"], ...] = ("strength", "load")


@dataclasses.dataclass(frozen=True)
class ForgettingBaseline(Experiment):
    """A muscle loses part of its strength and regains it, again and again, while its pool learns the linear mapping; or
    a load is added to the one that is seen, and taken away. The baseline is the mean of all rewards, as in OLGARB, or
    moves by a fixed step. How well does it follow the rewards, and how well does the pool follow the change? For
    comparison also the natural gradient.

    **Arguments:**

    - `units`: in each pool.
    - `seeds`: pools of each kind.
    - `steps` (decisions): for which each pool learns.
    - `period` (decisions): of the change: none in the first half, all in the second.
    - `amount`: by how much the muscle's strength changes, as a part.
    - `added`: the load that is added, where it is that which changes; loads that are seen are from 0 to 1.
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
    added: float = 0.25
    rates: tuple[float, ...] = (0.001, 0.01, 0.1)

    def __post_init__(self) -> None:
        check(2 <= self.seeds <= 10_000, "seeds", self.seeds, "in 2 … 10,000")
        check(self.period <= self.steps <= 10**9, "steps", self.steps, "at least one period, at most 1,000,000,000")
        check(len(self.rates) > 0, "rates", self.rates, "at least one")
        check(self.amount != 0, "amount", self.amount, "not 0: the muscle must change")
        check(self.added != 0, "added", self.added, "not 0: the load must change")
        for of in OF:
            for changes in self.learners().values():
                settings_for(self.task(of), **changes)

    @classmethod
    def quick(cls) -> Self:
        return cls(seeds=3, steps=4_000, period=2_000, rates=(0.01,))

    def task(self, of: Literal["strength", "load"]) -> LinearRecruitment:
        """The task in which this changes."""
        amount = self.amount if of == "strength" else self.added
        return LinearRecruitment(units=self.units, drift=Drift(amount, self.period, "steps", of))

    def learners(self) -> dict[str, dict[str, Any]]:
        """Of every line, what is not as in the thesis's learner."""
        fixed = {f"γ = {rate:g}": {"baseline": "fixed-step", "baseline_rate": rate} for rate in self.rates}
        return {"mean of all": {}, **fixed, "mean of all, natural gradient": NATURAL}

    def run(self, work: Workspace) -> Values:
        found: Values = {
            "line": np.array(list(self.learners())),
            "changes": np.arange(1, 2 * self.steps // self.period) * (self.period // 2),
        }
        for of in OF:
            task = self.task(of)
            runs = [
                work.train(task, settings_for(task, **changes), self.steps, self.seeds)
                for changes in self.learners().values()
            ]
            reward, level = (np.stack([run.curve(name)[1] for run in runs]) for name in ("reward", "baseline"))
            found |= {
                "decision": runs[0].curve()[0],
                f"error {of}": np.stack([run.curve("error")[1] for run in runs]),
                f"behind {of}": np.abs(level - reward),
                f"least {of}": np.array([least_error(task, 1.0), self._least(of)]),
            }
        return found

    def _least(self, of: Literal["strength", "load"]) -> float:
        """The least mean error after the change."""
        task = self.task(of)
        if of == "strength":
            return least_error(task, 1.0 + self.amount)
        # a load that is added to all moves the wanted force by so much
        moved = dataclasses.replace(task, intercept=task.target(self.added))
        return least_error(moved, 1.0)

    def figure(self, values: Values) -> "Figure":
        return draw_baselines(values, OF)

    def claims(self, values: Values) -> Sequence[Claim]:
        return [claim for of in OF for claim in self._claims(values, of)]

    def _claims(self, values: Values, of: str) -> list[Claim]:
        """The claims about pools where this changes: the same for both."""
        after = values["decision"] > values["changes"][0]
        behind, error = (values[f"{name} {of}"][:, :, after].mean(axis=2) for name in ("behind", "error"))
        lines, made = [str(line) for line in values["line"]], []
        changes = "the muscle" if of == "strength" else "the load"
        for row in range(1, len(lines) - 1):
            nearer = mean_of(behind[0] - behind[row])
            better = mean_of(error[0] - error[row])
            made += [
                Claim(
                    f"Where {changes} changes, a fixed step ({lines[row]}) tracks the average reward faster than the "
                    "mean of all.",
                    "section 4.4.1",
                    "after the first change the baseline is nearer to the present rewards: difference above 0",
                    nearer,
                    nearer.low > 0,
                    "reward",
                    f"Mean distance {behind[row].mean():.4f}, with the mean of all {behind[0].mean():.4f}.",
                ),
                Claim(
                    f"Pools that learn with it ({lines[row]}) follow {changes} better.",
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
                f"With the natural gradient pools follow {changes} better than with the plain one.",
                OURS,
                "less mean error after the first change: difference above 0",
                natural,
                natural.low > 0,
                "of the pool's force",
                f"Mean error {error[-1].mean():.4f}, with the plain one {error[0].mean():.4f}.",
            ),
        ]
