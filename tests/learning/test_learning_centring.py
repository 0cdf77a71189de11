"""The level of rewards learned from temporal differences: AC(λ) and reward centring, against exact values."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decision

from motorgrad.learning import (
    SGD,
    Agent,
    Features,
    FittedReturns,
    LeastSquares,
    LinearCritic,
    NetworkCritic,
    SimpleCentring,
    TemporalDifference,
    ValueBasedCentring,
    actor_critic,
    gae,
)
from motorgrad.policies import Softmax
from motorgrad.tasks import Chain, ThreeState
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import oracle

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
TASK = Chain(length=4)
CHAIN_POINT = Softmax(np.array([[0.3, -0.2, 0.1, 0.0], [0.0, 0.4, 0.2, 0.0]]))


def test_all_three_learn_from_one_temporal_difference():
    """Sutton & Barto's updates, written out (2018, page 333)."""
    step, rate, level_rate, decay, critic_decay = 0.2, 0.1, 0.03, 0.7, 0.6
    with jax.enable_x64(True):
        critic = LinearCritic(
            Features(bias=False), None, critic_decay, TemporalDifference(rate), ValueBasedCentring(level_rate)
        )
        agent = Agent(Softmax(jnp.asarray(POINT.weights, jnp.float64)), actor_critic(critic, decay), SGD(step))
        state, rng = agent.init(jax.random.key(0)), np.random.default_rng(0)
        theta, weights, level = np.asarray(POINT.weights, float), np.zeros(2), 0.0
        actor, trace = np.zeros((2, 2)), np.zeros(2)
        y = rng.normal(size=2)
        for _ in range(8):
            after, reward = rng.normal(size=2), rng.normal()
            given = map(jnp.asarray, (y, rng.random(1), reward, after))
            _, action, _, state = decision(agent, state, *given)
            chance = np.exp(theta @ y) / np.exp(theta @ y).sum()
            actor = decay * actor + np.outer(np.eye(2)[int(action)] - chance, y)
            trace = critic_decay * trace + y
            error = reward - level + weights @ after - weights @ y
            level, weights = level + level_rate * error, weights + rate * error * trace
            theta = theta + step * error * actor
            y = after
        np.testing.assert_allclose(state.policy.weights, theta, atol=1e-12)
        np.testing.assert_allclose(state.estimator.baseline.weights, weights, atol=1e-12)
        assert float(agent.estimator.level(state.estimator)) == pytest.approx(level, abs=1e-12)


def learned(critic, decisions, seeds=100):
    stepper = stepper_for(TASK, Agent(CHAIN_POINT, gae(critic, 0.5, "never")), range(seeds))
    stepper.advance(decisions)
    state = stepper.state["cycle"].agent.estimator.baseline
    return np.asarray(state.weights, float) @ TASK.dynamics.observations.T, np.asarray(state.reward.mean, float)


@pytest.mark.ci
@pytest.mark.parametrize("centring", [ValueBasedCentring(0.003), SimpleCentring()], ids=repr)
@pytest.mark.parametrize("discount", [None, 0.9])
def test_level_and_values_are_the_exact_ones(discount, centring):
    critic = LinearCritic(Features(bias=False), discount, 0.5, TemporalDifference(0.02), centring)
    values, levels = learned(critic, 10_000)
    average = oracle.average_reward(TASK.dynamics, CHAIN_POINT)
    exact = oracle.values(TASK.dynamics, CHAIN_POINT, discount)
    if discount is not None and isinstance(centring, SimpleCentring):
        exact = exact - average / (1 - discount)
    elif discount is not None:  # the level shares the constant with the values
        exact = exact - levels.mean() / (1 - discount)
    else:
        values, exact = values - values.mean(1, keepdims=True), exact - exact.mean()
    error = values.std(0) / np.sqrt(len(values))
    np.testing.assert_array_less(np.abs(values.mean(0) - exact), 4 * error + 0.02 * np.abs(exact).max())
    if discount is None or isinstance(centring, SimpleCentring):
        off = abs(levels.mean() - average)
        assert off < 4 * levels.std() / np.sqrt(len(levels)) + 0.01 * average
    assert levels.mean() > 0.2 * average


@pytest.mark.ci
def test_centring_spares_a_critic_the_constant():
    """With a discount of 0.99 the values of 300 decisions are nearer to the exact ones, but for a constant."""
    exact = oracle.values(TASK.dynamics, CHAIN_POINT, 0.99)
    exact = exact - exact.mean()
    off = {}
    for centring in (None, ValueBasedCentring(0.02)):
        critic = LinearCritic(Features(bias=False), 0.99, 0.5, TemporalDifference(0.2), centring)
        values, _ = learned(critic, 300)
        off[centring is None] = np.linalg.norm(values - values.mean(1, keepdims=True) - exact, axis=1).mean()
    assert off[False] < 0.8 * off[True]


def test_the_preset_is_the_estimator():
    agent = agent_for("three-state", estimator="actor-critic", decay=0.9)
    assert agent.estimator == actor_critic()
    # a task whose learner has a critic keeps what it sees
    hexapod = agent_for("hexapod", estimator="actor-critic").estimator.baseline
    assert hexapod.features == Features(squares=True, actions=True, bias=False)
    assert (hexapod.discount, hexapod.fit, hexapod.centring) == (
        None,
        TemporalDifference(0.05),
        ValueBasedCentring(0.005),
    )


@pytest.mark.ci
def test_the_actor_critic_finds_the_best_policy():
    stepper = stepper_for(
        ThreeState(), Agent(Softmax(jnp.zeros((2, 2))), actor_critic(decay=0.5), SGD(0.02)), range(10)
    )
    stepper.advance(200_000)
    earned = [oracle.average_reward(ThreeState().dynamics, Softmax(w)) for w in stepper.policies().weights]
    assert min(earned) >= 0.799


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ValueBasedCentring(2.0), r"rate = 2.0: must be in \[0, 1\]"),
        (lambda: LinearCritic(centring="simple"), "centring = 'simple': must be None or a Centring"),
        (
            lambda: LinearCritic(discount=0.9, fit=LeastSquares(), centring=ValueBasedCentring()),
            "centring = 'ValueBasedCentring': must be None or SimpleCentring with the fit LeastSquares",
        ),
        (
            lambda: NetworkCritic(discount=0.9, fit=FittedReturns(), centring=ValueBasedCentring()),
            "centring = 'ValueBasedCentring': must be None or SimpleCentring with the fit FittedReturns",
        ),
    ],
)
def test_what_does_not_fit_together_is_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()
