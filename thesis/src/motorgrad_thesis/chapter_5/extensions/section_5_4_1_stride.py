"""Section 5.4.1: a hexapod driven by a clock learns the period of its strides, up and down slopes."""

import dataclasses
from collections.abc import Iterator
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.learning import Learner
from motorgrad.policies import GradedHyperplanes, graded_hyperplanes
from motorgrad.schema import count, number, static
from motorgrad.statistics import mean_of
from motorgrad.tasks import HexapodStride
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, at_least, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, subplots
from motorgrad_thesis.chapter_5.extensions._muscle_study import frozen_readings

STRIDE_KINDS = ("slope", "constant")
"""Learned as a function of the pitch, and as a constant."""

RECORDS = 60
STRIDE_STYLES = {"slope": ("C0", "learned, function of the pitch"), "constant": ("C1", "learned, constant")}


@experiment("sec-5.4.1-stride", "a stride period that adapts to slopes", "section 5.4.1")
class StridePeriod(Experiment):
    """A hexapod whose tripods alternate by an open-loop clock learns the period of the clock by policy gradient on
    ground that rises and falls: as a linear function of the pitch that it senses, and as one number. For comparison,
    clocks of fixed periods on the same slopes: the initial one, the best one, and the best one for each slope.
    """

    first_seed: ClassVar[int] = 100
    """Some of the earlier seeds were used to choose the settings."""

    seconds: float = number(300.0, 0, open_low=True, unit="simulated s", help="length of every hexapod's practice")
    seeds: int = count(20, 2, 10_000, help="number of hexapods of each kind")
    periods: tuple[float, ...] = static(
        (0.12, 0.14, 0.16, 0.18, 0.2, 0.24, 0.3, 0.4), unit="s", help="periods of the fixed clocks, rising"
    )
    starts: int = count(8, 2, 1_000, help="number of random phases from which each fixed clock starts on each slope")
    watched: float = number(
        6.0,
        0,
        3600,
        open_low=True,
        unit="simulated s",
        help="length of the evaluation of each on each slope, without learning",
    )

    def validate(self) -> None:
        super().validate()
        self.check_least(seconds=RECORDS * self.task.period, watched=self.task.period)
        self.check_rising("periods", 2)
        shortest, longest = self.task.shortest, self.task.longest
        within = shortest <= self.periods[0] and self.periods[-1] <= longest
        check(within, "periods", self.periods, f"from {shortest} to {longest} s")

    quick = smoke(seconds=1.2, seeds=2, periods=(0.16, 0.3), starts=2, watched=0.2)

    @property
    def task(self) -> HexapodStride:
        return HexapodStride()

    def learner(self, kind: str) -> Learner:
        """The task's own learner, with parameters averaged over the second half of the practice; for `"constant"`, the
        pitch has no effect."""
        rates = dict(self.task.learner["learning_rate"])
        rates = rates if kind == "slope" else rates | {"weights": 0.0}
        return agent_for(self.task, learning_rate=rates, averaging={"start": self.decisions // 2})

    @property
    def decisions(self) -> int:
        return round(self.seconds / self.task.period)

    def run(self, work: Workspace) -> Values:
        task = self.task
        found = {}
        seeds = list(range(self.first_seed, self.first_seed + self.seeds))
        for kind in STRIDE_KINDS:
            run = work.train(task, self.learner(kind), self.decisions, seeds)
            decision, speed = run.curve("speed")
            found |= {"time": decision * task.period, f"{kind} curve": speed}
            found[f"{kind} periods"] = run.curve("period")[1]
            found |= work.part(f"{kind} watched", lambda kind=kind, run=run: self._on_slopes(work, kind, run.policies))
        grid = np.array([*self.periods, task.start])
        fixed = work.part("fixed", lambda: self._on_slopes(work, "fixed", _clocks(task, grid, self.starts)))
        shape = (len(grid), self.starts, len(task.slopes))
        found["fixed speed"] = fixed["fixed speed"].reshape(shape)
        found |= {"grid": grid, "slopes": np.array(task.slopes)}
        return found

    def _on_slopes(self, work: Workspace, name: str, policies: Any) -> Values:
        """Speed and mean period of each policy on each slope, `(policies, slopes)`, without exploration."""
        grounds = [dataclasses.replace(self.task, slopes=(slope,)) for slope in self.task.slopes]
        seen = [
            frozen_readings(work, policies, ground, self.watched, "mode", ("speed", "period")) for ground in grounds
        ]
        return {f"{name} {what}": np.stack([each[what] for each in seen], axis=1) for what in ("speed", "period")}

    def figure(self, values: Values) -> Figure:
        """Learning curves; speed and period over the slope; and speed over fixed periods."""
        figure, panels = subplots(10, 7, 2, 2)
        _learning(panels[0, 0], values)
        _speeds(panels[0, 1], values)
        _grid(panels[1, 0], values)
        _periods(panels[1, 1], values)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        fixed = values["fixed speed"]
        over_slopes = fixed.mean(-1)
        began = over_slopes[-1].mean()
        best = over_slopes[:-1].mean(1).max()
        constant = values["constant speed"].mean(1)
        adaptive = values["slope speed"].mean(1)
        yield positive(
            "Policy gradient learns a stride period that is faster than the initial one.",
            mean_of(constant - began),
            "one learned period, mean over the slopes: difference",
            "m/s",
            note=f"{constant.mean():.2f} m/s; at {values['grid'][-1]:g} s, {began:.2f} m/s.",
        )
        yield at_least(
            0.9,
            "It reaches the best of the fixed periods.",
            mean_of(constant / best),
            "speed relative to it, mean over the slopes,",
            note=f"The best is {values['grid'][over_slopes[:-1].mean(1).argmax()]:g} s, at {best:.2f} m/s.",
            kind="extension",
        )
        yield positive(
            "If the period is a function of the pitch, strides last longer uphill than downhill.",
            mean_of(values["slope period"][:, -1] - values["slope period"][:, 0]),
            "between the two steepest slopes: difference",
            "s",
        )
        yield positive(
            "A period that depends on the pitch is faster than a constant one.",
            mean_of(adaptive - constant),
            "mean over the slopes, paired by seed: difference",
            "m/s",
            note=f"{adaptive.mean():.2f} m/s and {constant.mean():.2f} m/s.",
        )
        yield positive(
            "There is potential: the best period for each slope is faster than the best one for all.",
            mean_of(room_for_slopes(fixed[:-1])),
            "both chosen by the other starts, mean over the slopes: difference",
            "m/s",
        )


def room_for_slopes(speed: np.ndarray) -> np.ndarray:
    """Advantage (m/s) of the best period for each slope over the best one for all slopes, `(periods, starts, slopes)`
    to `(starts,)`. For each start, both are chosen by the other starts, so that selection introduces no bias."""
    gains = []
    for start in range(speed.shape[1]):
        others = np.delete(speed, start, axis=1).mean(1)
        each = speed[others.argmax(0), start, np.arange(speed.shape[2])].mean()
        gains.append(each - speed[others.mean(1).argmax(), start].mean())
    return np.array(gains)


def _clocks(task: HexapodStride, periods: np.ndarray, starts: int) -> GradedHyperplanes:
    """Policies with these fixed periods, each repeated, along a leading axis."""
    one = graded_hyperplanes(task)
    levels = jnp.repeat(jnp.asarray(task.start / periods - 1.0, jnp.float32), starts)[:, None]
    many = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (len(levels), *leaf.shape)), one)
    return eqx.tree_at(lambda policy: policy.bias, many, levels)


def _learning(axes: Axes, values: Values) -> None:
    records = max(1, len(values["time"]) // 20)
    for kind, (colour, label) in STRIDE_STYLES.items():
        draw_band(axes, values["time"], values[f"{kind} curve"], colour, label, records=records)
    axes.set(xlabel="simulated s of practice", ylabel="speed while exploring, m/s", ylim=(0, None))
    axes.legend(loc="lower right", fontsize=8.5)


def _speeds(axes: Axes, values: Values) -> None:
    slopes = values["slopes"]
    fixed = values["fixed speed"].mean(1)
    grid = values["grid"]
    best = fixed[:-1].mean(1).argmax()
    axes.plot(slopes, fixed[:-1].max(0), color="0.75", linewidth=5, label="best fixed period for each slope")
    axes.plot(slopes, fixed[best], "--", color="0.2", label=f"best fixed period for all, {grid[best]:g} s")
    axes.plot(slopes, fixed[-1], ":", color="0.2", label=f"initial period, {grid[-1]:g} s")
    for kind, (colour, label) in STRIDE_STYLES.items():
        _quartiles(axes, slopes, values[f"{kind} speed"], colour, label)
    axes.set(xlabel="slope, degrees (positive uphill)", ylabel="speed, m/s", xticks=slopes)
    axes.set_ylim(0, 1.35 * axes.get_ylim()[1])
    axes.legend(loc="upper right", fontsize=8.5)


def _grid(axes: Axes, values: Values) -> None:
    grid = values["grid"][:-1]
    slopes = values["slopes"]
    speed = values["fixed speed"][:-1].mean(1)
    for index, slope in enumerate(slopes):
        shade = 0.15 + 0.7 * index / max(1, len(slopes) - 1)
        colour = (shade, 0.3, 1.0 - shade)
        axes.plot(grid, speed[:, index], "o-", color=colour, markersize=3, label=f"{slope:+g}°")
    axes.set(xlabel="fixed period of a stride, s", ylabel="speed, m/s")
    axes.legend(title="slope", fontsize=8.5)


def _periods(axes: Axes, values: Values) -> None:
    slopes = values["slopes"]
    speed = values["fixed speed"][:-1].mean(1)
    axes.plot(slopes, values["grid"][speed.argmax(0)], "s", color="0.5", label="best fixed period for each slope")
    for kind, (colour, label) in STRIDE_STYLES.items():
        _quartiles(axes, slopes, values[f"{kind} period"], colour, label)
    axes.set(xlabel="slope, degrees (positive uphill)", ylabel="period of a stride, s", ylim=(0, None), xticks=slopes)
    axes.legend(loc="lower left", fontsize=8.5)


def _quartiles(axes: Axes, x: np.ndarray, values: np.ndarray, colour: str, label: str) -> None:
    """Median over seeds, with quartiles as bars."""
    low, middle, high = np.percentile(values, [25, 50, 75], axis=0)
    axes.errorbar(
        x, middle, [middle - low, high - middle], color=colour, capsize=3, marker="o", markersize=4, label=label
    )
