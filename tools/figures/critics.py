"""The figure of critics: how fast they learn, and what they save."""

import numpy as np
from matplotlib.figure import Figure

from motorgrad.learning import (
    Agent,
    CriticFit,
    Features,
    LeastSquares,
    LinearCritic,
    MeanReward,
    TemporalDifference,
    TrueOnlineTemporalDifference,
    gae,
    gpomdp,
)
from motorgrad.policies import Softmax
from motorgrad.tasks import Chain
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle
from tools.figures._style import BLUE, FAINT, GREEN, ORANGE, RED, band, panels
from tools.figures._work import Work, errors

TASK = Chain(length=4)
POLICY = Softmax(np.array([[0.3, -0.2, 0.1, 0.0], [0.0, 0.4, 0.2, 0.0]]))
SQUARES = LeastSquares(rate=0.0, damping=1e-4, interval=10)
LENGTHS = (100, 300, 1_000, 3_000, 10_000, 30_000)
SEEDS = 40


def critic(fit: CriticFit = SQUARES, decay: float = 0.5) -> LinearCritic:
    return LinearCritic(Features(bias=False), None, decay, fit)


def values(fit: CriticFit, lengths: list[int], decay: float = 0.5) -> np.ndarray:
    """How far learned values are from the exact differential ones, relative to their spread: `(seeds, lengths)`."""
    exact = oracle.values(TASK.dynamics, POLICY)
    stepper = stepper_for(TASK, Agent(POLICY, gae(critic(fit, decay), 0.5, "never")), range(SEEDS))
    found = []
    for length in lengths:
        stepper.advance(length - stepper.decision)
        learned = stepper.state["cycle"].agent.estimator.baseline.weights @ TASK.dynamics.observations.T
        off = (learned - learned.mean(1, keepdims=True)) - (exact - exact.mean())
        found.append(np.linalg.norm(off, axis=1) / np.linalg.norm(exact - exact.mean()))
    return np.array(found).T


def critics(work: Work) -> Figure:
    """Errors of the values by both rules; and of gradient estimates with and without a critic."""
    figure, (left, right) = panels(2, height=3.0)
    lengths = work.lengths(*LENGTHS)
    rules = {
        "least squares": (SQUARES, BLUE),
        r"TD(λ), $\alpha$ = 0.1": (TemporalDifference(0.1), RED),
        r"TD(λ), $\alpha$ = 0.01": (TemporalDifference(0.01), ORANGE),
    }
    for label, (fit, colour) in rules.items():
        band(left, np.array(lengths), values(fit, lengths), colour, label)
    left.set(xscale="log", yscale="log", title="error of the differential values", xlabel="decisions")
    left.set(ylabel="relative error")
    left.legend(fontsize=7)
    estimators = {
        r"no critic, $\beta$ = 0": (gpomdp(0.0, MeanReward()), FAINT),
        r"no critic, $\beta$ = 0.95": (gpomdp(0.95, MeanReward()), RED),
        r"critic, $\beta$ = 0": (gae(critic(), 0.0, "never"), BLUE),
        r"critic, $\beta$ = 0.5": (gae(critic(), 0.5, "never"), GREEN),
    }
    for label, (estimator, colour) in estimators.items():
        found = errors(Agent(POLICY, estimator), TASK, TASK.dynamics, lengths, SEEDS)
        band(right, np.array(lengths), found.T, colour, label)
    right.set(xscale="log", yscale="log", title="error of the gradient estimate", xlabel="decisions")
    right.set(ylabel="relative error")
    right.legend(fontsize=7)
    return figure


def true_online(work: Work) -> Figure:
    """Errors of the values after 300 decisions by learning rate, TD(λ) against true-online TD(λ), for two decays."""
    figure, axes = panels(2, height=3.0)
    rates = np.array([0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8])
    rules = {"TD(λ)": (TemporalDifference, RED), "true-online TD(λ)": (TrueOnlineTemporalDifference, BLUE)}
    for decay, ax in zip((0.5, 0.9), axes, strict=True):
        for label, (rule, colour) in rules.items():
            found = [values(rule(float(rate)), work.lengths(300), decay)[:, -1] for rate in rates]
            band(ax, rates, np.array(found).T, colour, label)
        ax.set(xscale="log", yscale="log", ylim=(0.05, 20), title=f"λ = {decay}, 300 decisions")
        ax.set(xlabel=r"learning rate $\alpha$", ylabel="relative error of the values")
        ax.set_xticks([0.02, 0.05, 0.1, 0.2, 0.4, 0.8], ["0.02", "0.05", "0.1", "0.2", "0.4", "0.8"])
        ax.minorticks_off()
        ax.legend(fontsize=7)
    return figure
