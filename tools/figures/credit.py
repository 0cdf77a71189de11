"""Figures of credit: which actions a reward, or a value, is credited to, and what a step does to the states."""

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import motorgrad as mg
from motorgrad.learning import (
    SGD,
    ActionTransitions,
    Agent,
    CompatibleWeights,
    EpisodicNatural,
    Estimator,
    Exponential,
    Features,
    FisherMetric,
    LearnedTrace,
    LeastSquares,
    LeastSquaresNatural,
    LinearCritic,
    MeanReward,
    ShermanMorrison,
    StationaryMetric,
    gae,
    gpomdp,
    olgarb,
)
from motorgrad.policies import Softmax
from motorgrad.tasks import ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle
from tools.figures._style import BLUE, FAINT, GREEN, ORANGE, PINK, RED, band, panels
from tools.figures._work import Work, errors
from tools.figures.critics import LENGTHS, POLICY, SEEDS, TASK
from tools.figures.family import LATE_REWARD, sensitivity


def angle(one: np.ndarray, other: np.ndarray) -> float:
    """The angle between two vectors, in degrees."""
    cosine = one @ other / (np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def discounting() -> Figure:
    """Exact gradients: how discounted ones lie to that of the average reward, and what the trace's decay does."""
    figure, (turned, traces) = panels(2, height=3.0)
    mdp = TASK.dynamics
    average = oracle.flat(oracle.gradient(mdp, POLICY))
    horizons = np.geomspace(1.25, 300, 40)
    alike = [oracle.flat(oracle.biased_gradient(mdp, POLICY, 1 - 1 / float(h))) for h in horizons]
    start = [oracle.flat(oracle.discounted_gradient(mdp, POLICY, 1 - 1 / float(h))) for h in horizons]
    turned.plot(horizons, [angle(each, average) for each in alike], color=BLUE, label="all decisions alike")
    turned.plot(horizons, [angle(each, average) for each in start], color=RED, label="from the start")
    turned.set(xscale="log", xlabel=r"horizon $1/(1 - \gamma)$", ylabel=r"angle to $\nabla\eta$ (°)")
    turned.legend(fontsize=7)
    decays = np.linspace(0, 1, 41)
    discount = 0.9
    exact = oracle.flat(oracle.discounted_gradient(mdp, POLICY, discount))
    rules = {r"right: $\lambda$": (1.0, GREEN), r"wrong: $\gamma\lambda$": (discount, ORANGE)}
    for label, (factor, colour) in rules.items():
        found = [oracle.flat(oracle.discounted_gradient(mdp, POLICY, discount, factor * float(d))) for d in decays]
        errors = [np.linalg.norm(each - exact) / np.linalg.norm(exact) for each in found]
        traces.plot(decays, errors, color=colour, label=f"decay of the trace, {label}")
    traces.set(xlabel=r"$\lambda$", ylabel="bias, relative", title=rf"from the start, $\gamma$ = {discount}, no critic")
    traces.legend(fontsize=7)
    return figure


def action_transitions(work: Work) -> Figure:
    """Errors of gradient estimates by values of actions and of states, for a policy that wavers and one that does
    not."""
    figure, axes = panels(2, height=3.0)
    lengths = work.lengths(*LENGTHS)
    fit = LeastSquares(rate=0.0, damping=1e-4, interval=10)
    features = Features(bias=False)

    def transitions(relative_to: str) -> Estimator:
        baseline = ActionTransitions(features, fit=fit, relative_to=relative_to)  # pyright: ignore[reportArgumentType]
        return Estimator(Exponential(0.0), baseline, update_every="never")

    rules = {
        r"GPOMDP, $\beta$ = 0.9": (gpomdp(0.9, MeanReward()), FAINT),
        r"critic $v$, $\lambda$ = 0": (gae(LinearCritic(features, None, 0.0, fit), 0.0, "never"), GREEN),
        "$Q$ above the mean": (transitions("mean"), ORANGE),
        "$Q$ above the previous action's": (transitions("previous"), BLUE),
    }
    cases = ((1.0, "a wavering policy"), (8.0, "a nearly certain one"))
    for panel, (gain, title) in zip(axes, cases, strict=True):
        policy = Softmax(gain * np.asarray(POLICY.weights, float))
        for label, (estimator, colour) in rules.items():
            found = errors(Agent(policy, estimator), TASK, TASK.dynamics, lengths, SEEDS)
            band(panel, np.array(lengths), found.T, colour, label)
        panel.set(xscale="log", yscale="log", title=title, xlabel="decisions")
    axes[0].set_ylabel("relative error of the estimate")
    axes[0].legend(fontsize=7)
    return figure


def learned_trace(work: Work) -> Figure:
    """The weights that a filter learns, beside those of least error; and the errors that filters leave."""
    figure, (left, right) = panels(2, height=3.0)
    trace = LearnedTrace(12, 0.0)
    lengths = work.lengths(100, 300, 1_000, 3_000, 10_000)
    seeds = 100
    lags = np.arange(trace.length)
    mdp = TASK.dynamics
    exact = np.array([oracle.flat(oracle.lagged_gradient(mdp, POLICY, int(lag))) for lag in lags])
    whole = oracle.flat(oracle.gradient(mdp, POLICY))
    stepper = stepper_for(TASK, Agent(POLICY, Estimator(trace, MeanReward(), update_every="never")), range(seeds))
    fixed = {
        "window": (np.ones(len(lags)), FAINT),
        r"exponential, $\beta$ = 0.8": (0.8**lags, ORANGE),
        r"exponential, $\beta$ = 0.5": (0.5**lags, RED),
    }
    errors: dict[str, list[np.ndarray]] = {name: [] for name in ("learned", *fixed)}
    colours = dict(zip(lengths[-4::2], (GREEN, BLUE), strict=False))  # of the second and the fourth of five
    for length in lengths:
        stepper.advance(length - stepper.decision)
        state = stepper.state["cycle"].agent.estimator.trace
        found = np.asarray(state.means.mean[0].weights, float).reshape(seeds, len(lags), -1)
        learned = np.asarray(jax.vmap(trace.weights)(state), float)
        every = {"learned": learned, **{name: np.tile(weights, (seeds, 1)) for name, (weights, _) in fixed.items()}}
        for name, weights in every.items():
            apart = np.sum(weights[:, :, None] * found, axis=1) - whole
            errors[name].append(np.linalg.norm(apart, axis=1) / np.linalg.norm(whole))
        if length in colours:
            band(left, lags, learned, colours[length], f"learned, {length:,} decisions")
            noise = found.var(0).sum(1)
            signal = np.square(exact).sum(1)
            left.plot(lags, signal / (signal + noise), ":", color=colours[length], label="of least error")
    left.set(xlabel="age of the action (decisions)", ylabel="weight", ylim=(0, 1.05))
    left.legend(fontsize=7)
    for name, values in errors.items():
        band(right, np.array(lengths), np.array(values).T, BLUE if name == "learned" else fixed[name][1], name)
    right.set(xscale="log", yscale="log", xlabel="decisions", ylabel="relative error of the estimate")
    right.legend(fontsize=7)
    return figure


def stationary_metric(work: Work) -> Figure:
    """Errors of the scores of states over decisions; and what is earned with and without them in the metric."""
    figure, (left, right) = panels(2, height=3.0)
    lengths = work.lengths(*LENGTHS)
    exact = oracle.stationary_score(TASK.dynamics, POLICY)
    observations = jnp.asarray(TASK.dynamics.observations, jnp.float32)
    estimator = Estimator(update_every="never")
    for decay, colour in ((0.0, RED), (0.7, ORANGE), (0.95, BLUE)):
        metric = StationaryMetric(Features(bias=False), decay=decay, rate=0.0, ridge=1e-4)
        stepper = stepper_for(TASK, Agent(POLICY, estimator, metric=metric), range(SEEDS))
        found = []
        for length in lengths:
            stepper.advance(length - stepper.decision)
            weights = np.asarray(jax.vmap(metric.solution)(stepper.state["cycle"].agent.chain[0]), float)
            apart = np.asarray(observations, float) @ weights - exact
            found.append(np.linalg.norm(apart, axis=(1, 2)) / np.linalg.norm(exact))
        band(left, np.array(lengths), np.array(found).T, colour, rf"$\lambda$ = {decay:g}")
    left.set(xscale="log", yscale="log", xlabel="decisions", ylabel=r"relative error of $\xi$")
    left.legend(fontsize=7)
    policy = mg.policies.softmax(LATE_REWARD)
    batch = Estimator(Exponential(0.9), update_every=100)
    metrics = {
        "plain": (None, RED),
        r"actions, $\iota$ = 0": (StationaryMetric(weight=0.0), ORANGE),
        r"and states, $\iota$ = 1": (StationaryMetric(weight=1.0), BLUE),
    }
    agents = {label: (Agent(policy, batch, SGD(1.0), metric), colour) for label, (metric, colour) in metrics.items()}
    sensitivity(right, work, LATE_REWARD, agents, [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0], 10_000)
    right.legend(fontsize=7)
    return figure


def natural_actor_critics(work: Work) -> Figure:
    """What natural actor-critics earn over their learning rates: those of every decision, and those of batches."""
    figure, (online, batches) = panels(2, height=3.2)
    steps = 10_000
    episodes = ThreeState(time_limit=50)
    rate = olgarb(0.8)
    agents = {
        "plain": (None, RED),
        "Fisher matrix": (FisherMetric(), FAINT),
        "compatible weights": (CompatibleWeights(0.02), ORANGE),
        "Sherman–Morrison": (ShermanMorrison(damping=0.01), BLUE),
    }
    policy = mg.policies.softmax(LATE_REWARD)
    found = {label: (Agent(policy, rate, SGD(1.0), metric), colour) for label, (metric, colour) in agents.items()}
    sensitivity(online, work, LATE_REWARD, found, [1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0], steps)
    online.set(title=f"chain of six, {steps:,} decisions, a step each")
    policy = mg.policies.softmax(episodes)
    batch = Estimator(Exponential(0.8), update_every=200)
    unread = Estimator(Exponential(0.0), None, update_every=200)
    squares = LeastSquares(rate=1e-3, interval=200)
    found = {
        "plain": (Agent(policy, batch, SGD(1.0)), RED),
        "Fisher matrix": (Agent(policy, batch, SGD(1.0), FisherMetric()), FAINT),
        "LSTD-NAC": (Agent(policy, unread, SGD(1.0), LeastSquaresNatural(Features(bias=False), fit=squares)), GREEN),
        "episodic": (Agent(policy, unread, SGD(1.0), EpisodicNatural(rate=0.01)), PINK),
    }
    sensitivity(batches, work, episodes, found, [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0], steps)
    batches.set(title=f"three states, {steps:,} decisions, a step every 200", ylabel="")
    for panel in (online, batches):
        panel.legend(fontsize=7, loc="lower right")
    return figure
