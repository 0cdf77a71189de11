"""Beyond section 4.3.1: pools of many motoneurons, by the natural step of each."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._claim import Claim, Measured, median_of, share_of
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_4._linear_study import SPACED, off_place
from motorgrad.experiments.chapter_4._natural_figure import draw
from motorgrad.experiments.chapter_4._pools import NATURAL, parameters
from motorgrad.tasks import LinearRecruitment
from motorgrad.training import settings_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLAIN = {2: 3_000_000, 4: 8_000_000, 8: 40_000_000, 16: 20_000_000}
"""For each pool, how long OLGARB may take: longer than the mean field does, but for the last."""
SHOWN = 16
MOST = 1_000_000
NORMAL: dict[str, Any] = {
    "metric": "fisher",
    "metric_rate": 3e-4,
    "dampings": {"threshold": 0.05, "gain": 1e-6},
    "baseline": "binned",
    "baseline_bins": 64,
    "baseline_rate": 0.02,
    "advantages": "normalised",
    "rate": 1e-3,
}
"""What learns pools of any of these sizes: the natural step with a baseline that sees the load, advantages in units of
their own spread, and a little damping of the gain too."""
WITHOUT: dict[str, tuple[dict[str, Any], tuple[float, ...]]] = {
    "all of it": ({}, (3e-4, 1e-3, 3e-3)),
    "mean baseline": ({"baseline": "mean"}, (3e-4, 1e-3, 3e-3)),
    "plain advantages": ({"advantages": "plain"}, (3e-5, 1e-4, 3e-4)),
    "no damping of the gain": ({"dampings": {"threshold": 0.05}}, (3e-4, 1e-3, 3e-3)),
    "plain gradient": ({"metric": "euclidean"}, (3e-3, 1e-2, 3e-2)),
}
"""The parts left out, one at a time, and step sizes of which each gets the best."""


@dataclasses.dataclass(frozen=True)
class LargePools(Experiment):
    """How long pools of motoneurons take to share a linear mapping equally, by the plain gradient and by the natural
    gradient of each unit. What takes the plain one tens of millions of loads for eight units, and far more for sixteen,
    is learnt by pools of a hundred in a few hundred thousand.

    **Arguments:**

    - `seeds`: for every learner and every pool.
    - `pools` (units): of what sizes the pools are, rising, 16 among them.
    - `dissected` (units): the pool for which parts of the learner are left out.
    - `tries`: how many step sizes each learner without one of its parts may try, from 1 to 3.
    - `share`: the part of the full number of decisions that is made.
    """

    name: ClassVar[str] = "beyond-4.3.1"
    title: ClassVar[str] = "large pools by the natural step"
    source: ClassVar[str] = "beyond section 4.3.1"

    seeds: int = 20
    pools: tuple[int, ...] = (2, 4, 8, 16, 32, 64, 128)
    dissected: int = 32
    tries: int = 3
    share: float = 1.0

    def __post_init__(self) -> None:
        check(2 <= self.seeds <= 1000, "seeds", self.seeds, "in 2 … 1000")
        rising = list(self.pools) == sorted(set(self.pools)) and SHOWN in self.pools and self.pools[0] >= 2
        check(rising and self.pools[-1] <= 1024, "pools", self.pools, "rising numbers from 2 to 1,024, 16 among them")
        check(2 <= self.dissected <= 1024, "dissected", self.dissected, "in 2 … 1,024 units")
        check(1 <= self.tries <= 3, "tries", self.tries, "in 1 … 3")
        check(0 < self.share <= 10, "share", self.share, "above 0, at most 10")

    @classmethod
    def quick(cls) -> Self:
        return cls(seeds=2, pools=(SHOWN,), dissected=SHOWN, tries=1, share=0.002)

    def run(self, work: Workspace) -> Values:
        budgets = {units: min(64_000 * units, MOST) for units in self.pools}
        learners: dict[str, tuple[Mapping[str, Any], dict[int, int]]] = {
            "normal": (NORMAL, budgets),
            "natural": (NATURAL, {units: steps for units, steps in budgets.items() if units <= 32}),
            "plain": ({}, {units: PLAIN[units] for units in self.pools if units in PLAIN}),
        }
        found: Values = {}
        for name, (changes, budgets) in learners.items():
            found[f"{name}_units"] = np.array(list(budgets))
            found[f"{name}_budget"] = np.array([self._steps(steps) for steps in budgets.values()])
            errors = {units: self._errors(work, units, changes, steps) for units, steps in budgets.items()}
            found[f"{name}_times"] = np.array([equal_from(*errors[units]) for units in budgets])
            found[f"{name}_decision"], found[f"{name}_error"] = errors[SHOWN]
        for place, (changes, rates) in enumerate(WITHOUT.values()):
            tried = [
                self._errors(work, self.dissected, {**NORMAL, **changes, "rate": rate, **_rule(changes)}, 200_000)
                for rate in rates[-self.tries :]
            ]
            times = [equal_from(*errors) for errors in tried]
            best = min(range(self.tries), key=lambda i: (np.median(times[i]), np.median(tried[i][1][:, -1])))
            found[f"without_{place}_rate"] = np.array(rates[-self.tries :][best])
            found[f"without_{place}_times"] = times[best]
            found[f"without_{place}_decision"], found[f"without_{place}_error"] = tried[best]
        return found

    def _steps(self, steps: int) -> int:
        return max(200, round(self.share * steps))

    def _errors(
        self, work: Workspace, units: int, changes: Mapping[str, Any], steps: int
    ) -> tuple[np.ndarray, np.ndarray]:
        task = LinearRecruitment(units=units)
        run = work.train(task, settings_for(task, **changes), self._steps(steps), self.seeds)
        return run.curve()[0], off_place(*parameters(run), task)

    def figure(self, values: Values) -> "Figure":
        return draw(values, self.dissected, tuple(WITHOUT), SPACED)

    def claims(self, values: Values) -> Sequence[Claim]:
        made = [self._spaced(values, units) for units in (SHOWN, 64) if units in self.pools]
        place = list(values["plain_units"]).index(SHOWN)
        late = share_of(np.isinf(values["plain_times"][place]))
        made.append(
            Claim(
                f"OLGARB takes {SHOWN} units longer than {values['plain_budget'][place] / 1e6:g} million decisions.",
                "section 3 of the reading",
                "in every seed",
                late,
                late.value == 1,
            )
        )
        made += [_growth(values, "plain", 2.0), _growth(values, "normal", 1.0)]
        whole = values["without_0_times"]
        for place, name in list(enumerate(WITHOUT))[1:]:
            slower = values[f"without_{place}_times"]
            share = share_of(slower > np.median(whole))
            made.append(
                Claim(
                    f"{self.dissected} units need every part: with {name} they are later, at the best step size.",
                    "beyond section 4.3.1",
                    "most seeds are later than the median with all of it",
                    share,
                    share.low > 0.5,
                )
            )
        return made

    def _spaced(self, values: Values, units: int) -> Claim:
        times = values["normal_times"][list(values["normal_units"]).index(units)]
        share = share_of(np.isfinite(times))
        middle = "" if np.isinf(np.median(times)) else f"Median {np.median(times):,.0f}, latest {times.max():,.0f}."
        return Claim(
            f"By the natural step {units} units come to equal spacing within a million decisions, and stay there.",
            "beyond section 4.3.1",
            "every seed, from some record to the end of the run every threshold within a quarter of a spacing",
            share,
            share.value == 1 and values["normal_budget"].max() <= MOST,
            note=middle,
        )


def equal_from(decision: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """For each seed the decision from which its units are equally spaced up to the end; infinity where they are not.

    **Arguments:** `decision` (records,); `errors` (seeds, records).
    """
    wrong = errors >= SPACED
    last = np.where(wrong.any(1), wrong.shape[1] - 1 - np.argmax(wrong[:, ::-1], axis=1), -1)
    return np.append(decision.astype(float), np.inf)[last + 1]


def _rule(changes: Mapping[str, Any]) -> dict[str, Any]:
    """The plain gradient takes no damping."""
    return {"dampings": None} if changes.get("metric") == "euclidean" else {}


def _growth(values: Values, learner: str, power: float) -> Claim:
    """How the time grows with the pool: a line through all seeds' times on doubly logarithmic axes. For OLGARB, a pool
    that did not get there counts with the decisions that it had, which is less than it takes."""
    plain = learner == "plain"
    units, times, budget = (values[f"{learner}_{what}"] for what in ("units", "times", "budget"))
    there = np.isfinite(times)
    kept = there.any(1) if plain else there.all(1)
    measured = Measured(0.0, -np.inf, np.inf, times.shape[1], "median")
    if kept.sum() > 1:
        least = np.where(there, times, budget[:, None])[kept]
        measured = median_of(np.polyfit(np.log(units[kept]), np.log(least), 1)[0])
    over = ", ".join(str(size) for size in units[kept])
    return Claim(
        "The time that OLGARB takes grows faster than the square of the pool."
        if plain
        else "By the natural step it grows more slowly than the pool.",
        "beyond section 4.3.1",
        f"a power {'above' if plain else 'below'} {power:g} of the number of units",
        measured,
        measured.low > power if plain else measured.high < power,
        "power",
        f"Over pools of {over} units." if over else "Too few pools got there.",
    )
