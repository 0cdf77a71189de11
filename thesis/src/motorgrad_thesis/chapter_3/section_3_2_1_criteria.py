"""Section 3.2.1: recursive reward criteria, learned from their increments."""

import dataclasses
from collections.abc import Iterator
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad.learning import (
    SGD,
    Agent,
    Average,
    Discounted,
    Episodic,
    Estimator,
    Last,
    Maximum,
    MeanReward,
    RewardCriterion,
)
from motorgrad.policies import Softmax
from motorgrad.schema import count, number
from motorgrad.statistics import mean_of
from motorgrad.tasks import FiniteTask
from motorgrad.training import stepper_for
from motorgrad.worlds import FiniteMDP, episode_gradient, episode_value, oracle
from motorgrad_thesis._claims import Claim, positive, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, draw_intervals, subplots
from motorgrad_thesis.chapter_3._estimates import along

CRITERIA: dict[str, RewardCriterion] = {
    "maximum": Maximum(),
    "last": Last(),
    "average": Average(),
    "discounted": Discounted(0.5),
}
ROADS = {"peak": (-1.0, -1.0, 6.0, -1.0), "late": (-1.0, -1.0, -1.0, 4.0), "steady": (1.5,) * 4, "soon": (4.0, 0, 0, 0)}
"""The rewards along each road, in the order of the criteria that it is the best by."""
SLIP = 0.1  # chance that the other action acts
LENGTH = 5  # decisions of an episode: two junctions, and three on a road
CLOSE = 0.05  # of the gradient
RECORDS = 12  # of each learner


def four_roads() -> FiniteMDP:
    """Two junctions lead to four roads of four places each; leaving a road leads to a ditch without rewards.

    Every state is observed one-hot. At a junction the action is the turn; on a road, action 1 stays on it. With the
    probability 0.1 the other action acts.
    """
    rewards = [0.0, 0.0, 0.0, *np.concatenate(list(ROADS.values())), 0.0]
    ditch = len(rewards) - 1
    meant = np.zeros((2, len(rewards)), int)
    meant[:, 0] = 1, 2
    meant[:, 1] = 3, 7
    meant[:, 2] = 11, 15
    for place in range(3, ditch):
        ends = (place - 3) % 4 == 3
        meant[:, place] = ditch, ditch if ends else place + 1
    meant[:, ditch] = ditch
    certain = np.eye(len(rewards))[meant]
    return FiniteMDP((1 - SLIP) * certain + SLIP * certain[::-1], rewards, np.eye(len(rewards)))


@dataclasses.dataclass(frozen=True)
class FourRoads(FiniteTask):
    """The four roads as a task, in episodes of five decisions."""

    name: ClassVar[str] = "four-roads"
    world: ClassVar[Any] = four_roads
    actions: ClassVar[Any] = "discrete"

    time_limit: int | None = LENGTH


def undecided() -> Softmax:
    """The policy that takes both actions equally often everywhere."""
    return Softmax(jnp.zeros((2, four_roads().states)))


@experiment("sec-3.2.1-criteria", "recursive reward criteria", "section 3.2.1")
class Criteria(Experiment):
    """Four roads, each the best by another criterion: the greatest reward of an episode, its last, the average, and the
    discounted return. The learner is paid the increments of its criterion at every decision. The estimated gradient is
    compared with the exact one, and every learned policy is judged by all four criteria, exactly.
    """

    reading: ClassVar[str] = (
        "The thesis multiplies the value of the whole episode by the trace at its end. The increments of the value, "
        "each times the trace of its time, have the same mean."
    )

    runs: int = count(2000, 2, 100_000, help="number of runs at fixed parameters over which estimates are averaged")
    length: int = count(2000, LENGTH, 10**8, unit="decisions", help="length of each run at fixed parameters")
    seeds: int = count(20, 2, 10_000, help="number of learners with each criterion")
    first_seed: int = count(0, help="the first of the seeds, which are successive")
    steps: int = count(200_000, 100, 10**9, unit="decisions", help="length of the practice of each learner")
    learning_rate: float = number(0.02, 0, open_low=True, help=r"step size $\alpha$")

    quick = smoke(runs=40, length=100, seeds=3, steps=1_000)

    def run(self, work: Workspace) -> Values:
        found: Values = {"criterion": np.array(list(CRITERIA))}
        for name in CRITERIA:
            found |= work.part(f"estimates-{name}", lambda name=name: self._estimates(name))
            found |= work.part(f"learned-{name}", lambda name=name: self._learned(name))
        return found

    def _estimates(self, name: str) -> Values:
        """The component of each estimate along the exact gradient, relative to it, minus 1, `(runs,)`."""
        criterion = CRITERIA[name]
        policy = undecided()
        truth = oracle.flat(episode_gradient(four_roads(), policy, criterion.accumulated, LENGTH))
        estimator = Estimator(Episodic(), MeanReward(), update_every="never", criterion=criterion)
        stepper = stepper_for(
            FourRoads(), Agent(policy, estimator), range(self.first_seed, self.first_seed + self.runs)
        )
        stepper.advance(self.length)
        mean = stepper.state["cycle"].agent.gradient.mean
        estimates = LENGTH * np.asarray(mean.weights, float).reshape(self.runs, -1)
        return {f"off {name}": along(estimates - truth, truth)}

    def _learned(self, name: str) -> Values:
        """The exact value of the policies that learned by one criterion: by their own at every record, `(seeds,
        records)`, and by all in the end, `(criteria, seeds)`."""
        estimator = Estimator(Episodic(), MeanReward(), criterion=CRITERIA[name])
        agent = Agent(undecided(), estimator, SGD(self.learning_rate))
        stepper = stepper_for(FourRoads(), agent, range(self.first_seed, self.first_seed + self.seeds))
        decisions = np.linspace(0, self.steps, RECORDS + 1).astype(int)
        curve = []
        for decision in decisions:
            stepper.advance(int(decision) - stepper.decision)
            curve.append(self._judged(stepper.policies(), name))
        every = [self._judged(stepper.policies(), judge) for judge in CRITERIA]
        return {"decision": decisions, f"curve {name}": np.array(curve).T, f"by {name}": np.array(every)}

    def _judged(self, policies: Any, judge: str) -> list[float]:
        mdp = four_roads()
        accumulated = CRITERIA[judge].accumulated
        return [episode_value(mdp, Softmax(one), accumulated, LENGTH) for one in policies.weights]

    def figure(self, values: Values) -> Figure:
        """Three panels: the rewards along the roads, learning, and every policy judged by every criterion."""
        figure, (roads, curves, judged) = subplots(13, 4, 1, 3)
        _roads(roads)
        for row, name in enumerate(CRITERIA):
            draw_band(curves, values["decision"] / 1000, values[f"curve {name}"], f"C{row}", name)
        curves.set(xlabel="thousand decisions", ylabel="exact value by the own criterion")
        curves.set_title(f"learning, median of {self.seeds} seeds", loc="left")
        _judged_panel(judged, values)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for name in CRITERIA:
            yield within(
                -CLOSE,
                CLOSE,
                f"The mean of increments times traces is the gradient of the expected {_words(name)}.",
                mean_of(values[f"off {name}"]),
                "relative deviation along the exact gradient",
                note="The exact gradient follows all histories of an episode.",
                of="A criterion that is recursive is accumulated like a reward, and its gradient estimated.",
            )
        for row, name in enumerate(CRITERIA):
            own = values[f"by {name}"][row]
            others = {other: values[f"by {other}"][row].mean() for other in CRITERIA if other != name}
            best = max(others, key=lambda other: others[other])
            yield positive(
                f"By the {_words(name)}, policies are the best that learned by it.",
                mean_of(own - values[f"by {best}"][row]),
                "exact value minus that of the best others",
                note=f"{own.mean():.3f}; the best others learned by the {_words(best)}, {others[best]:.3f}.",
                kind="extension",
            )


def _words(name: str) -> str:
    return {
        "maximum": "greatest reward",
        "last": "last reward",
        "average": "average reward",
        "discounted": "discounted return",
    }[name]


def _roads(axes: Axes) -> None:
    for row, (name, rewards) in enumerate(ROADS.items()):
        axes.plot(np.arange(2, 6), rewards, "o-", color=f"C{row}", label=name, markersize=4)
    axes.set(xlabel="decision", ylabel="reward", xticks=range(2, 6))
    axes.set_title("four roads", loc="left")
    axes.legend(fontsize=8)


def _judged_panel(axes: Axes, values: Values) -> None:
    names = list(CRITERIA)
    for row, name in enumerate(names):
        places = np.arange(len(names)) + 0.16 * (row - 1.5)
        found = [mean_of(each) for each in values[f"by {name}"]]
        label = f"learned by {name}"
        draw_intervals(axes, places, found, color=f"C{row}", fmt="o", markersize=5, linewidth=1, label=label)
    axes.set_xticks(range(len(names)), names)
    axes.set(xlabel="judged by", ylabel="exact value of an episode")
    axes.set_title("after learning, mean of seeds", loc="left")
    axes.legend(fontsize=8)
