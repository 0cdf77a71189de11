"""Figures of further methods of the family: steps by what they change, filters that are learned, and more."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import motorgrad as mg
from motorgrad.learning import (
    SGD,
    ActionValues,
    Agent,
    BoundedTemporalDifference,
    Estimator,
    Exponential,
    IntentionalStep,
    IntentionalTemporalDifference,
    MeanReward,
    OvershootingBound,
    RootMeanSquare,
    StepBound,
    TemporalDifference,
)
from motorgrad.policies import Architecture, GradedHyperplanes
from motorgrad.worlds import oracle
from tools.figures._style import BLUE, ORANGE, RED, band, level, panels
from tools.figures._work import Work
from tools.figures.critics import values
from tools.figures.family import LATE_REWARD, SEEDS, STATES

USUAL = RootMeanSquare(1 / 400)


def intentional(work: Work) -> Figure:
    """Intentional steps by their size, against others by their learning rate: of critics, and of policies."""
    figure, (critics, states, late) = panels(3, height=2.8)
    rates = np.array([0.003, 0.01, 0.03, 0.1, 0.3, 0.9])
    (length,) = work.lengths(1_000)
    rules = {
        "plain": (TemporalDifference, RED),
        "bounded": (lambda rate: BoundedTemporalDifference(rate, scaling=2.0), ORANGE),
        "intentional": (IntentionalTemporalDifference, BLUE),
    }
    for label, (rule, colour) in rules.items():
        found = [values(rule(float(rate)), [length], 0.8)[:, -1] for rate in rates]
        band(critics, rates, np.array(found).T, colour, label)
    critics.set(xscale="log", yscale="log", title=f"values, {length:,} decisions", ylabel="relative error")
    critics.set(xlabel=r"$\alpha$, or fraction $\eta$", ylim=(0.1, 3))
    critics.legend(fontsize=7)
    rates = np.array([0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0])
    steps = min(10_000, work.most)
    for panel, task, decay, title in ((states, STATES, 0.8, "three states"), (late, LATE_REWARD, 0.9, "chain of six")):
        policy = mg.policies.softmax(task)

        def learner(bound: StepBound | None, policy: object = policy, decay: float = decay) -> Agent:
            estimator = Estimator(Exponential(decay), MeanReward(), normalization=USUAL, bound=bound)
            return Agent(policy, estimator, SGD(1.0))

        agents = {
            "plain": (learner(None), "learning_rate", RED),
            "bounded": (learner(OvershootingBound()), "learning_rate", ORANGE),
            "intentional": (learner(IntentionalStep()), "estimator.bound.change", BLUE),
        }
        for label, (agent, number, colour) in agents.items():
            swept = {number: rates.tolist()}
            run = mg.train(task, agent, steps, SEEDS, window=steps, progress=False, sweep=swept)
            band(panel, rates, np.array([each.curve()[1][:, -1] for each in run.split()]).T, colour, label)
        level(panel, oracle.optimal_policy(task.dynamics)[1], "best policy")
        panel.set(xscale="log", title=f"{title}, {steps:,} decisions", xlabel=r"$\alpha$, or change $\eta$")
    states.set_ylabel("mean reward of a training")
    return figure


class Bowl(eqx.Module):
    """A single feature, minus the squared distance of the action from 0."""

    def __call__(self, x: jax.Array) -> jax.Array:
        return -jnp.square(x[1:])


class Bowls(Architecture):
    """Layers whose output is that of `Bowl`."""

    def build(self, inputs: int, key: jax.Array) -> eqx.Module:
        del inputs, key
        return Bowl()


def action_values() -> Figure:
    """The noise of gradient samples by the score and through the action, over the deviation of a normal unit."""
    figure, axes = panels(2, height=2.8)
    deviations = np.geomspace(0.03, 1, 12)
    observation = jnp.zeros(1)
    uniforms = jnp.asarray(np.random.default_rng(0).random((4_000, 1)))
    for panel, centre in zip(axes, (0.1, 1.0), strict=True):
        noise: dict[str, list[float]] = {"by the score": [], "through the action": []}
        for deviation in deviations:
            units = GradedHyperplanes(
                weights=jnp.zeros((1, 1)),
                bias=jnp.array([centre]),
                log_deviation=jnp.log(jnp.array([deviation])),
                floor=jnp.array(1e-6),
            )
            values = ActionValues(network=Bowls())
            state = values.init(units, jnp.float32, jax.random.key(0))
            state = state._replace(weights=eqx.tree_at(lambda w: w.weights, state.weights, jnp.ones(1)))

            def scored(u: jax.Array, units: GradedHyperplanes = units, mean: float = centre**2 + deviation**2):
                action = units.sample(observation, u)
                return (mean - jnp.square(action[0])) * units.score(observation, action).bias[0]

            def through(u: jax.Array, units=units, values=values, state=state):
                return values.gradient(state, units, observation, u).bias[0]

            for found, function in zip(noise.values(), (scored, through), strict=True):
                found.append(float(np.std(jax.vmap(function)(uniforms)) / (2 * centre)))
        for (label, found), colour in zip(noise.items(), (RED, BLUE), strict=True):
            panel.loglog(deviations, found, color=colour, label=label)
        panel.set(xlabel="deviation of the unit", title=f"{centre:g} from the best action")
    axes[0].set_ylabel("deviation of a sample over its mean")
    axes[0].legend()
    return figure
