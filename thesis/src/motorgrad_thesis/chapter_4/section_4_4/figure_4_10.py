"""Figure 4.10: the local effect of a new unit on a learned pool."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.schema import count, number, static
from motorgrad.statistics import median_of, share_of
from motorgrad.tasks import LinearRecruitment
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, at_least, at_most, below
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, draw_intervals, subplots
from motorgrad_thesis.chapter_4._pools import NATURAL, firing_probability, with_new_unit

LOADS = np.linspace(0, 1, 401)


LOCAL = "The effect of the new unit becomes increasingly local as its gain increases."


@experiment("fig-4.10", "the local effect of a new unit", "figure 4.10")
class LocalEffect(Experiment):
    """A pool that has learned the linear mapping receives one more unit: the change of the mean activation at each
    load, before anything more is learned, against the gain of the new unit.
    """

    reading: ClassVar[str] = "The linear mapping is 1.2 x − 0.1, its coefficients swapped, as for figure 4.3."

    units: int = count(6, 1, 100, help="number of units in the learned pools")
    threshold: float = number(0.5, 0, 1, help="threshold of the new unit, a load")
    gains: tuple[float, ...] = static(
        (0.0, 5.0, 10.0, 20.0, 40.0, 80.0), help="gains of the new unit, rising, the first 0"
    )
    seeds: int = count(24, 2, 10_000, help="number of pools that learn")
    steps: int = count(
        400_000, 200, 10**9, unit="decisions", help="length of the practice of each pool, by the natural gradient"
    )

    def validate(self) -> None:
        super().validate()
        self.check_rising("gains", 2)
        check(self.gains[0] == 0, "gains", self.gains, "rising from 0")

    quick = smoke(seeds=3, steps=2_000)

    def run(self, work: Workspace) -> Values:
        task = LinearRecruitment(units=self.units)
        pools = work.train(task, agent_for(task, **NATURAL), self.steps, self.seeds).policies
        before = firing_probability(pools, LOADS).mean(-1)  # type: ignore[arg-type]
        after = [firing_probability(with_new_unit(pools, self.threshold, gain), LOADS).mean(-1) for gain in self.gains]
        return {
            "load": LOADS,
            "gain": np.array(self.gains),
            "threshold": np.array(self.threshold),
            "before": before,
            "effect": np.abs(np.stack(after) - before),
        }

    def figure(self, values: Values) -> Figure:
        figure, (without, where, width) = subplots(9, 3.6, 1, 3, width_ratios=[1, 1.5, 1])
        load = values["load"]
        for row in values["before"]:
            without.plot(load, row, color="C0", linewidth=0.5, alpha=0.5)
        units = LinearRecruitment(units=self.units, output="ratio")
        without.plot(load, units.target(load), color="0.4", linestyle="--", linewidth=1)
        without.set(xlabel="load", ylabel="mean activation", title=f"{self.units} units, learned", ylim=(-0.02, 1.02))
        shades = np.linspace(0.85, 0.15, len(values["gain"]))
        from matplotlib import colormaps

        for gain, effect, shade in zip(values["gain"], values["effect"], shades, strict=True):
            draw_band(where, load, effect, colormaps["viridis"](shade), f"{gain:g}")
        where.axvline(float(values["threshold"]), color="0.6", linewidth=0.8, linestyle=":")
        where.set(
            xlabel="load",
            ylabel="change of the mean activation",
            title="with a new unit",
            ylim=(0, 1.4 * values["effect"].max()),
        )
        where.legend(title="its gain", fontsize=8, title_fontsize=8, loc="upper center", ncols=3)
        found = [median_of(row) for row in spread(values)]
        draw_intervals(width, values["gain"], found, fmt="o-", markersize=4, color="C0")
        width.set(xlabel="gain of the new unit", ylabel="spread around its threshold", ylim=(0, None))
        width.set(title=f"median of {values['before'].shape[0]}, 95 %")
        for axes in (without, where, width):
            axes.title.set_fontsize(10)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        load = values["load"]
        effect = values["effect"]
        width = spread(values)
        peak = load[effect[-1].argmax(-1)]
        top = f"{values['gain'][-1]:g}"
        yield at_least(
            0.99,
            "At zero gain, the new unit has the most effect at the extremes of the input.",
            median_of(np.minimum(effect[0, :, 0], effect[0, :, -1]) / effect[0].max(-1)),
            "effect at either end, of the greatest,",
            note="Beyond the outermost thresholds, the pool's activation is flat, and so is the effect.",
        )
        yield at_least(
            0.8,
            "The effect becomes more local with every increase of the gain.",
            share_of((np.diff(width, axis=0) < 0).all(axis=0)),
            "share of pools whose spread around the threshold falls at every step",
            of=LOCAL,
        )
        yield at_most(
            0.75,
            f"At a gain of {top}, the effect is less spread than at zero gain.",
            median_of(width[-1] / width[0]),
            "spread relative to that at zero gain",
            of=LOCAL,
            note="The change falls in steps from the threshold to both ends, because the learned "
            "activation is a staircase.",
        )
        yield below(
            0.1,
            f"At a gain of {top}, there is no effect at the extremes.",
            median_of(np.maximum(effect[-1, :, 0], effect[-1, :, -1]) / effect[-1].max(-1)),
            "effect at either end, of the greatest,",
            of=LOCAL,
        )
        yield at_most(
            0.1,
            f"At a gain of {top}, the effect is greatest at the new unit's threshold.",
            median_of(np.abs(peak - values["threshold"])),
            "distance from it",
            "load",
            of=LOCAL,
        )


def spread(values: Values) -> np.ndarray:
    """Root mean square distance from the new unit's threshold, each load weighted by the change there: `(gains,
    seeds)`."""
    square = (values["load"] - values["threshold"]) ** 2
    effect = values["effect"]
    return np.sqrt((effect * square).sum(-1) / effect.sum(-1))
