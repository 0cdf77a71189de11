"""Section 4.4.1: a baseline that forgets, for a muscle or a load that changes."""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, Literal

import numpy as np

from motorgrad._errors import check
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import mean_of
from motorgrad.tasks import Drift, LinearRecruitment
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, subplots
from motorgrad_thesis.chapter_4._pools import NATURAL, least_error

OF: tuple[Literal["strength", "load"], ...] = ("strength", "load")
TITLES = {"strength": "the muscle changes", "load": "the load changes"}


@experiment("sec-4.4.1-baseline", "a baseline that forgets", "section 4.4.1")
class ForgettingBaseline(Experiment):
    """While its pool learns the linear mapping, a muscle repeatedly loses part of its strength and regains it; or a
    load is added to the observed one and removed again. The baseline is the mean of all rewards, as in OLGARB, or moves
    by a fixed step. How well does it track the rewards, and how well does the pool track the change? The natural
    gradient is added for comparison.
    """

    reading: ClassVar[str] = "The linear mapping is 1.2 x − 0.1, its coefficients swapped, as for figure 4.3."

    units: int = count(2, 1, 10_000, help="number of units in each pool")
    seeds: int = count(20, 2, 10_000, help="number of pools of each kind")
    steps: int = count(4_000_000, 2, 10**9, unit="decisions", help="length of the practice of each pool")
    period: int = count(
        2_000_000,
        2,
        10**9,
        unit="decisions",
        help="period of the change, which is absent in the first half and present in the second",
    )
    amount: float = number(
        -0.5, -1, 100, open_low=True, open_high=True, help="relative change of the muscle's strength"
    )
    added: float = number(0.25, help="load that is added, if the load changes; observed loads are from 0 to 1")
    rates: tuple[float, ...] = static(
        (0.001, 0.01, 0.1), allowed=Range(0, 1, open_low=True), help="the fixed steps γ, per decision"
    )

    def validate(self) -> None:
        super().validate()
        self.check_least(steps=self.period)
        check(len(self.rates) > 0, "rates", self.rates, "at least one")
        check(self.amount != 0, "amount", self.amount, "not 0: the muscle must change")
        check(self.added != 0, "added", self.added, "not 0: the load must change")
        for of in OF:
            self.task(of)

    quick = smoke(seeds=3, steps=4_000, period=2_000, rates=(0.01,))

    def task(self, of: Literal["strength", "load"]) -> LinearRecruitment:
        """The task in which strength or load changes."""
        amount = self.amount if of == "strength" else self.added
        return LinearRecruitment(units=self.units, drift=Drift(amount, self.period, "steps", of))

    def learners(self) -> dict[str, dict[str, Any]]:
        """For every line: what differs from the thesis's learner."""
        fixed = {f"γ = {rate:g}": {"baseline": {"kind": "fixed-step", "rate": rate}} for rate in self.rates}
        return {"mean of all": {}, **fixed, "mean of all, natural gradient": NATURAL}

    def run(self, work: Workspace) -> Values:
        found: Values = {
            "line": np.array(list(self.learners())),
            "changes": np.arange(1, 2 * self.steps // self.period) * (self.period // 2),
        }
        for of in OF:
            task = self.task(of)
            runs = [
                work.train(task, agent_for(task, **changes), self.steps, self.seeds)
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
        # a load added to all inputs shifts the target
        moved = dataclasses.replace(task, intercept=task.target(self.added))
        return least_error(moved, 1.0)

    def figure(self, values: Values) -> Figure:
        """For each kind of change: the lag of the baselines, the error of the force, and the error minus that with
        the mean of all rewards."""
        figure, axes = subplots(10, 7.6, 3, len(OF), sharex=True, sharey="row", height_ratios=[1, 1.3, 1])
        for column, each in zip(axes.T, OF, strict=True):
            _draw(column, values, each)
            column[0].set_title(TITLES[each], fontsize=11)
        axes[0, 0].set(ylabel="|baseline − mean reward|", yscale="log", ylim=(1e-3, None))
        axes[1, 0].set(ylabel="mean error of the force", ylim=(0, None))
        axes[2, 0].set(ylabel="error minus that\nwith the mean of all")
        figure.legend(*axes[1, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize=8)
        figure.supxlabel(
            "shaded: weak muscle, or added load; dotted: the least possible error\n"
            "above: median and quartiles of the pools; below: mean with 95 % interval",
            fontsize=9,
            color="0.4",
        )
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for of in OF:
            yield from self._claims(values, of)

    def _claims(self, values: Values, of: str) -> Iterator[Claim]:
        """The claims about pools for one kind of change."""
        after = values["decision"] > values["changes"][0]
        behind, error = (values[f"{name} {of}"][:, :, after].mean(axis=2) for name in ("behind", "error"))
        lines = [str(line) for line in values["line"]]
        changes = "the muscle" if of == "strength" else "the load"
        for row in range(1, len(lines) - 1):
            yield positive(
                f"If {changes} changes, a fixed step ({lines[row]}) tracks the average reward faster than the mean of "
                "all rewards.",
                mean_of(behind[0] - behind[row]),
                "distance of the baseline from the current rewards after the first change: difference",
                "reward",
                note=f"Mean distance {behind[row].mean():.4f}; with the mean of all, {behind[0].mean():.4f}.",
                of="A fixed step tracks a change of the average reward faster.",
            )
            yield positive(
                f"Pools that learn with it ({lines[row]}) track {changes} better.",
                mean_of(error[0] - error[row]),
                "mean error after the first change: difference",
                "of the pool's force",
                note=f"Mean error {error[row].mean():.4f}; with the mean of all, {error[0].mean():.4f}.",
                of="A fixed step of the baseline is useful where the world changes.",
            )
        yield positive(
            f"Pools track {changes} better with the natural gradient than with the plain one.",
            mean_of(error[0] - error[-1]),
            "mean error after the first change: difference",
            "of the pool's force",
            note=f"Mean error {error[-1].mean():.4f}; with the plain one, {error[0].mean():.4f}.",
            kind="extension",
            source="our own expectation, from section 3.1.2",
        )


def _draw(axes: Sequence[Axes], values: Values, of: str) -> None:
    upper, middle, lower = axes
    lines = [str(line) for line in values["line"]]
    decision = values["decision"]
    error = values[f"error {of}"]
    draw_quartiles(upper, decision, values[f"behind {of}"][:-1], lines[:-1])
    draw_quartiles(middle, decision, error, lines)
    draw_least_error(middle, values["changes"], decision[-1], values[f"least {of}"])
    for row in range(1, len(lines) - 1):
        found = [mean_of(each) for each in (error[row] - error[0]).T]
        lower.plot(decision / 1e6, [each.value for each in found], color=f"C{row}", linewidth=1.3)
        low = [each.low for each in found]
        high = [each.high for each in found]
        lower.fill_between(decision / 1e6, low, high, color=f"C{row}", alpha=0.18, linewidth=0)
    for each in axes:
        shade_weak(each, values["changes"], decision[-1])
    lower.set_xlabel("decisions, million")
    lower.axhline(0, color="0.4", linewidth=0.8)


def draw_quartiles(
    axes: Axes, decision: np.ndarray, values: np.ndarray, labels: Sequence[str], colours: Sequence[int] | None = None
) -> None:
    """Median and quartiles over seeds of `values` `(lines, seeds, records)`."""
    for row, label, each in zip(colours or range(len(labels)), labels, values, strict=True):
        draw_band(axes, decision / 1e6, each, f"C{row}", label, linewidth=1.3)


def draw_least_error(axes: Axes, changes: Sequence[float] | np.ndarray, end: float, least: np.ndarray) -> None:
    """The least possible error, in turn with a strong and a weak muscle."""
    edges = np.array([0.0, *changes, end]) / 1e6
    axes.stairs(np.resize(least, len(edges) - 1), edges, baseline=None, color="0.3", linewidth=1, linestyle=":")


def shade_weak(axes: Axes, changes: np.ndarray, end: float) -> None:
    """Shade the times at which the muscle is weak: from the first change to the second, and so on."""
    ends = [*changes, end] if len(changes) % 2 else list(changes)
    for start, stop in zip(ends[::2], ends[1::2], strict=True):
        axes.axvspan(start / 1e6, stop / 1e6, color="0.5", alpha=0.1, linewidth=0, zorder=0)
