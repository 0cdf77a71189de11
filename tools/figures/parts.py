"""Figures of what estimators are made of: traces, baselines, optimizers."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import motorgrad as mg
from motorgrad.learning import (
    SGD,
    Adam,
    Agent,
    Baseline,
    Constant,
    Episodic,
    Exponential,
    FixedStep,
    LaggedGaussian,
    MeanReward,
    Trace,
    Transition,
    Window,
    gpomdp,
    olgarb,
)
from motorgrad.tasks import Chain
from motorgrad.worlds import oracle
from tools.figures._style import BLUE, FAINT, GREEN, ORANGE, PINK, RED, band, level, panels
from tools.figures._work import Work, errors
from tools.figures.estimators import POINT, SEEDS, STEPS, TASK, bias

AGES = 40  # decisions over which the filters are shown


def eligibility(trace: Trace) -> np.ndarray:
    """The weight that a trace gives to one score of 1, from the decision of that score onwards."""
    state = trace.init(jnp.zeros(()))
    found = []
    for age in range(AGES):
        state = trace.update(state, jnp.float32(age == 0))
        found.append(float(trace.value(state)))
    return np.array(found)


def traces(work: Work) -> Figure:
    """The filters' weights by age; and why the decay is a compromise."""
    figure, (weights, error) = panels(2, height=3.3)
    filters: dict[str, tuple[Trace, str]] = {
        "episodic": (Episodic(), FAINT),
        r"exponential, $\beta$ = 0.8": (Exponential(0.8), BLUE),
        r"exponential, $\beta$ = 0.95": (Exponential(0.95), GREEN),
        "window, 10 decisions": (Window(10), ORANGE),
        "lagged Gaussian, lag 15, width 4": (LaggedGaussian(15, 4), PINK),
    }
    for label, (trace, colour) in filters.items():
        weights.stairs(eligibility(trace), np.arange(AGES + 1) - 0.5, baseline=None, color=colour, label=label)
    weights.set(title="what an action may still claim", xlabel="age of the action (decisions)", ylim=(0, 1.1))
    weights.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.45, -0.18), ncols=2)

    left = np.array([1.0, 0.6, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005])  # 1 − β
    lengths = work.lengths(1_000, 10_000, 100_000)
    found = [errors(Agent(POINT, gpomdp(1 - x, MeanReward())), TASK, TASK.dynamics, lengths, 40) for x in left]
    for row, (length, colour) in enumerate(zip(lengths, (RED, ORANGE, BLUE), strict=False)):
        band(error, left, np.array([each[row] for each in found]).T, colour, f"{length:,} decisions")
    error.plot(left, [bias(1 - x) for x in left], color="0.3", linestyle="--", linewidth=1, label="bias alone")
    error.set(xscale="log", yscale="log", title="error of GPOMDP against the decay", xlabel=r"$1 - \beta$")
    error.set(ylabel="relative error", xlim=(1.1, 0.0045))
    error.legend(fontsize=7, loc="upper left", bbox_to_anchor=(0.02, 0.42))
    return figure


def levels_of(baseline: Baseline | None, rewards: np.ndarray) -> np.ndarray:
    """The level of a baseline before each reward."""
    if baseline is None:
        return np.zeros(len(rewards))
    state = baseline.init(POINT, jnp.float32)
    found = []
    observation = jnp.zeros(POINT.inputs)
    for reward in rewards:
        found.append(float(baseline.level(state)))
        state = baseline.update(state, POINT, Transition(None, None, jnp.float32(reward), observation, False, False))[1]
    return np.array(found)


def baselines(work: Work) -> Figure:
    """What the baselines expect of rewards whose mean changes; and the error with a constant baseline."""
    figure, (course, error) = panels(2, height=3.0)
    mean = np.repeat([0.3, 0.8], 300)
    rewards = (np.random.default_rng(0).random(600) < mean).astype(float)
    course.plot(mean, color="0.3", linestyle="--", linewidth=1, label="true mean")
    kinds: tuple[tuple[Baseline | None, str, str], ...] = (
        (MeanReward(), BLUE, "mean reward"),
        (FixedStep(0.02), RED, "fixed step, 0.02"),
        (Constant(0.5), GREEN, "constant, 0.5"),
        (None, FAINT, "none"),
    )
    for baseline, colour, label in kinds:
        course.plot(levels_of(baseline, rewards), color=colour, label=label)
    course.set(
        title="rewards of 0 and 1, whose mean changes", xlabel="rewards", ylabel="baseline $b$", ylim=(-0.05, 1.5)
    )
    course.legend(fontsize=7, ncols=2, loc="upper left")

    levels = np.linspace(-0.4, 1.0, 15)
    (length,) = work.lengths(10_000)

    def root_mean_square(baseline: Baseline | None) -> float:
        found = errors(Agent(POINT, gpomdp(0.95, baseline)), TASK, TASK.dynamics, [length], 100)
        return float(np.sqrt(np.mean(found**2)))

    error.plot(levels, [root_mean_square(Constant(float(c))) for c in levels], "o-", color=GREEN, label="constant")
    for baseline, colour, words in ((None, FAINT, "none"), (MeanReward(), BLUE, "mean reward")):
        error.axhline(root_mean_square(baseline), color=colour, label=words)
    eta = oracle.average_reward(TASK.dynamics, POINT)
    error.axvline(eta, color="0.3", linestyle=":", label="the average reward")
    error.set(title=f"error of GPOMDP after {length:,} decisions", xlabel="constant $b$", ylim=(0, 1))
    error.set(ylabel="relative error (root mean square)")
    error.legend(fontsize=7, loc="upper center", ncols=2)
    return figure


def ascent(work: Work) -> Figure:
    """Learning with learning rates too small, fitting and too large, by both optimizers."""
    figure, axes = panels(2, sharey=True)
    task = Chain(length=6, variant="reset")
    rules: tuple[tuple[str, Callable[[float], Any], tuple[float, ...]], ...] = (
        ("SGD", SGD, (0.005, 0.05, 0.5, 5.0)),
        ("Adam", Adam, (0.0005, 0.005, 0.05, 0.5)),
    )
    for panel, (name, rule, rates) in zip(axes, rules, strict=True):
        for rate, colour in zip(rates, (GREEN, BLUE, ORANGE, RED), strict=True):
            agent = Agent(mg.policies.softmax(task), olgarb(0.9), rule(rate))
            decisions, rewards = work.train(task, agent, STEPS, SEEDS).curve()
            band(panel, decisions / 1000, rewards, colour, f"{rate:g}")
        level(panel, oracle.optimal_policy(task.dynamics)[1], "best policy")
        panel.set(title=name, xlabel="thousand decisions", ylim=(-0.005, 0.24))
        panel.legend(title=r"learning rate $\alpha$", loc="upper center", ncols=4, columnspacing=1)
    axes[0].set_ylabel("mean reward")
    return figure
