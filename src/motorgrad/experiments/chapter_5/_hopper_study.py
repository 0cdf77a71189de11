"""What the experiments on the hopper share: the learner of section 5.2.2, its training, and how high it hops."""

import dataclasses
import math
from typing import Any, Literal, Self

import numpy as np

from motorgrad import bodies
from motorgrad._errors import check
from motorgrad.experiments._experiment import Experiment, Workspace
from motorgrad.tasks import Hopper
from motorgrad.training import AgentSettings, Evaluation, Run, evaluate, learning_curves, settings_for

SMOOTH = 25.0
"""Simulated seconds over which the heights of hops are averaged."""

HIGH = 0.3
"""A height (m) that random firing does not reach on average: when it is passed, hopping has been learnt."""

Paid = Literal["apex", "landing"]


@dataclasses.dataclass(frozen=True)
class HopperStudy(Experiment):
    """An experiment on hoppers that have practised, by default with the thesis's own numbers.

    **Arguments:**

    - `seconds` (simulated s): length of every hopper's practice.
    - `seeds`: hoppers that practise, each by itself.
    - `paid`: when the task pays for a hop: at its first `"apex"`, or at its `"landing"`.
    - `decay`: of the eligibility trace, per decision.
    - `rate`: the step size of all parameters.
    - `action_period` (simulated s): from one decision to the next.
    - `watched` (simulated s): for which the frozen policies are watched.
    """

    seconds: float = 1500.0
    seeds: int = 16
    paid: Paid = "apex"
    decay: float = 0.98
    rate: float = 5e-4
    action_period: float = 0.01
    watched: float = 20.0

    def __post_init__(self) -> None:
        task, _ = self.task, self.learner
        check_practice(self.seconds, self.seeds, task.period)
        check(
            2 * task.period <= self.watched <= 3600, "watched", self.watched, f"in {2 * task.period} … 3600 simulated s"
        )

    @classmethod
    def quick(cls) -> Self:
        return cls(seconds=20.0, seeds=3, watched=4.0)

    @property
    def task(self) -> Hopper:
        return Hopper(paid=self.paid, action_period=self.action_period)

    @property
    def learner(self) -> AgentSettings:
        return settings_for(self.task, decay=self.decay, rate=self.rate)

    def trained(self, work: Workspace) -> Run:
        """The hoppers that have practised; those of another experiment with the same settings, where there are some."""
        return work.train(self.task, self.learner, round(self.seconds / self.task.period), self.seeds)

    def watch(self, work: Workspace, run: Run, untrained: bool = False) -> Evaluation:
        """The policies of all seeds act from a fresh start, without learning."""
        return evaluate(run, round(self.watched / self.task.period), untrained=untrained, threads=work.threads)


def check_practice(seconds: float, seeds: int, period: float) -> None:
    """Refuse an impossible length of practice, or number of seeds."""
    check(period <= seconds < math.inf, "seconds", seconds, f"a finite time of at least one decision, {period} s")
    check(1 <= seeds <= 10_000, "seeds", seeds, "in 1 … 10,000")


def hop_heights(outcome: Evaluation) -> np.ndarray:
    """The mean height (m) of each seed's hops in an evaluation; 0 for a seed that never hopped."""
    return np.nan_to_num(outcome.readings["apex"])


def median_seed(run: Run, outcome: Evaluation) -> int:
    """The seed in the middle, not the best: a figure should show what to expect."""
    order = np.argsort(hop_heights(outcome), kind="stable")
    return run.seeds[int(order[len(order) // 2])]


def practice_heights(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """How high the hops were during practice, in means over the last `SMOOTH` simulated seconds.

    **Returns:** simulated seconds `(records,)`, and heights in m `(seeds, records)`, 0 where there was no hop.
    """
    record = run.config["run"]["window"] * run.task.period
    shown: Any = learning_curves([run], "apex", x="simulated", smooth=max(SMOOTH, 2 * record))
    (curve,) = shown.curves
    return curve.x, np.nan_to_num(curve.values)


def time_to_height(height: float, time: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """When each seed's hops first were higher than `height`, `(seeds,)`; the whole practice for those that never were.

    Before `SMOOTH` seconds nothing counts: the mean would be over a few hops only.
    """
    passed = (heights > height) & (time >= min(SMOOTH, time[-1]))
    return np.where(passed.any(axis=1), time[np.argmax(passed, axis=1)], time[-1])


def posture(body: bodies.Hopper, interior: float) -> np.ndarray:
    """The coordinates `(6,)` with both knees at `interior` (rad) and the sole on the floor."""
    knee = interior - np.pi / 2
    rise = 2 * body.link_length * (np.sin(interior / 2) - np.sin(np.pi / 4))
    return np.array([rise, -knee / 2, knee, -knee / 2, -knee / 2, knee])
