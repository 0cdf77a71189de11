"""The study of hoppers: the learner of section 5.2.2, its training, heights of hops, and the posture at rest."""

import dataclasses
from typing import ClassVar, Literal

import numpy as np

from motorgrad import bodies
from motorgrad.learning import Learner
from motorgrad.schema import count, number, static
from motorgrad.tasks import Hopper
from motorgrad.training import Evaluation, Run, agent_for, evaluate
from motorgrad_thesis._experiment import Experiment, Workspace, smoke

SMOOTH = 25.0
"""Simulated seconds over which heights of hops are averaged."""

HIGH = 0.3
"""A height (m) that random firing does not reach on average: once it is passed, hopping has been learned."""

RewardType = Literal["apex", "landing"]


@dataclasses.dataclass(frozen=True)
class HopperStudy(Experiment):
    """Base of experiments on trained hoppers, by default with the thesis's numbers."""

    reading: ClassVar[str] = (
        "The thesis gives no numbers of the body and does not say how long its hoppers practised; both are "
        "ours. The reward is paid at the first apex of a flight."
    )

    seconds: float = number(1500.0, 0, open_low=True, unit="simulated s", help="length of every hopper's practice")
    seeds: int = count(16, 1, 10_000, help="number of independent hoppers")
    reward_type: RewardType = static(
        "apex", help='when the task rewards a hop: at its first `"apex"`, or at its `"landing"`'
    )
    decay: float = number(0.98, 0, 1, help="decay of the eligibility trace, per decision")
    rate: float = number(5e-4, 0, help="the step size of all parameters")
    action_period: float = number(0.01, 0, open_low=True, unit="simulated s", help="time between decisions")
    watched: float = number(
        20.0, 0, 3600, open_low=True, unit="simulated s", help="length of the evaluation of the frozen policies"
    )

    def validate(self) -> None:
        super().validate()
        self.check_least(seconds=self.task.period, watched=2 * self.task.period)

    quick = smoke(seconds=20.0, seeds=3, watched=4.0)

    @property
    def task(self) -> Hopper:
        return Hopper(reward_type=self.reward_type, action_period=self.action_period)

    @property
    def learner(self) -> Learner:
        return agent_for(self.task, decay=self.decay, learning_rate=self.rate)

    def trained(self, work: Workspace) -> Run:
        """Trained hoppers, shared with other experiments of the same settings."""
        return work.train(self.task, self.learner, round(self.seconds / self.task.period), self.seeds)

    def watch(self, work: Workspace, run: Run, untrained: bool = False) -> Evaluation:
        """Evaluate the policies of all seeds from a fresh start, without learning."""
        return evaluate(run, round(self.watched / self.task.period), untrained=untrained, threads=work.threads)


def hop_heights(outcome: Evaluation) -> np.ndarray:
    """Mean height (m) of each seed's hops in an evaluation; 0 for a seed that never hopped."""
    return np.nan_to_num(outcome.metrics["apex"])


def median_seed(run: Run, outcome: Evaluation) -> int:
    """The median seed, not the best: a figure should show what to expect."""
    order = np.argsort(hop_heights(outcome), kind="stable")
    return run.seeds[int(order[len(order) // 2])]


def practice_heights(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights of hops during practice, averaged over the last `SMOOTH` simulated seconds.

    **Returns:** simulated seconds `(records,)`; heights in m `(seeds, records)`, 0 if there was no hop; and when they
    first exceeded `HIGH`, `(seeds,)`, the whole practice for a seed in which they never did.
    """
    time, heights = run.curve("apex", x="simulated", smooth=SMOOTH)
    passed = run.first_time("apex", above=HIGH, x="simulated", smooth=SMOOTH, never=time[-1])
    return time, np.nan_to_num(heights), passed


def posture(body: bodies.Hopper, interior: float) -> np.ndarray:
    """Coordinates `(6,)` at rest with both knees at `interior` (rad) and the sole on the floor."""
    knee = interior - np.pi / 2
    rise = 2 * body.link_length * (np.sin(interior / 2) - np.sin(np.pi / 4))
    return np.array([rise, -knee / 2, knee, -knee / 2, -knee / 2, knee])
