"""The study of hoppers that learn on variants of their task: the same learner and the same practice for each."""

import abc
import dataclasses
from collections.abc import Mapping

import numpy as np

from motorgrad.schema import count, number
from motorgrad.tasks import Hopper
from motorgrad.training import Evaluation, Run, agent_for, evaluate
from motorgrad_thesis._experiment import Values, Workspace, smoke
from motorgrad_thesis._figures import Axes, draw_band
from motorgrad_thesis.chapter_5._hopper_study import HopperStudy, hop_heights, practice_heights

COLOURS = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")


@dataclasses.dataclass(frozen=True)
class HopperVariants(HopperStudy):
    """Base of experiments that compare hoppers on several variants of the task, with the thesis's learner on each."""

    seconds: float = number(400.0, 0, open_low=True, unit="simulated s", help="length of every hopper's practice")
    seeds: int = count(20, 2, 10_000, help="number of independent hoppers on each variant")

    quick = smoke(seconds=6.0, seeds=2, watched=2.0)

    @property
    @abc.abstractmethod
    def variants(self) -> Mapping[str, Hopper]:
        """The variants of the task by name."""

    def run(self, work: Workspace) -> Values:
        found: Values = {"variants": np.array(list(self.variants))}
        for name, task in self.variants.items():
            seen = work.part(name, lambda task=task: self.practised(work, task))
            found |= {f"{name} {quantity}": values for quantity, values in seen.items()}
        return found

    def practised(self, work: Workspace, task: Hopper) -> Values:
        """What hoppers reach on one variant.

        **Returns** by name: `time` `(records,)` and `practice` `(seeds, records)`, heights of hops during practice;
        for each seed `passed`, as `practice_heights` has it; and of the frozen policies what `measured` returns.
        """
        agent = agent_for(task, decay=self.decay, learning_rate=self.rate)
        run = work.train(task, agent, round(self.seconds / task.period), self.seeds)
        time, heights, passed = practice_heights(run)
        outcome = evaluate(run, round(self.watched / task.period), threads=work.threads)
        return {"time": time, "practice": heights, "passed": passed, **self.measured(task, run, outcome)}

    def measured(self, task: Hopper, run: Run, outcome: Evaluation) -> Values:
        """What frozen policies do: `height` `(seeds,)`, mean height of the hops in m, 0 without a hop; `active`
        `(seeds,)`, mean number of active muscles; and `firing` `(seeds, groups)`, the share of decisions at which each
        group is active."""
        del run
        assert outcome.control is not None
        firing = outcome.control[:, 1:].mean(axis=1)
        return {"height": hop_heights(outcome), "active": firing @ task.group_sizes, "firing": firing}


def draw_practice(axes: Axes, values: Values, names: Mapping[str, str]) -> None:
    """Heights of hops during practice on variants, whose labels `names` gives; at most as many as `COLOURS`."""
    for (name, label), colour in zip(names.items(), COLOURS, strict=False):
        draw_band(axes, values[f"{name} time"], values[f"{name} practice"], colour, label)
    time = values[f"{next(iter(names))} time"]
    axes.set(xlabel="simulated time of practice (s)", ylabel="height of hops (m)", xlim=(0, time[-1]), ylim=(0, None))
