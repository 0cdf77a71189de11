"""The figure of critics: how fast they learn, and what they save."""

import numpy as np
from matplotlib.figure import Figure

from motorgrad.learning import (
    Agent,
    Features,
    LeastSquares,
    LinearCritic,
    MeanReward,
    TemporalDifference,
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


def critic(fit: LeastSquares | TemporalDifference = SQUARES) -> LinearCritic:
    return LinearCritic(Features(bias=False), None, 0.5, fit)


def values(fit: LeastSquares | TemporalDifference, lengths: list[int]) -> np.ndarray:
    """How far learnt values are from the exact differential ones, relative to their spread: `(seeds, lengths)`."""
    exact = oracle.values(TASK.dynamics, POLICY)
    stepper, found = stepper_for(TASK, Agent(POLICY, gae(critic(fit), 0.5, "never")), range(SEEDS)), []
    for length in lengths:
        stepper.advance(length - stepper.decision)
        learnt = stepper.state["cycle"].agent.estimator.baseline.weights @ TASK.dynamics.observations.T
        off = (learnt - learnt.mean(1, keepdims=True)) - (exact - exact.mean())
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
