"""Figure 6.9: growing policies widen or narrow an orbit, without episodes."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from motorgrad.statistics import mean_of
from motorgrad.tasks import ParticleOrbit
from motorgrad.training import Run
from motorgrad_thesis._claims import Claim, positive, within
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Axes, Figure, draw_band, new_figure
from motorgrad_thesis.chapter_6._local_study import draw_tile, median_row, policy_at, prefixed, stored_paths
from motorgrad_thesis.chapter_6._pairs import BothPairs, Pair, settings_of
from motorgrad_thesis.chapter_6.section_6_4._growing_study import (
    INTERVAL,
    GrowingStudy,
    after_units,
    grown_policies,
)

WANTED = {"wide": ("distance from the centre is rewarded", "C0"), "narrow": ("it is penalised", "C3")}
INDEPENDENT = {"wide": (0.458, 0.006), "narrow": (0.184, 0.007)}
"""Final radius in an independent model, and half the width of its interval."""

SHOWN = (1, 2, 4, 8, 16)
# decisions; one revolution takes 2π/(k₁ · period)
ONCE_ROUND = 63
SETTLING = 100


@experiment("fig-6.9", "orbits that widen and narrow", "figure 6.9")
class Orbits(BothPairs, GrowingStudy):
    """A particle orbits in a circular field, without episodes, and units that push in eight directions are added one by
    one. If the distance from the centre is rewarded, the orbit widens; if it is penalised, it narrows. Tiles: units and
    path of the median seed for one revolution, at the end of the learning phase after this many units.
    """

    units: int = 16

    def task(self, wanted: Any) -> ParticleOrbit:
        return ParticleOrbit(units=self.units, wanted=wanted)

    def films(self, work: Workspace) -> Mapping[str, Run]:
        tasks = {wanted: self.task(wanted) for wanted in WANTED}
        first = settings_of(self.pairs[0])
        return {
            f"animation-{name}": self.learned(work, task, self.growing(task, **first)) for name, task in tasks.items()
        }

    def measure(self, work: Workspace, pair: Pair) -> Values:
        found: Values = {"counts": np.array(self.counts(SHOWN))}
        for wanted in WANTED:
            task = self.task(wanted)
            run = self.learned(work, task, self.growing(task, **settings_of(pair)))
            decision, radius = run.curve("radius")
            after = after_units(decision, radius, self.units)
            row = median_row(after[:, -1])
            found |= {"decision": decision, f"{wanted} radius": radius, f"{wanted} after": after}
            found[f"{wanted} row"] = np.array(row)
            history = grown_policies(run, list(found["counts"]))
            for number, count in enumerate(found["counts"]):
                policy = policy_at(policy_at(history, number), row)
                found |= prefixed(f"{wanted} {count}", stored_paths(task, policy, 1, ONCE_ROUND, SETTLING))
                found[f"{wanted} {count} centre"] = np.asarray(policy.pool.centre)
                found[f"{wanted} {count} log width"] = np.asarray(policy.pool.log_width)
        return found

    def draw(self, values: Values) -> Figure:

        counts = values["counts"]
        figure = new_figure(10.2, 7.4)
        halves: Any = figure.subfigures(2, 1, height_ratios=[1.75, 1])
        tiles = halves[0].subplots(len(WANTED), len(counts), squeeze=False)
        for row, wanted in zip(tiles, WANTED, strict=True):
            for axes, count in zip(row, counts, strict=True):
                draw_tile(axes, self.task(wanted), values, f"{wanted} {count}", units=int(count))
                radius = values[f"{wanted} after"][int(values[f"{wanted} row"]), count - 1]
                axes.set_title(f"{count} unit{'s' if count > 1 else ''}: radius {radius:.3f}", fontsize=9)
            row[0].set_ylabel(f"{wanted} orbit rewarded", fontsize=9)
        self._curve(halves[1].subplots(), values)
        return figure

    def _curve(self, axes: Axes, values: Values) -> None:
        thousands = values["decision"] / 1e3
        for wanted, (words, colour) in WANTED.items():
            draw_band(axes, thousands, values[f"{wanted} radius"], colour, words)
            expected, half = INDEPENDENT[wanted]
            label = "an independent model" if wanted == "wide" else None
            axes.errorbar(
                thousands[-1] * 1.012, expected, half, fmt="s", color=colour, markersize=4, capsize=3, label=label
            )
        unforced = self.task("wide").physics.orbit_radius
        axes.axhline(unforced, color="0.4", linestyle="--", linewidth=0.8, label=f"without actions, {unforced:.3f}")
        for unit in range(1, self.units):
            axes.axvline(unit * INTERVAL / 1e3, color="0.88", linewidth=0.7, zorder=0)
        axes.set(xlabel="thousand decisions", ylabel="mean radius, all seeds", ylim=(0.1, 0.52))
        axes.legend(loc="upper left", ncols=4, fontsize=8)

    def judge(self, values: Values, pair: Pair) -> Iterator[Claim]:
        for wanted, sign in (("wide", 1), ("narrow", -1)):
            expected, half = INDEPENDENT[wanted]
            unforced = self.task(wanted).physics.orbit_radius
            yield positive(
                f"The orbit {'widens' if sign > 0 else 'narrows'} if {WANTED[wanted][0]}.",
                mean_of(sign * (values[f"{wanted} after"][:, -1] - unforced)),
                f"difference from the radius without actions, {unforced:.3f}, in this direction",
                "of the box",
            )
            yield within(
                expected - half,
                expected + half,
                f"Final radius if the orbit should be {wanted}.",
                mean_of(values[f"{wanted} after"][:, -1]),
                unit="of the box",
                note=f"After {self.decisions:,} decisions, {self.units} units.",
                kind="reference model",
            )
            yield positive(
                f"The second half of the units is useful, too, if the orbit should be {wanted}.",
                mean_of(sign * (values[f"{wanted} after"][:, -1] - values[f"{wanted} after"][:, self.units // 2 - 1])),
                f"difference of the radius with {self.units} units from that with {self.units // 2}, in this "
                "direction,",
                "of the box",
                kind="extension",
            )
