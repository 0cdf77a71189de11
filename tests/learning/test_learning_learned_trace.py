"""A filter that is learned: written out, and against the weights of least error, from the oracle."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import started, told
from scipy.special import expit

import timlab
from motorgrad.learning import (
    ActionTransitions,
    Agent,
    Constant,
    Estimator,
    LearnedTrace,
    LinearBaseline,
    OptimalBaseline,
)
from motorgrad.policies import Hyperplanes, Softmax
from motorgrad.tasks import Chain, ThreeState
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import oracle

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
TABLE = Softmax(np.array([[0.3, -0.2, 0.1, 0.0], [0.0, 0.4, 0.2, 0.0]]))
PLACES = {"three states": (ThreeState(), POINT), "chain": (Chain(length=4), TABLE)}
LENGTH, DECISIONS, SEEDS = 6, 1_000, 200


def exact(task, policy):
    r"""The means of $(r - \eta) s$ for each lag, and the total variances of these products."""
    mdp = task.dynamics
    means = np.array([oracle.flat(oracle.lagged_gradient(mdp, policy, lag)) for lag in range(LENGTH)])
    chance, pi = oracle.action_probabilities(mdp, policy), oracle.stationary_distribution(mdp, policy)
    one = jax.jit(jax.vmap(lambda y: jax.vmap(lambda a: policy.score(y, a).weights.ravel())(jnp.arange(2))))
    lengths = np.square(np.asarray(one(mdp.observations), float)).sum(2)
    weight, squares = np.einsum("s,sa,sa,ast->t", pi, chance, lengths, mdp.transitions), []
    for _ in range(LENGTH):
        squares.append(weight @ np.square(mdp.rewards - pi @ mdp.rewards))
        weight = weight @ oracle.transition_matrix(mdp, policy)
    return means, np.array(squares) - np.square(means).sum(1)


@pytest.mark.representatives("three states")
@pytest.mark.parametrize("name", PLACES)
def test_weights_go_towards_those_of_least_error(name):
    task, policy = PLACES[name]
    means, variances = exact(task, policy)
    lengths = np.square(means).sum(1)
    best = lengths / (lengths + variances / DECISIONS)
    trace = LearnedTrace(LENGTH, 0.0)
    baseline = Constant(oracle.average_reward(task.dynamics, policy))
    stepper = stepper_for(task, Agent(policy, Estimator(trace, baseline, update_every="never")), range(SEEDS))
    stepper.advance(DECISIONS)
    state = stepper.state["cycle"].agent.estimator.trace
    weights = np.asarray(jax.jit(jax.vmap(trace.weights))(state), float)
    # a single estimate is noisy where signal and noise are alike, and its mean above 0 where there is no signal
    np.testing.assert_allclose(weights.mean(0), best, atol=0.22)
    sure = best > 0.95
    assert sure.any()
    np.testing.assert_allclose(weights[:, sure].mean(0), best[sure], atol=0.02)
    found = np.asarray(state.means.mean[0].weights, float).reshape(SEEDS, LENGTH, -1)
    error = found.std(0) / np.sqrt(SEEDS)
    np.testing.assert_array_less(np.abs(found.mean(0) - means), 4.5 * error)
    filtered = np.sum(weights[:, :, None] * found, 1)
    whole = oracle.flat(oracle.gradient(task.dynamics, policy))
    errors = [np.square(each - whole).sum(1) for each in (filtered, found.sum(1))]
    assert errors[0].mean() < errors[1].mean()  # than those of a window


def test_the_rule_is_the_one_written_out():
    """The recursion, against sums over all samples with their weights."""
    rate, length = 0.2, 3
    with jax.enable_x64(True):
        policy = Hyperplanes(jnp.array([[0.5, -0.2], [0.1, 0.3]], jnp.float64), jnp.zeros(2, jnp.float64))
        agent = Agent(policy, Estimator(LearnedTrace(length, rate), Constant(0.3), update_every="never"))
        state, rng = started(agent), np.random.default_rng(1)
        scores, samples, total = [], [], np.zeros(6)
        for step in range(1, 11):
            y, reward, ended = rng.normal(size=2), rng.normal(), step == 6
            _, action, state = told(agent, state, y, rng.random(2), reward, np.zeros(2), truncated=ended)
            surprise = np.asarray(action) - expit(np.asarray(policy.weights) @ y)
            scores = [np.append(np.outer(surprise, y), surprise), *scores][:length]
            rows = np.zeros((length, 6))
            rows[: len(scores)] = scores
            weights = np.zeros(length)
            if len(samples) > 1:
                shares = np.ones(1)
                for n in range(2, len(samples) + 1):
                    now = max(1 / n, rate)
                    shares = np.append((1 - now) * shares, now)
                mean = np.tensordot(shares, samples, 1)
                share = np.square(shares).sum()
                spread = np.tensordot(shares, np.square(np.array(samples) - mean), 1).sum(1) / (1 - share)
                lengths = np.square(mean).sum(1)  # 0 for lags before the first decision
                weights = np.where(lengths > 0, np.maximum(1 - share * spread / np.maximum(lengths, 1e-300), 0), 0)
            total += (reward - 0.3) * weights @ rows
            samples.append((reward - 0.3) * rows)
            scores = [] if ended else scores
            found = np.append(np.ravel(state.gradient.mean.weights), state.gradient.mean.bias)
            np.testing.assert_allclose(found, total / step, atol=1e-12)
        assert np.abs(total).max() > 0.1


@pytest.mark.ci
def test_a_diverged_reward_teaches_it_nothing_and_an_episode_ends_without_forgetting():
    agent = Agent(POINT, Estimator(LearnedTrace(3, 0.1), OptimalBaseline(each="parameter")))
    state = started(agent)
    for diverged in (False, True):
        reward = np.nan if diverged else 1.0
        acted, _, state = told(agent, state, [0.5, 0.25], [0.3], reward, np.zeros(2), diverged=diverged)
        before = acted.estimator.trace
    jax.tree.map(np.testing.assert_array_equal, state.estimator.trace[1:], before[1:])
    assert int(before.means.count) == 1
    assert not np.asarray(state.estimator.trace.scores.weights).any()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: LearnedTrace(length=0), "length = 0"),
        (lambda: LearnedTrace(rate=1.0), "rate = 1.0"),
        (
            lambda: Estimator(LearnedTrace(), LinearBaseline()),
            "baseline = 'LinearBaseline': must be one that credits all actions alike, .* with LearnedTrace",
        ),
        (lambda: Estimator(LearnedTrace(), ActionTransitions()), "baseline = 'ActionTransitions'"),
        (lambda: Estimator(LearnedTrace(), entropy=0.1, entropy_in="trace"), "entropy_in = 'trace'"),
        (
            lambda: agent_for("particle", kind="sparse", trace="learned"),
            "unknown setting of agent 'trace': known are",
        ),
        (lambda: timlab.LearnedTrace(newest=True), "newest = True: must be False"),
    ],
)
def test_impossible_settings_are_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()
