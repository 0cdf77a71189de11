"""Section 4.1.2: motor units whose forces are neither uniform nor predictable."""

import dataclasses
from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from motorgrad.schema import count
from motorgrad.statistics import mean_of, share_of
from motorgrad.tasks import LinearRecruitment
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, below, more_than_half
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_intervals, subplots
from motorgrad_thesis.chapter_4._pools import IDEAL, firing_probability, force_error, parameter_history

DRAWS: dict[str, Any] = {
    "equal": lambda generator, units: np.ones(units),
    "log-normal": lambda generator, units: generator.lognormal(sigma=1.0, size=units),
    "exponential": lambda generator, units: generator.exponential(size=units),
}
"""Distributions of the units' forces, by name. A force of less than a hundredth of the mean counts as that."""

LEAST = 0.01
SHARP = 1e3  # gain of units without noise, per load
GRID = np.linspace(0, 1, 101)


@experiment("sec-4.1.2-sizes", "units of random sizes", "section 4.1.2")
class RandomSizes(Experiment):
    """Pools whose units have random forces, log-normal or exponential, which no unit knows, learn the linear mapping by
    the thesis's learner: every pool of a draw has the same units, and starts from thresholds of its own. How far is the
    force from the mapping, before and after learning, and how far with thresholds that are predicted, as the best ones
    of equal units?
    """

    reading: ClassVar[str] = (
        "The linear mapping is 1.2 x − 0.1, its coefficients swapped, as for figure 4.3; the force is counted in mean "
        "units. The thesis names no distribution."
    )

    units: int = count(4, 2, 64, help="number of units in each pool")
    draws: int = count(10, 2, 1_000, help="number of random pools for each distribution")
    seeds: int = count(4, 1, 10_000, help="number of pools with the same units and other starts")
    steps: int = count(2_000_000, 200, 10**9, unit="decisions", help="length of the practice of every pool")

    quick = smoke(draws=2, seeds=2, steps=2_000)

    def task(self, distribution: str, draw: int) -> LinearRecruitment:
        """The task of a pool that is drawn."""
        generator = np.random.default_rng([draw, self.units])
        forces = DRAWS[distribution](generator, self.units)
        forces = np.maximum(forces / forces.mean(), LEAST)
        return LinearRecruitment(units=self.units, strengths=tuple(forces.round(4).tolist()))

    def run(self, work: Workspace) -> Values:
        found: Values = {"load": GRID}
        for distribution in DRAWS:
            draws = range(1 if distribution == "equal" else self.draws)
            pools = [self._learned(work, self.task(distribution, draw)) for draw in draws]
            found |= {f"{distribution} {name}": np.stack([each[name] for each in pools]) for name in pools[0]}
        return found

    def _learned(self, work: Workspace, task: LinearRecruitment) -> Values:
        run = work.train(task, agent_for(task), self.steps, self.seeds)
        threshold, gain = parameter_history(run)
        equal = dataclasses.replace(task, strengths=())
        force = firing_probability(run.policies, GRID) @ task.sizes
        return {
            "size": task.sizes,
            "start": force_error(threshold[:, 0], gain[:, 0], task),
            "error": force_error(threshold[:, -1], gain[:, -1], task),
            "predicted": force_error(np.broadcast_to(equal.ideal_thresholds(), gain[:, -1].shape), gain[:, -1], task),
            "ideal": force_error(task.ideal_thresholds(), np.full(task.units, SHARP), task),
            "force": force,
            "rises": (np.diff(force, axis=1) > 0).all(1) & (force[:, -1] - force[:, 0] > 0.5),
        }

    def figure(self, values: Values) -> Figure:
        """Above: the mean force of every pool over the load, and the mapping. Below: the errors of the force."""
        figure, axes = subplots(9, 5.4, 2, len(DRAWS), sharey="row")
        target = LinearRecruitment(units=self.units).target(GRID)
        for column, distribution in enumerate(DRAWS):
            top, bottom = axes[:, column]
            for draw, forces in enumerate(values[f"{distribution} force"]):
                top.plot(GRID, forces.T, color=f"C{draw % 10}", linewidth=0.6, alpha=0.7)
            top.plot(GRID, target, color=IDEAL, linestyle=":", linewidth=1.6)
            top.set(title=f"{distribution} sizes", xlabel="load", ylim=(-0.05, 1.05))
            rows = [values[f"{distribution} {name}"] for name in ("start", "predicted", "error", "ideal")]
            means = [row.mean(1) if row.ndim == 2 else row for row in rows]
            spread = np.linspace(-0.2, 0.2, len(means[0]))
            for place, mean in enumerate(means):
                bottom.plot(place + spread, np.sort(mean), ".", color=f"C{place}", markersize=4)
                if len(mean) > 1:
                    draw_intervals(bottom, [place + 0.33], [mean_of(mean)], fmt="_", color="0.2", capsize=3)
            words = ["at first", "predicted\nthresholds", "learned", "best, no\nnoise"]
            bottom.set_xticks(range(4), words, fontsize=8)
        axes[1, 0].set_ylim(0, None)
        axes[0, 0].set_ylabel("mean force / full force")
        axes[1, 0].set_ylabel("error of the force\n(root mean square)")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for distribution in list(DRAWS)[1:]:
            found = {
                name: values[f"{distribution} {name}"] for name in ("start", "error", "predicted", "ideal", "rises")
            }
            learned = found["error"].mean(1)
            note = (
                f"Means of the root mean square error: at first {found['start'].mean():.3f}, learned "
                f"{learned.mean():.3f}, with predicted thresholds {found['predicted'].mean():.3f}, best without noise "
                f"{found['ideal'].mean():.3f}."
            )
            yield more_than_half(
                f"Units of random sizes learn to grade the force: it rises with the load ({distribution} sizes).",
                share_of(found["rises"].mean(1) > 0.5),
                "share of draws of which most pools' mean force rises at every load, by more than half in all",
                of="Units whose forces are neither uniform nor predictable learn to grade the force.",
            )
            yield below(
                1,
                f"Learning brings the force closer to the mapping ({distribution} sizes).",
                mean_of(learned / found["start"].mean(1)),
                "error of the force after learning, relative to that at first",
                note=note,
                of="Units whose forces are neither uniform nor predictable learn to grade the force.",
            )
            yield below(
                1,
                f"Thresholds that are learned are better than predicted ones ({distribution} sizes).",
                mean_of(learned / found["predicted"].mean(1)),
                "error of the force after learning, relative to that with the learned gains and the best thresholds of "
                "equal units,",
                note=note,
                of="The best parameters are unpredictable; those that are learned are better than predicted ones.",
            )
