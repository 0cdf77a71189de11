"""Figures of the estimators, on the three-state MDP, where the oracle knows the truth."""

import dataclasses
from typing import ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import motorgrad as mg
from motorgrad.learning import SGD, Agent, Estimator, MeanReward, gpomdp, olgarb, olpomdp
from motorgrad.policies import Softmax
from motorgrad.tasks import Chain, Task, ThreeState
from motorgrad.worlds import FiniteMDP, oracle
from tools.figures._style import BLUE, GREEN, ORANGE, RED, band, level, panels
from tools.figures._work import Work, errors

SEEDS = 20
STEPS = 20_000
POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # the test point of Baxter and Bartlett
TASK = ThreeState()
EXACT = oracle.flat(oracle.gradient(TASK.dynamics, POINT))


@dataclasses.dataclass(frozen=True)
class Shifted(ThreeState):
    """The three-state MDP with a constant added to every reward, which changes nothing that matters."""

    name: ClassVar[str] = "three-state-shifted"
    shift: float = 0.0

    @property
    def dynamics(self) -> FiniteMDP:
        same = TASK.dynamics
        return FiniteMDP(same.transitions, same.rewards + self.shift, same.observations, same.start)


def learning(work: Work, task: Task, estimator: Estimator, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Thousands of decisions, and the mean reward of every seed."""
    agent = Agent(mg.policies.softmax(task), estimator, SGD(rate))
    decisions, rewards = work.train(task, agent, STEPS, SEEDS).curve()
    return decisions / 1000, rewards


def best(axes: Axes) -> None:
    """Mark what the best policy earns."""
    level(axes, oracle.optimal_policy(TASK.dynamics)[1], "best policy")


def olgarb_figure(work: Work) -> Figure:
    """Learning on the three-state MDP, every seed; and with several decays where the reward comes late."""
    figure, (seeds, decay) = panels(2)
    decisions, rewards = learning(work, TASK, olgarb(0.8), 0.01)
    seeds.plot(decisions, rewards.T, color=BLUE, alpha=0.2, linewidth=0.5)
    band(seeds, decisions, rewards, BLUE, f"median and quartiles of {SEEDS} seeds")
    level(seeds, oracle.average_reward(TASK.dynamics, mg.policies.softmax(TASK)), "before learning")
    best(seeds)
    late = Chain(length=6, variant="reset")
    for beta, colour in ((0.0, RED), (0.5, ORANGE), (0.8, BLUE), (0.95, GREEN)):
        band(decay, *learning(work, late, olgarb(beta), 0.05), colour, rf"$\beta$ = {beta:g}")
    level(decay, oracle.optimal_policy(late.dynamics)[1], "best policy")
    seeds.set(title=r"three states, $\beta$ = 0.8, $\alpha$ = 0.01", ylabel="mean reward", ylim=(0.2, 0.87))
    decay.set(title=r"chain of six, $\alpha$ = 0.05", ylim=(-0.005, 0.19))
    decay.legend(loc="center right")
    seeds.legend(loc="lower right", bbox_to_anchor=(1, 0.3))
    for axes in (seeds, decay):
        axes.set_xlabel("thousand decisions")
    return figure


def olpomdp_figure(work: Work) -> Figure:
    """Without a baseline, a constant added to all rewards is noise."""
    figure, (without, including) = panels(2, sharey=True)
    for axes, make in ((without, olpomdp), (including, olgarb)):
        for shift, colour in ((-1.0, GREEN), (0.0, BLUE), (1.0, ORANGE), (3.0, RED)):
            decisions, rewards = learning(work, Shifted(shift=shift), make(0.8), 0.03)
            band(axes, decisions, rewards - shift, colour, f"${shift:+g}$" if shift else "0")
        best(axes)
        axes.set(title=f"{make.__name__}, $\\alpha$ = 0.03", xlabel="thousand decisions", ylim=(0.2, 0.87))
    without.set_ylabel("mean reward, less the constant")
    without.legend(title="added to every reward", loc="lower right", ncols=2)
    return figure


def gpomdp_figure(work: Work) -> Figure:
    """The estimate's error against the number of decisions, down to its bias."""
    lengths = work.lengths(100, 300, 1_000, 3_000, 10_000, 30_000, 100_000)
    figure, (decays, baseline) = panels(2, height=3.0, sharey=True)
    for beta, colour in ((0.0, RED), (0.8, BLUE), (0.95, GREEN)):
        found = errors(Agent(POINT, gpomdp(beta, MeanReward())), TASK, TASK.dynamics, lengths, 100)
        band(decays, np.array(lengths), found.T, colour, rf"$\beta$ = {beta:g}")
        decays.axhline(bias(beta), color=colour, linewidth=0.9, linestyle="--")
    for made, colour, label in (
        (gpomdp(0.95), ORANGE, "none"),
        (gpomdp(0.95, MeanReward()), GREEN, "mean reward"),
    ):
        found = errors(Agent(POINT, made), TASK, TASK.dynamics, lengths, 100)
        band(baseline, np.array(lengths), found.T, colour, label)
    baseline.axhline(bias(0.95), color="0.3", linewidth=0.9, linestyle="--")
    decays.set(title="with a baseline; dashed: the bias", ylabel="relative error of the estimate")
    baseline.set(title=r"$\beta$ = 0.95")
    baseline.legend(title="baseline")
    decays.legend(loc="upper right")
    for axes in (decays, baseline):
        axes.set(xscale="log", yscale="log", xlabel="decisions", ylim=(2e-3, 10))
    return figure


def bias(decay: float) -> float:
    """How far what a trace of this decay estimates is from the gradient, relative to its length."""
    biased = oracle.flat(oracle.biased_gradient(TASK.dynamics, POINT, decay))
    return float(np.linalg.norm(biased - EXACT) / np.linalg.norm(EXACT))
