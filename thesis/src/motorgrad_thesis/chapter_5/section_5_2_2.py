"""Section 5.2.2: the trade-off in the choice of the action period."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import mean_of
from motorgrad.tasks import Hopper
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, subplots
from motorgrad_thesis.chapter_5._hopper_study import (
    HIGH,
    SMOOTH,
    RewardType,
    practice_heights,
)

THESIS = 0.01  # s
PARTS = (0.1, 0.25, 0.5, 1.0)
"""Fractions of the practice after which heights are evaluated."""


SHORT = "A short action period makes learning very slow."


@experiment("sec-5.2.2", "the action period", "section 5.2.2")
class ActionPeriod(Experiment):
    """Hoppers with different action periods practise for the same simulated time: how high they hop, and how soon. A
    short period makes learning slow, because many consecutive decisions must agree on a jump; with a long one, the
    muscles cannot respond in time to the body.
    """

    reading: ClassVar[str] = (
        "The thesis does not say what else changes with the period; here decay and penalty stay as they are "
        "per decision."
    )

    periods: tuple[float, ...] = static(
        (0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64),
        allowed=Range(0, open_low=True),
        unit="simulated s",
        help="time between decisions, at least three, rising",
    )
    seconds: float = number(1500.0, 0, open_low=True, unit="simulated s", help="length of every hopper's practice")
    seeds: int = count(8, 2, 10_000, help="number of hoppers with each period")
    reward_type: RewardType = static(
        "apex", help='when the task rewards a hop: at its first `"apex"`, or at its `"landing"`'
    )
    decay: float = number(0.98, 0, 1, help="decay of the eligibility trace, per decision")
    rate: float = number(5e-4, 0, help="the step size of all parameters")
    constant: Literal["decision", "second"] = static(
        "decision",
        help='what stays the same across periods. With `"decision"`, all numbers do, including the decay of '
        'the trace and the penalty of a muscle per decision; with `"second"`, their effect per second '
        "does, and 10 ms has the given numbers",
    )

    def validate(self) -> None:
        super().validate()
        self.check_rising("periods", 3)
        for period in self.periods:
            self.task(period)
            self.check_least(seconds=10 * period)

    quick = smoke(periods=(0.005, 0.02, 0.08), seconds=6.0, seeds=2)

    def task(self, period: float) -> Hopper:
        """The task with this action period."""
        return Hopper(reward_type=self.reward_type, action_period=period, penalty=Hopper.penalty * self._ratio(period))

    def _ratio(self, period: float) -> float:
        """The period relative to the thesis's, if numbers are constant per second."""
        return period / THESIS if self.constant == "second" else 1.0

    def run(self, work: Workspace) -> Values:
        found = [
            work.part(f"{1000 * period:g} ms", lambda p=period: self._practise(work, p)) for period in self.periods
        ]
        return {
            "period": np.array(self.periods),
            "practice": self.seconds * np.array(PARTS),
            "height": np.stack([one["height"] for one in found]),
            "passed": np.stack([one["passed"] for one in found]),
        }

    def _practise(self, work: Workspace, period: float) -> Values:
        task = self.task(period)
        settings = agent_for(task, decay=self.decay ** self._ratio(period), learning_rate=self.rate)
        run = work.train(task, settings, round(self.seconds / period), self.seeds)
        time, heights, passed = practice_heights(run)
        # the last record that had ended by then; rounding may put the very last one just beyond
        ended = np.searchsorted(time, self.seconds * np.array(PARTS) + period, side="right") - 1
        return {"height": heights[:, np.maximum(ended, 0)], "passed": passed}

    def figure(self, values: Values) -> Figure:
        """Heights after several amounts of practice (left) and practice until hopping (right); one period is marked."""
        from matplotlib import colormaps

        figure, (heights, times) = subplots(9.5, 4.2, 1, 2)
        period = 1000 * values["period"]
        practice = values["practice"]
        shades = colormaps["viridis_r"](np.linspace(0.15, 0.95, len(practice)))
        for index, (shade, seconds) in enumerate(zip(shades, practice, strict=True)):
            style = {"marker": "o", "markersize": 4}
            draw_band(heights, period, values["height"][:, :, index].T, shade, f"{seconds:,.4g} s", **style)
        heights.set(ylabel="height of hops (m)", ylim=(0, None))
        heights.legend(title="after practice of", fontsize=9)
        passed = values["passed"]
        spread = np.exp(np.linspace(-0.08, 0.08, passed.shape[1]))
        times.plot(period[:, None] * spread, passed, "o", color="0.6", markersize=3.5, markeredgewidth=0)
        times.plot(period, np.median(passed, axis=1), "o-", color=shades[-1], markersize=5, label="median")
        times.plot([], [], "o", color="0.6", markersize=3.5, label="one seed")
        if passed.max() > 0.98 * practice[-1]:
            times.axhline(practice[-1], color="0.7", linewidth=1, linestyle="--")
            times.text(
                period[-1], practice[-1], "not within the practice", ha="right", va="bottom", color="0.45", fontsize=9
            )
        times.set(yscale="log", ylabel=f"practice until hops pass {HIGH} m,\nin means over {SMOOTH:g} s (s)")
        times.legend()
        for axes in (heights, times):
            _periods(axes, period, 1000 * THESIS)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        final = values["height"][:, :, -1]
        periods = 1000 * values["period"]
        best = periods[1:-1][np.argmax(final[1:-1].mean(axis=1))]
        soonest = periods[1:-1][np.argmin(values["passed"][1:-1].mean(axis=1))]
        low, late = (mean_of(behind_best(final, end)) for end in (0, -1))
        short = f"{periods[0]:g} ms"
        long = f"{periods[-1]:g} ms"
        chosen = "For each seed, the best period is that of the other seeds, so that selection introduces no bias."
        numbers = {
            "decision": "All other numbers are constant: decay and penalty per decision.",
            "second": "Decay and penalty are constant per second.",
        }[self.constant]
        yield positive(
            f"A short action period makes learning slow: at {short}, hops pass {HIGH} m later than at the best.",
            mean_of(behind_best(-values["passed"], 0)),
            unit="s of practice later",
            note=f"The soonest is {soonest:g} ms; nothing counts before {SMOOTH:g} s. A seed that never passes counts "
            f"with the whole practice. {chosen} {numbers}",
            of=SHORT,
        )
        yield positive(
            f"After the same practice, hoppers that decide every {short} hop lower than at the best period.",
            low,
            unit="m lower",
            note=f"The best is {best:g} ms. {numbers}",
            of=SHORT,
        )
        yield positive(
            f"With too long a period, muscles cannot respond in time: at {long}, hops are lower than at the best.",
            late,
            unit="m lower",
            note=f"The best is {best:g} ms. {numbers}",
            of="With too long an action period, control cannot respond in time.",
        )


def behind_best(values: np.ndarray, end: int) -> np.ndarray:
    """Deficit of each seed at one end of the periods relative to the best of those between, `(seeds,)`.

    **Arguments:** `(periods, seeds)`, greater is better; the row of the end. A seed's best period is chosen by the mean
    of the other seeds.
    """
    between = values[1:-1]
    others = between.sum(axis=1, keepdims=True) - between
    best = np.argmax(others, axis=0)
    return between[best, np.arange(values.shape[1])] - values[end]


def _periods(axes: Axes, period: np.ndarray, marked: float) -> None:
    axes.set_xscale("log")
    axes.set_xticks(period, [f"{one:g}" for one in period])
    axes.xaxis.minorticks_off()
    axes.set_xlabel("action period (ms)")
    if period[0] <= marked <= period[-1]:
        axes.axvline(marked, color="0.8", linewidth=1, zorder=0)
        axes.text(
            marked,
            1.0,
            "thesis",
            transform=axes.get_xaxis_transform(),
            fontsize=8,
            color="0.5",
            va="bottom",
            ha="center",
        )
