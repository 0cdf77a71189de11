"""Figures of the family of methods: how each does over its learning rates, and what its parts save."""

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import motorgrad as mg
from motorgrad.learning import (
    SGD,
    Agent,
    Baseline,
    Centring,
    ConjugateAscent,
    Estimator,
    Exponential,
    Features,
    LinearCritic,
    MeanReward,
    OptimalBaseline,
    OvershootingBound,
    ProximalPolicyOptimization,
    SimpleCentring,
    SwiftTemporalDifference,
    TemporalDifference,
    TrueOnlineTemporalDifference,
    UnitMean,
    ValueBasedCentring,
    actor_critic,
    gae,
    gpomdp,
    olgarb,
)
from motorgrad.tasks import Chain, LinearRecruitment, Task, ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle
from tools.figures._style import BLUE, FAINT, GREEN, ORANGE, PINK, RED, band, level, panels
from tools.figures._work import Work
from tools.figures.critics import POLICY, TASK, values
from tools.figures.estimators import POINT

SEEDS = 40
STEPS = 20_000
STATES = ThreeState()
LATE_REWARD = Chain(length=6, variant="reset")


def sensitivity(
    axes: Axes, work: Work, task: Any, agents: Mapping[str, tuple[Agent, str]], rates: Sequence[float], steps: int
) -> None:
    """What learners earn in a whole training, over their learning rate, or the first step of their lines."""
    for label, (agent, colour) in agents.items():
        steps = min(steps, work.most)
        lines = isinstance(agent.optimizer, ConjugateAscent)
        swept = {"optimizer.initial" if lines else "learning_rate": list(rates)}
        run = mg.train(task, agent, steps, SEEDS, window=steps, progress=False, sweep=swept)
        earned = [each.curve()[1][:, -1] for each in run.split()]
        band(axes, np.array(rates), np.array(earned).T, colour, label)
    level(axes, oracle.optimal_policy(task.dynamics)[1], "best policy")
    axes.set(xscale="log", xlabel=r"learning rate $\alpha$", ylabel="mean reward of a training")


def actor_critics(work: Work) -> Figure:
    """AC(λ) against OLGARB, over the decay of the trace, where the reward is near and where it is late."""
    figure, axes = panels(2, height=3.0)
    decays = [0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98]
    steps = min(STEPS, work.most)
    for panel, task, title in ((axes[0], STATES, "three states"), (axes[1], LATE_REWARD, "chain of six")):
        policy = mg.policies.softmax(task)
        rules = {"AC(λ)": (actor_critic(), BLUE), "OLGARB": (olgarb(), RED)}
        for label, (estimator, colour) in rules.items():
            agent = Agent(policy, estimator, SGD(0.03))
            run = mg.train(task, agent, steps, SEEDS, window=steps, progress=False, sweep={"decay": decays})
            earned = [each.curve()[1][:, -1] for each in run.split()]
            band(panel, np.array(decays), np.array(earned).T, colour, label)
        panel.set(xlabel="decay of the actor's trace", title=f"{title}, {steps:,} decisions")
    axes[0].set_ylabel("mean reward of a training")
    axes[1].legend(fontsize=7)
    return figure


CENTRINGS: dict[str, tuple[Centring | None, str]] = {
    "not centred": (None, RED),
    "simple": (SimpleCentring(), ORANGE),
    "value-based": (ValueBasedCentring(0.02), BLUE),
}


def off(discount: float, centring: Centring | None, lengths: Sequence[int]) -> np.ndarray:
    """How far discounted values are from the exact ones but for a constant, relative to their spread."""
    exact = oracle.values(TASK.dynamics, POLICY, discount)
    exact = exact - exact.mean()
    critic = LinearCritic(Features(bias=False), discount, 0.5, TemporalDifference(0.1), centring)
    stepper = stepper_for(TASK, Agent(POLICY, gae(critic, 0.5, "never")), range(SEEDS))
    found = []
    for length in lengths:
        stepper.advance(length - stepper.decision)
        learned = stepper.state["cycle"].agent.estimator.baseline.weights @ TASK.dynamics.observations.T
        apart = learned - learned.mean(1, keepdims=True) - exact
        found.append(np.linalg.norm(apart, axis=1) / np.linalg.norm(exact))
    return np.array(found).T


def centring(work: Work) -> Figure:
    """Errors of discounted values with and without centring: over decisions, and over discounts."""
    figure, (course, discounts) = panels(2, height=3.0)
    lengths = work.lengths(30, 100, 300, 1_000, 3_000, 10_000)
    horizons = np.array([3, 10, 30, 100, 300, 1_000])
    (middle,) = work.lengths(1_000)
    for label, (kind, colour) in CENTRINGS.items():
        band(course, np.array(lengths), off(0.99, kind, lengths), colour, label)
        found = [off(1 - 1 / float(h), kind, [middle])[:, -1] for h in horizons]
        band(discounts, horizons, np.array(found).T, colour, label)
    course.set(xscale="log", yscale="log", title=r"$\gamma$ = 0.99", xlabel="decisions")
    course.set(ylabel="relative error of the values")
    discounts.set(xscale="log", yscale="log", title=f"after {middle:,} decisions", xlabel=r"horizon $1/(1 - \gamma)$")
    course.legend(fontsize=7)
    return figure


def optimal_baselines(work: Work) -> Figure:
    """The noise of GPOMDP by the baseline, over the trace's decay: of one policy, and of local units."""
    figure, axes = panels(2, height=3.0)
    lift = LinearRecruitment(units=16)
    units = mg.policies.initial("gaussians", lift)
    units = units if isinstance(units, mg.policies.Policy) else units(jax.random.key(0))
    decays = np.array([0.0, 0.3, 0.6, 0.8, 0.9, 0.95])
    kinds: dict[str, tuple[Baseline | None, str]] = {
        "none": (None, FAINT),
        "mean reward": (MeanReward(), RED),
        "optimal, one for the policy": (OptimalBaseline(), BLUE),
        "optimal, each unit": (OptimalBaseline(each="unit"), GREEN),
        "mean, each unit": (UnitMean(), ORANGE),
    }
    (length,) = work.lengths(2_000)
    cases = ((axes[0], STATES, POINT, "three states"), (axes[1], lift, units, "16 local units"))
    for panel, task, policy, title in cases:
        for label, (baseline, colour) in kinds.items():
            if task is STATES and "each" in label:
                continue  # there is one unit
            spread = [noise(task, policy, gpomdp(float(decay), baseline), length) for decay in decays]
            low, middle, high = np.percentile(spread, [2.5, 50, 97.5], axis=1)
            panel.fill_between(decays, low, high, color=colour, alpha=0.2, linewidth=0)
            panel.plot(decays, middle, "o-", color=colour, markersize=3, label=label)
        panel.set(yscale="log", xlabel=r"decay $\beta$", title=f"{title}, {length:,} decisions")
    axes[0].set_ylabel("noise of the estimate, relative")
    axes[1].legend(fontsize=7)
    return figure


def noise(task: Task, policy: Any, estimator: Any, length: int) -> np.ndarray:
    """The standard deviation of an estimate over 100 seeds, relative to the length of its mean; drawn again 200 times
    from these seeds."""
    stepper = stepper_for(task, Agent(policy, estimator), range(100))
    stepper.advance(length)
    leaves = jax.tree.leaves(stepper.state["cycle"].agent.gradient.mean)
    found = np.concatenate([np.asarray(leaf, float).reshape(100, -1) for leaf in leaves], axis=1)
    again = found[np.random.default_rng(0).integers(100, size=(200, 100))]
    return np.sqrt(again.var(1).sum(1)) / np.linalg.norm(found.mean(0))


def ascent(work: Work) -> Figure:
    """CONJPOMDP against plain ascent in batches, over the first step and the learning rate."""
    figure, axes = panels(2, height=3.0)
    rates = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0]
    for panel, task, beta, title in (
        (axes[0], STATES, 0.8, "three states"),
        (axes[1], LATE_REWARD, 0.9, "chain of six"),
    ):
        policy = mg.policies.softmax(task)
        batch = Estimator(Exponential(beta), update_every=500)
        agents = {
            "SGD": (Agent(policy, batch, SGD(1.0)), RED),
            "CONJPOMDP": (Agent(policy, batch, ConjugateAscent(1.0)), BLUE),
            "CONJPOMDP, certainty 1": (Agent(policy, batch, ConjugateAscent(1.0, 1.0)), GREEN),
        }
        sensitivity(panel, work, task, agents, rates, 2 * STEPS)
        panel.set(title=f"{title}, {2 * STEPS:,} decisions", xlabel=r"learning rate $\alpha$, or first step $s_0$")
    axes[1].set_ylabel("")
    axes[1].legend(fontsize=7, loc="lower right")
    return figure


def clipping() -> Figure:
    """How strongly a decision still moves the policy, over how much its probability has changed."""
    figure, axes = panels(2, height=2.6)
    policy = mg.policies.hyperplanes(1, 1)
    seen = jnp.ones((1, 1))
    action = jnp.ones((1, 1))
    now = policy.log_prob(seen[0], action[0])
    score = policy.score(seen[0], action[0]).weights[0, 0]
    ratios = np.linspace(0.5, 1.5, 400)  # none of them at a corner, where the slope has two values
    for panel, worth, title in ((axes[0], 1.0, "better than expected"), (axes[1], -1.0, "worse than expected")):
        for clip, colour in ((0.1, ORANGE), (0.2, BLUE), (0.3, GREEN)):
            agent = ProximalPolicyOptimization(policy, clip=clip)

            def pull(ratio: Any, agent: Any = agent, worth: float = worth) -> Any:
                rows = (seen, action, (now - jnp.log(ratio))[None], jnp.full(1, worth))
                return agent.gradient(policy, rows).weights[0, 0] / score

            panel.plot(ratios, jax.vmap(pull)(jnp.asarray(ratios)), color=colour, label=rf"$\epsilon$ = {clip}")
        panel.axvline(1, color=FAINT, linewidth=0.8)
        panel.set(title=rf"{title}, $A$ = {worth:+.0f}", xlabel=r"ratio $\rho$")
    axes[0].set_ylabel(r"$\nabla L$ in units of the score")
    axes[0].legend(fontsize=7)
    return figure


def batches(work: Work) -> Figure:
    """Presets with networks on the chain: what each earns while it learns."""
    figure, axes = panels(height=3.0)
    task = Chain(length=6, variant="reset", time_limit=100)
    steps = STEPS
    colours = {"reinforce": ORANGE, "a2c": PINK, "ppo": BLUE, "trpo": GREEN, "stream-ac": RED, "natural": FAINT}
    for preset, colour in colours.items():
        run = work.train(task, mg.agent_for(task, preset=preset, steps=steps), steps, 10)
        decisions, earned = run.curve()
        width = max(1, len(decisions) // 40)
        parts = earned[:, : len(decisions) // width * width].reshape(len(earned), -1, width).mean(axis=2)
        band(axes, decisions[width - 1 :: width] / 1000, parts, colour, preset)
    level(axes, oracle.optimal_policy(task.dynamics)[1], "best policy")
    axes.set(xlabel="thousand decisions", ylabel="mean reward")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def bounded_steps() -> Figure:
    """How far a bounded step goes, over the length of the trace and over the error."""
    figure, axes = panels(2, height=2.6)
    bound = OvershootingBound(3.0)

    def gone(error: Any, length: Any) -> Any:
        """The sum of the magnitudes of a step."""
        trace = length[None]
        return jnp.sum(jnp.abs(bound.bounded(None, error * trace, error, trace)))

    lengths = jnp.geomspace(0.01, 10, 200)
    errors = jnp.geomspace(0.01, 10, 200)
    for small, value, colour in ((0.01, 0.1, ORANGE), (0.1, 1.0, BLUE), (1.0, 10.0, GREEN)):
        axes[0].plot(lengths, jax.vmap(lambda z, e=value: gone(jnp.asarray(e), z))(lengths), color=colour, label=value)
        axes[1].plot(errors, jax.vmap(lambda e, z=small: gone(e, jnp.asarray(z)))(errors), color=colour, label=small)
    axes[0].set(xlabel=r"length of the trace $\|z\|_1$", ylabel="length of the step")
    axes[1].set(xlabel=r"error $|\delta|$")
    axes[0].legend(title=r"$|\delta|$", fontsize=7, title_fontsize=7)
    axes[1].legend(title=r"$\|z\|_1$", fontsize=7, title_fontsize=7)
    for panel in axes:
        panel.set(xscale="log", yscale="log")
    return figure


def swift(work: Work) -> Figure:
    """Errors of the values by the first step size: TD(λ), true-online TD(λ) and SwiftTD."""
    figure, axes = panels(2, height=3.0)
    rates = np.array([0.001, 0.003, 0.01, 0.03, 0.1, 0.2, 0.4])
    rules: dict[str, tuple[Any, str]] = {
        "TD(λ)": (TemporalDifference, RED),
        "true-online TD(λ)": (TrueOnlineTemporalDifference, ORANGE),
        "SwiftTD": (lambda rate: SwiftTemporalDifference(rate, 1e-2), BLUE),
    }
    for panel, length in zip(axes, work.lengths(300, 3_000), strict=False):
        for label, (rule, colour) in rules.items():
            found = [values(rule(float(rate)), [length], 0.9)[:, -1] for rate in rates]
            band(panel, rates, np.array(found).T, colour, label)
        panel.set(xscale="log", yscale="log", ylim=(0.05, 3), title=f"λ = 0.9, {length:,} decisions")
        panel.set(xlabel="step size, of SwiftTD the first one", ylabel="relative error of the values")
    axes[0].legend(fontsize=7)
    return figure
