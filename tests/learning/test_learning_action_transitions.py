"""Credit at action transitions: written out, and against exact gradients, with exact values and with wrong ones."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decided, started, told
from scipy.special import softmax

import timlab
from motorgrad.learning import (
    SGD,
    ActionTransitions,
    Agent,
    Estimator,
    Exponential,
    Features,
    LeastSquares,
    TemporalDifference,
    TrueOnlineTemporalDifference,
)
from motorgrad.policies import GradedHyperplanes, Hyperplanes, Softmax
from motorgrad.tasks import Chain, ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
TABLE, CHAIN = Softmax(np.array([[0.3, -0.2, 0.1, 0.0], [0.0, 0.4, 0.2, 0.0]])), Chain(length=4)
EXACT = LeastSquares(0.0, 1.0, damping=1e-6, interval=20)


def estimator(baseline, update_every="never"):
    return Estimator(Exponential(0.0), baseline, update_every=update_every)


def estimates(task, policy, baseline, decisions, seeds=200):
    """Estimates of so many seeds by the second half of so many decisions, when the values are learned."""
    stepper, found = stepper_for(task, Agent(policy, estimator(baseline)), range(seeds)), []
    for length in (decisions // 2, decisions):
        stepper.advance(length - stepper.decision)
        found.append(np.asarray(stepper.state["cycle"].agent.gradient.mean.weights, float).reshape(seeds, -1))
    return 2 * found[1] - found[0]


def check_mean(found, exact, precision, slack=0.01):
    error, scale = found.std(0) / np.sqrt(len(found)), np.linalg.norm(exact)
    assert np.linalg.norm(error) < precision * scale
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * error + slack * scale)


@pytest.mark.ci
@pytest.mark.parametrize("discount", [None, 0.7])
@pytest.mark.parametrize("relative_to", ["previous", "mean"])
def test_with_learned_values_the_mean_estimate_is_the_exact_gradient(relative_to, discount):
    baseline = ActionTransitions(discount=discount, fit=EXACT, relative_to=relative_to)
    mdp = CHAIN.dynamics
    exact = oracle.gradient(mdp, TABLE) if discount is None else oracle.biased_gradient(mdp, TABLE, discount)
    check_mean(estimates(CHAIN, TABLE, baseline, 10_000), oracle.flat(exact), 0.03)


@pytest.mark.ci
def test_wrong_values_bias_it_as_the_page_says():
    """Two inputs for three states: the fixed point of the values, and the gradient that they stand for, exactly."""
    mdp = ThreeState().dynamics
    chance, pi = oracle.action_probabilities(mdp, POINT), oracle.stationary_distribution(mdp, POINT)
    phi, discount = mdp.observations, 0.8
    states, actions = np.divmod(np.arange(6), 2)
    table = np.zeros((6, 4))  # the features of every state and action
    for row, (s, a) in enumerate(zip(states, actions, strict=True)):
        table[row, 2 * a : 2 * a + 2] = phi[s]
    onward = np.einsum("ast,tb->satb", mdp.transitions, chance).reshape(6, 6)
    weight = (pi[:, None] * chance).ravel()
    rewards = mdp.expected_rewards.T.ravel()
    matrix = table.T @ (weight[:, None] * (table - discount * onward @ table))
    quality = table @ np.linalg.solve(matrix, table.T @ (weight * rewards))
    scores = jax.vmap(lambda y, a: POINT.score(y, a).weights.ravel())(jnp.asarray(phi[states]), jnp.asarray(actions))
    biased = np.asarray(scores, float).T @ (weight * quality)
    exact = oracle.flat(oracle.biased_gradient(mdp, POINT, discount))
    assert np.linalg.norm(biased - exact) > 0.1 * np.linalg.norm(exact)
    check_mean(estimates(ThreeState(), POINT, ActionTransitions(discount=discount, fit=EXACT), 10_000), biased, 0.03)


def test_expected_sarsa_and_the_samples_are_those_written_out():
    rate, discount, decay = 0.1, 0.8, 0.6
    rng = np.random.default_rng(0)
    baseline = ActionTransitions(Features(bias=True), discount, decay, TemporalDifference(rate))
    with jax.enable_x64(True):
        policy = Softmax(jnp.asarray(rng.normal(size=(3, 2))))
        agent = Agent(policy, estimator(baseline, 1), SGD(1.0))
        state, weights, trace, previous, stayed = started(agent), np.zeros((3, 3)), 0.0, None, 0
        for step in range(12):
            y, after, reward = rng.normal(size=2), rng.normal(size=2), rng.normal()
            before = state.policy
            ended = step == 7
            _, action, _, state = decided(agent, state, y, rng.random(1), reward, after, terminated=ended)
            a = int(action)
            now, then = np.append(y, 1), np.append(after, 1)
            values = weights @ now
            chance, chance_after = (softmax(np.asarray(before.weights) @ look) for look in (y, after))
            compared = chance @ values if previous is None else values[previous]
            moved = np.asarray(state.policy.weights - before.weights)
            score = np.outer((np.arange(3) == a) - chance, y)
            np.testing.assert_allclose(moved, (values[a] - compared) * score, atol=1e-12)
            stayed += previous == a and not moved.any()
            slope = np.outer(np.arange(3) == a, now)
            later = 0 if ended else discount * chance_after @ (weights @ then)
            trace = discount * decay * trace + slope
            weights = weights + rate * (reward + later - values[a]) * trace
            previous, trace = (None, 0.0) if ended else (a, trace)
            np.testing.assert_allclose(state.estimator.baseline.weights, weights.ravel(), atol=1e-12)
        assert stayed > 0


def test_a_diverged_reward_teaches_it_nothing():
    agent = Agent(POINT, estimator(ActionTransitions(fit=TemporalDifference(0.1))))
    state, _, lost = told(agent, started(agent), [0.5, 0.25], [0.3], np.nan, np.zeros(2), diverged=True)
    for name in ("weights", "reward"):
        one, other = getattr(lost.estimator.baseline, name), getattr(state.estimator.baseline, name)
        jax.tree.map(np.testing.assert_array_equal, one, other)


@pytest.mark.ci
def test_it_finds_the_best_policy():
    fit = LeastSquares(1e-3, interval=20)
    agent = Agent(Softmax(jnp.zeros((2, 2))), estimator(ActionTransitions(fit=fit), 1), SGD(0.1))
    stepper = stepper_for(ThreeState(), agent, range(10))
    stepper.advance(50_000)
    earned = [oracle.average_reward(ThreeState().dynamics, Softmax(w)) for w in stepper.policies().weights]
    assert min(earned) >= 0.795


def test_timlab_has_no_block_for_it_as_no_block_tells_probabilities():
    assert "action-transitions baseline" not in timlab.BLOCKS
    assert "mean baseline" in timlab.BLOCKS


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ActionTransitions(Features(actions=True)), "features.actions = True: must be False"),
        (
            lambda: ActionTransitions(fit=TrueOnlineTemporalDifference()),
            "fit = 'TrueOnlineTemporalDifference': must be LeastSquares or TemporalDifference",
        ),
        (lambda: ActionTransitions(relative_to="next"), "unknown relative_to 'next': known are mean, previous"),
        (
            lambda: ActionTransitions().init(Hyperplanes(jnp.zeros((7, 2)), jnp.zeros(7)), jnp.float32),
            "policy = 'Hyperplanes of 7 binary outputs': must be one of at most 64 actions",
        ),
        (
            lambda: ActionTransitions().init(
                GradedHyperplanes(jnp.zeros((1, 2)), jnp.zeros(1), jnp.zeros(1), jnp.array(0.1)), jnp.float32
            ),
            "policy = 'GradedHyperplanes': must be one with binary or discrete actions",
        ),
        (
            lambda: stepper_for(ThreeState(), Agent(POINT, estimator(ActionTransitions(discount=1.0))), [0]),
            "baseline.discount = 1: needs episodes",
        ),
    ],
)
def test_impossible_settings_are_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()
