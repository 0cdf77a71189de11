"""Figure 4.3: the policies that pools learn for the linear mapping."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from motorgrad.policies import Motoneurons
from motorgrad.statistics import median_of, share_of
from motorgrad.tasks import LinearRecruitment
from motorgrad.worlds import mean_field
from motorgrad_thesis._claims import Claim, more_than_half, within
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Figure, subplots
from motorgrad_thesis.chapter_4._pools import (
    IDEAL,
    RATE,
    SPACED,
    LinearStudy,
    draw_pool,
    draw_thresholds,
    equally_spaced_from,
    parameter_history,
    spacing_deviation,
    thresholds_and_gains,
    whose,
)

SOON = {2: 1_500_000, 4: 4_000_000}
"""Decisions by which most pools should be equally spaced at the thesis's step size; inversely proportional to it."""

# the mean field is computed for this many pools of up to this many units
STARTS = 24
MAX_MEAN_FIELD_UNITS = 4
SOFT = 2.0
HARD = 20.0
"""Bounds of a moderate gain, times the spacing. At the lower bound, a unit is uncertain (10 to 90 %) over two spacings,
at the upper over a fifth of one."""


@experiment("fig-4.3", "learned linear policies", "figure 4.3")
class LinearPolicies(LinearStudy):
    """Policies that pools learn for the linear mapping. Colour: the exact probability of each number of active units.
    Black: the expected number. Red: the thresholds. Dotted: the ideal mapping. Above, the median pool; below, the
    thresholds of every seed."""

    def run(self, work: Workspace) -> Values:
        found: Values = {"units": np.array(self.units)}
        for units in self.units:
            task = self.task(units)
            run = self.trained(work, task)
            (threshold, gain) = parameter_history(run)
            decision = run.curve()[0]
            off = spacing_deviation(threshold, gain, task)
            # the last record by then, or the first if all are later
            soon = SOON[units] * RATE / self.rate if units in SOON else self.steps
            at = max(0, int(np.searchsorted(decision, soon, "right")) - 1)
            found |= {
                f"threshold {units}": threshold[:, -1],
                f"gain {units}": gain[:, -1],
                f"off {units}": off[:, -1],
                f"soon {units}": decision[at],
                f"off soon {units}": off[:, at],
            }
            if units <= MAX_MEAN_FIELD_UNITS:
                starts = thresholds_and_gains(run.initial)[0][:STARTS]
                found[f"mean field {units}"] = mean_field_times(task, starts, self.rate)
        return found

    def figure(self, values: Values) -> Figure:

        sizes = values["units"].tolist()
        figure, panels = subplots(2.7 * len(sizes) + 0.8, 5.2, 2, len(sizes), height_ratios=[1.5, 1], squeeze=False)
        inputs = np.linspace(0, 1, 401)
        mesh: Any = None
        for (policy, seeds), units in zip(panels.T, sizes, strict=True):
            task = self.task(units)
            thresholds, gains, off = (values[f"{what} {units}"] for what in ("threshold", "gain", "off"))
            order = np.argsort(off, kind="stable")
            middle = order[len(order) // 2]
            mesh = draw_pool(policy, thresholds[middle], gains[middle], inputs)
            policy.plot(inputs, units * task.target(inputs), color=IDEAL, linestyle=":", linewidth=1.6)
            policy.set_title(f"{units} units")
            for ideal in task.ideal_thresholds():
                seeds.axvline(ideal, color=IDEAL, linestyle=":", linewidth=1)
            draw_thresholds(seeds, thresholds, gains, (0, 1), order)
            seeds.set(xlabel="input $x$", title=f"equally spaced: {np.sum(off < SPACED)} of {len(off)}")
            seeds.title.set_fontsize(9)
        panels[0, 0].set_ylabel("active units")
        panels[1, 0].set_ylabel("thresholds, every seed")
        figure.colorbar(mesh, ax=panels[0], label="probability", aspect=14, pad=0.01)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        sizes = values["units"].tolist()
        for units in sizes:
            spaced = share_of(values[f"off {units}"] < SPACED)
            known = values.get(f"mean field {units}")
            yield more_than_half(
                f"{units} units learn the optimal policy: equally spaced thresholds.",
                spaced,
                note=f"After {self.steps:,} decisions, every threshold is within {SPACED:g} spacings of its ideal "
                "place, and every gain is positive."
                + ("" if known is None else f" In the mean field, this takes {_millions(known)}."),
                source="section 4.3.1, figure 4.3",
                kind=whose(units),
                of="Policies converge to the optimal policy of equally spaced thresholds.",
            )
        for units in (units for units in sizes if units in SOON):
            at = int(values[f"soon {units}"])
            spaced = share_of(values[f"off soon {units}"] < SPACED)
            yield more_than_half(
                f"{units} units are equally spaced by {at:,} decisions.",
                spaced,
                kind="reference model",
                source=f"the mean field: after {_millions(values[f'mean field {units}'])}",
            )
        for units in sizes:
            spacing = 1 / (units * self.task(units).slope)
            positive = np.mean((values[f"gain {units}"] > 0).all(1))
            yield within(
                SOFT,
                HARD,
                f"The gains of {units} units are moderate.",
                median_of(np.median(values[f"gain {units}"], axis=1) * spacing),
                unit="times the spacing",
                note=f"The median unit of each pool after {self.steps:,} decisions; {positive:.0%} of the pools have "
                "only positive gains. Gains keep growing, ever more slowly.",
                source="section 4.3.1",
                kind=whose(units),
                of="Its gains are moderate.",
            )


def mean_field_times(task: LinearRecruitment, thresholds: np.ndarray, rate: float) -> np.ndarray:
    """Decisions until pools are equally spaced for good in the mean field, from gains of 0 and these thresholds,
    `(pools, units)` to `(pools,)`; infinity if that takes more than ten million at the thesis's step size."""
    times = np.linspace(0, 1e7, 1001) * RATE / rate
    nodes, weights = np.polynomial.legendre.leggauss(64)
    loads = (task.low + (task.high - task.low) * (nodes + 1) / 2)[:, None]

    def off(start: np.ndarray) -> np.ndarray:
        pool = Motoneurons(start, np.zeros(task.units))
        way = mean_field(pool, loads, weights / 2, task.immediate, rate, times)
        return spacing_deviation(np.asarray(way.threshold), np.asarray(way.gain), task)

    return equally_spaced_from(times, np.stack([off(start) for start in thresholds]))


def _millions(times: np.ndarray) -> str:
    """The mean time, in words."""
    return f"{times.mean() / 1e6:.3g} million decisions (mean of {len(times)} starts)"
