"""Beyond section 4.3.1: large pools of motoneurons, by the natural step of each unit."""

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import Measured, median_of, share_of
from motorgrad.tasks import LinearRecruitment
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, above, below, in_every
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, subplots
from motorgrad_thesis.chapter_4._pools import (
    NATURAL,
    NORMAL,
    SPACED,
    equally_spaced_from,
    parameter_history,
    spacing_deviation,
)

PLAIN = {2: 3_000_000, 4: 8_000_000, 8: 40_000_000, 16: 20_000_000}
"""Decisions that OLGARB may take for each pool: more than the mean field takes, except for the last."""

SHOWN = 16
MAX_DECISIONS = 1_000_000
TRIED = 200_000
WITHOUT: dict[str, tuple[dict[str, Any], tuple[float, ...]]] = {
    "all of it": ({}, (5e-4, 7e-4, 1e-3, 1.5e-3, 2e-3)),
    "mean baseline": ({"baseline": "mean"}, (3e-4, 5e-4, 7e-4, 1e-3, 1.5e-3)),
    "plain gradient": ({"metric": None}, (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)),
    "plain advantages": ({"normalization": None}, (1e-4, 1.5e-4, 2e-4, 2.5e-4, 3e-4)),
    "no damping of the gain": (
        {"metric": {**NORMAL["metric"], "damping": {"threshold": 0.05}}},
        (4e-4, 5e-4, 6e-4, 7e-4, 8e-4),
    ),
}
"""The learner with one part replaced at a time, and the step sizes from which each gets its best: the one with which
most seeds get there, and among those the soonest."""

NEEDED = ("mean baseline", "plain gradient")
"""Parts without which it is not learned at all; without the others it takes longer."""

LEARNERS = {
    "plain": ("OLGARB", "#c8452f", "s"),
    "natural": ("natural step", "#7f8c8d", "^"),
    "normal": ("natural step, input baseline,\nnormalised advantages", "#3b6fb6", "o"),
}
PARTS = ("#3b6fb6", "#e08e2b", "#7f8c8d", "#5b9c51", "#c8452f")


@experiment("beyond-4.3.1", "large pools by the natural step", "beyond section 4.3.1")
class LargePools(Experiment):
    """The time that pools of motoneurons take to share a linear mapping equally, by the plain gradient and by the
    natural gradient of each unit. The plain gradient takes tens of millions of loads for eight units, and far more for
    sixteen; the natural one takes a few hundred thousand for 64.
    """

    reading: ClassVar[str] = "The linear mapping is 1.2 x − 0.1, its coefficients swapped, as for figure 4.3."

    seeds: int = count(20, 2, 1000, help="number of seeds for every learner and every pool")
    pools: tuple[int, ...] = static(
        (2, 4, 8, 16, 32, 64, 128),
        allowed=Range(2, 1024, kind="int"),
        unit="units",
        help="sizes of the pools, rising, 16 among them",
    )
    dissected: int = count(
        32, 2, 1024, unit="units", help="size of the pool for which parts of the learner are replaced"
    )
    tries: int = count(5, 1, 5, help="number of step sizes that each learner with a replaced part may try")
    share: float = number(1.0, 0, 10, open_low=True, help="fraction of the full number of decisions")

    def validate(self) -> None:
        super().validate()
        self.check_rising("pools")
        check(SHOWN in self.pools, "pools", self.pools, f"some with {SHOWN} among them")

    quick = smoke(seeds=2, pools=(SHOWN,), dissected=SHOWN, tries=1, share=0.002)

    def run(self, work: Workspace) -> Values:
        budgets = {
            units: min(64_000 * units, MAX_DECISIONS) if units <= 64 else 2 * MAX_DECISIONS for units in self.pools
        }
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
            found[f"{name}_times"] = np.array([equally_spaced_from(*errors[units]) for units in budgets])
            found[f"{name}_decision"], found[f"{name}_error"] = errors[SHOWN]
        for place, (changes, rates) in enumerate(WITHOUT.values()):
            tried = [
                self._errors(work, self.dissected, {**NORMAL, **changes, "learning_rate": rate}, TRIED)
                for rate in rates[-self.tries :]
            ]
            times = [equally_spaced_from(*errors) for errors in tried]
            best = min(
                range(self.tries),
                key=lambda i: (np.isinf(times[i]).sum(), np.median(times[i]), np.median(tried[i][1][:, -1])),
            )
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
        run = work.train(task, agent_for(task, **changes), self._steps(steps), self.seeds)
        return run.curve()[0], spacing_deviation(*parameter_history(run), task)

    def figure(self, values: Values) -> Figure:
        """Three panels: error over time, time against size, and learners of `dissected` units by the names of `parts`;
        `equal` is the error that counts as equally spaced."""
        parts = tuple(WITHOUT)
        figure, (over, against, without) = subplots(11, 4.4, 1, 3)
        for name, (label, colour, _) in LEARNERS.items():
            _band(over, values[f"{name}_decision"], values[f"{name}_error"], colour, label)
        over.set(xscale="log", title="16 units")
        for name, (label, colour, marker) in LEARNERS.items():
            _against(against, values, name, label, colour, marker)
        _doublings(against, values["normal_units"])
        against.set(
            ylim=(None, 1e10),
            xlabel="units",
            ylabel="decisions until equally spaced for good",
            title="time against size",
        )
        for place, (part, colour) in enumerate(zip(parts, PARTS, strict=True)):
            label = f"{part}, α {float(values[f'without_{place}_rate']):g}"
            _band(without, values[f"without_{place}_decision"], values[f"without_{place}_error"], colour, label)
        without.set(title=f"{self.dissected} units, one part replaced")
        for axes in (over, without):
            axes.axhline(SPACED, color="0.5", linewidth=0.8, linestyle=":")
            axes.set(yscale="log", xlabel="decisions", ylim=(0.01, 1500))
        without.set(xlim=(0, None))
        without.xaxis.set_major_formatter(lambda x, _: f"{x / 1000:g}k")
        over.set_ylabel("greatest deviation of a threshold (spacings)")
        for axes in (over, against, without):
            axes.legend(fontsize=8, loc="upper right")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for units in (SHOWN, 64):
            if units in self.pools:
                yield self._spaced(values, units)
        place = list(values["plain_units"]).index(SHOWN)
        yield in_every(
            f"With OLGARB, {SHOWN} units take more than {values['plain_budget'][place] / 1e6:g} million decisions.",
            np.isinf(values["plain_times"][place]),
            kind="reference model",
        )
        yield _growth_claim(values, "plain", 2.0, 8)
        yield _growth_claim(values, "normal", 1.0, 64)
        if 128 in self.pools:
            yield _growth_claim(values, "normal", 1.0, 128, 64)
        yield from self._parts(values)

    def _parts(self, values: Values) -> Iterator[Claim]:
        """What is lost without each part."""
        whole = float(np.median(values["without_0_times"]))
        for place, name in list(enumerate(WITHOUT))[1:]:
            times = values[f"without_{place}_times"]
            rates = WITHOUT[name][1][-self.tries :]
            rate = float(values[f"without_{place}_rate"])
            edge = rate in (rates[0], rates[-1])
            note = f"The best of the step sizes from {rates[0]:g} to {rates[-1]:g} is {rate:g}" + ", at an end." * edge
            if name in NEEDED:
                said = (
                    f"With {name}, {self.dissected} units do not become equally spaced in {self._steps(TRIED):,} "
                    "decisions."
                )
                yield below(
                    0.5,
                    said,
                    share_of(np.isfinite(times)),
                    "share of seeds in which they do",
                    note=note,
                    kind="extension",
                )
                continue
            late = median_of(np.where(np.isfinite(times), times, self._steps(TRIED)) / min(whole, self._steps(TRIED)))
            said = f"With {name}, {self.dissected} units become equally spaced later."
            yield above(
                1,
                said,
                late,
                "time relative to the median of the whole learner",
                "times as long",
                note=note,
                kind="extension",
            )

    def _spaced(self, values: Values, units: int) -> Claim:
        place = list(values["normal_units"]).index(units)
        times = values["normal_times"][place]
        middle = "" if np.isinf(np.median(times)) else f"Median {np.median(times):,.0f}, latest {times.max():,.0f}."
        return in_every(
            f"With the natural step, {units} units become equally spaced within a million decisions, and stay so.",
            times <= MAX_DECISIONS,
            "share of these seeds in which, from some record to the end, every threshold is within a quarter of a "
            "spacing",
            note=middle,
            kind="extension",
        )


def _growth_claim(values: Values, learner: str, power: float, most: int, least: int = 2) -> Claim:
    """The growth of time with size, from `least` to `most` units: slope of a line through all seeds' times on doubly
    logarithmic axes. A pool that did not get there counts with its whole budget, a lower bound."""
    plain = learner == "plain"
    units, times, budget = (values[f"{learner}_{what}"] for what in ("units", "times", "budget"))
    kept = (units >= least) & (units <= most)
    over = ", ".join(str(size) for size in units[kept])
    measured = Measured(np.nan, -np.inf, np.inf, times.shape[1], "median")
    missing = int(np.isinf(times[kept]).sum())
    if kept.sum() > 1 and (plain or not missing):  # a lower bound cannot show that growth is slow
        taken = np.where(np.isfinite(times), times, budget[:, None])[kept]
        measured = median_of(np.polyfit(np.log(units[kept]), np.log(taken), 1)[0])
    note = f"{missing} runs did not get there, and count with their whole budget." if missing else ""
    if plain:
        said = f"The time of OLGARB grows faster than the square of the number of units, over {over} units."
        return above(power, said, measured, "power of the number of units", note=note, kind="extension")
    said = f"The time of the natural step grows more slowly than the number of units, over {over} units."
    return below(power, said, measured, "power of the number of units", note=note, kind="extension")


def _band(axes: Axes, decision: np.ndarray, errors: np.ndarray, colour: str, label: str) -> None:
    """Median and quartiles over seeds; infinite values are not drawn."""
    low, middle, high = np.quantile(errors, (0.25, 0.5, 0.75), axis=0, method="inverted_cdf")
    axes.plot(decision, np.where(np.isfinite(middle), middle, np.nan), color=colour, label=label, linewidth=1.4)
    axes.fill_between(decision, low, np.where(np.isfinite(high), high, 1e9), color=colour, alpha=0.18, linewidth=0)


def _against(axes: Axes, values: Values, name: str, label: str, colour: str, marker: str) -> None:
    """Median times with the range of all seeds; an arrow from the last decision if half of the seeds
    never got there."""
    units, times, budget = (values[f"{name}_{what}"] for what in ("units", "times", "budget"))
    middle = np.median(times, axis=1)
    there = np.isfinite(middle)
    ends = np.where(np.isfinite(times), times, budget[:, None])
    error = np.abs(np.stack([ends.min(1), ends.max(1)]) - middle)[:, there]
    axes.errorbar(
        units[there], middle[there], error, fmt=f"{marker}-", color=colour, markersize=4, capsize=2, label=label
    )
    for size, last in zip(units[~there], budget[~there], strict=True):
        axes.annotate(
            "", (size, last * 3), (size, last), arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 1.4}
        )
        axes.plot(size, last, marker, color=colour, markersize=4, markerfacecolor="white")


def _doublings(axes: Axes, units: np.ndarray) -> None:
    axes.set(xscale="log", yscale="log")
    axes.set_xticks(units, [str(size) for size in units])
    axes.set_xticks([], minor=True)
