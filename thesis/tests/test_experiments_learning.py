"""The experiments about learning: their closed forms against other ways to the same number, their judgements, and each
from end to end."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate

from motorgrad.learning import Constant, MeanReward
from motorgrad.policies import Softmax
from motorgrad.statistics import mean_of
from motorgrad.tasks import ThreeState
from motorgrad.training import train as train_run
from motorgrad.worlds import FiniteMDP, chain, oracle
from motorgrad_thesis import EXPERIMENTS, reproduce
from motorgrad_thesis.chapter_2._landscape import Bumps, climb, greatest, learn, objective
from motorgrad_thesis.chapter_2.figure_2_2 import HillClimbing
from motorgrad_thesis.chapter_3._baseline_claims import shared_rewards, variances
from motorgrad_thesis.chapter_3._estimates import (
    along,
    biases,
    comparison_point,
    estimates,
    mixing_time,
    relative_error,
    scores,
    variance,
)
from motorgrad_thesis.chapter_3.figure_3_1 import Learner
from motorgrad_thesis.chapter_3.section_3_2_1 import Baselines, surprise

BUMPS = Bumps(np.array([0.6, 1.0]), np.array([-1.5, 1.0]), np.array([0.5, 0.4]))
MDP = ThreeState().dynamics
RUNS = 400


# --- figure 2.2 ---


@pytest.mark.parametrize("point", [(0.3, 0.05), (-1.0, 0.7), (0.5, 3.0)])
def test_the_objective_is_the_mean_reward_by_quadrature(point):
    mean, deviation = point

    def integrand(x):
        reward = np.sum(BUMPS.height * np.exp(-0.5 * ((x - BUMPS.centre) / BUMPS.width) ** 2))
        return reward * np.exp(-0.5 * ((x - mean) / deviation) ** 2) / (deviation * np.sqrt(2 * np.pi))

    with jax.enable_x64(True):
        found = float(jax.jit(objective)(jax.tree.map(jnp.asarray, BUMPS), jnp.asarray(point)))
    span = (mean - 9 * deviation, mean + 9 * deviation)
    assert found == pytest.approx(integrate.quad(integrand, *span, limit=200, epsabs=1e-12)[0], abs=1e-9)


def test_climbing_ends_on_an_optimum_without_noise_and_never_goes_down():
    path = climb(BUMPS, np.array([[-1.2, 0.4], [0.0, 3.0]]), 2000, 100)
    height = np.asarray(jax.jit(jax.vmap(jax.vmap(lambda point: objective(BUMPS, point))))(path))
    assert np.all(np.diff(height, axis=1) > -1e-6)
    assert np.abs(path[:, -1, 1]).max() < 1e-3
    assert path[:, -1, 0] == pytest.approx([-1.5, 1.0], abs=0.02)
    assert height[1, -1] == pytest.approx(greatest(BUMPS, -4, 4), abs=1e-3)


def test_learning_from_rewards_follows_the_exact_gradient_on_average():
    # one small step of time: 20 decisions at rate 0.001 move by 20 · 0.001 · σ² · ∇ρ, and little enough to be straight
    start, decisions, rate = np.array([-0.2, 0.8]), 20, 0.001
    ends = learn(BUMPS, np.tile(start, (20_000, 1)), decisions, rate, 1, seed=0)[:, -1]
    moved = (ends - start) / (decisions * rate * start[1] ** 2)
    exact = np.asarray(jax.jit(jax.grad(objective, argnums=1))(BUMPS, start))
    error = moved.std(axis=0) / np.sqrt(len(moved))
    assert np.all(error < 0.01)
    np.testing.assert_array_less(np.abs(moved.mean(axis=0) - exact), 4 * error + 0.02 * np.abs(exact).max())


# --- figure 3.1 and section 3.2.1 ---


def test_scores_are_the_derivative_of_the_log_probability():
    found = scores(MDP, comparison_point())
    # an action's mean score is 0 in every state, whatever the policy
    chosen = oracle.action_probabilities(MDP, comparison_point())
    assert np.einsum("sa,sai->si", chosen, found) == pytest.approx(0, abs=1e-12)
    with jax.enable_x64(True):
        seen = jnp.asarray(MDP.observations[1])
        weights = np.array([[1.0, 1.0], [-1.0, -1.0]])
        slope = jax.jit(jax.grad(lambda weights: Softmax(weights).log_prob(seen, 0)))(weights)
    assert found[1, 0] == pytest.approx(np.ravel(slope), abs=1e-12)


@pytest.mark.parametrize("level", [0.0, 0.6])
def test_the_exact_variance_is_that_of_many_runs(level):
    decay, length = 0.8, 2_000
    found = estimates(decay, Constant(level), [length], RUNS)[0]
    measured = mean_of(variances(found, length))
    # twice the interval, and 2 % for what a run of finite length lacks
    exact = variance(MDP, comparison_point(), decay)(level)
    assert abs(measured.value - exact) < 2 * (measured.high - measured.value) + 0.02 * exact


def test_the_variance_without_a_trace_in_a_world_without_memory_is_that_of_one_sample():
    # every step leads to either state as a coin falls: samples are independent, so their variance is elementary
    coin = FiniteMDP(np.full((2, 2, 2), 0.5), [[0.0, 0.0], [1.0, 1.0]], [[1.0], [1.0]])
    policy = Softmax([[0.2], [-0.3]])
    p = oracle.action_probabilities(coin, policy)[0]
    shape = variance(coin, policy, 0.0)
    for level in (0.0, 0.4):
        samples = np.array([reward - level for reward in (0.0, 1.0)])[:, None] * (np.eye(2) - p)
        expected = np.sum(p @ samples**2 - (p @ samples) ** 2)
        assert shape(level) == pytest.approx(expected, rel=1e-4)  # the policy is of single precision
    assert shape.best == pytest.approx(p[0], rel=1e-4)  # weights the rewards by the squared scores of the actions


def test_a_running_mean_takes_from_the_estimate_what_is_foretold():
    lengths, decay = [100, 1_000], 0.95
    truth = oracle.flat(oracle.biased_gradient(MDP, comparison_point(), decay))
    eta = oracle.average_reward(MDP, comparison_point())
    compared, fair = (estimates(decay, b, lengths, RUNS) for b in (MeanReward(), Constant(eta)))
    added = along(compared - fair, truth)
    for row, foretold in zip(added, shared_rewards(decay, np.array(lengths)), strict=True):
        measured = mean_of(row)
        assert abs(measured.value - foretold) < 2 * (measured.high - measured.value)
        assert measured.high < 0
    # the approximation for long runs
    long = 10**6
    closed = -decay / (1 - decay) * (np.log((1 - decay) * long) + np.euler_gamma) / long
    assert shared_rewards(decay, np.array([long]))[0] == pytest.approx(closed, rel=1e-4)


def test_the_mixing_time_and_the_bias_of_a_trace():
    walk, idle = chain(6), Softmax(np.zeros((2, 6)))
    steps, matrix = mixing_time(walk, idle), oracle.transition_matrix(walk, idle)
    stationary = oracle.stationary_distribution(walk, idle)
    far = [0.5 * np.abs(np.linalg.matrix_power(matrix, t) - stationary).sum(1).max() for t in (steps - 1, steps)]
    assert far[0] > 0.25 >= far[1]
    assert biases(walk, idle, [1.0, 1e6]) == pytest.approx([1.0, 0.0], abs=0.03)


@pytest.mark.ci
def test_surprise_is_the_mean_distance_of_rewards_from_the_baseline():
    task = ThreeState()
    run = train_run(task, {"estimator": "olpomdp"}, 400, 2, window=100, progress=False)
    decision, found = surprise(run)
    assert list(decision) == [100, 200, 300, 400]
    np.testing.assert_allclose(found, run.curve("reward")[1])  # compared with nothing


def test_measures():
    truth = np.array([3.0, 4.0])
    assert relative_error(np.array([[3.0, 4.0], [3.0, 9.0]]), truth) == pytest.approx([0, 1])
    assert along(np.array([[6.0, 8.0], [4.0, -3.0]]), truth) == pytest.approx([2, 0])


def synthetic(shift):
    """Errors as of many runs around the figures of others, off by `shift` of their own spread."""
    numbers = np.random.default_rng(1)
    published = {"none": (0.752, 0.241, 0.084), "mean": (0.217, 0.066, 0.021)}
    values = {"decay": np.array([0.0, 0.95]), "length": np.array([1_000, 10_000, 100_000])}
    for name, figures in published.items():
        centre = np.array(figures)[None, :, None] * np.array([0.5, 1.0])[:, None, None]
        noise = numbers.normal(size=(2, 3, 2_000))
        noise -= noise.mean(axis=-1, keepdims=True)
        values[f"error {name}"] = centre * (1 + 0.5 * (shift + noise))
    values |= {"average reward": np.array(0.29419747), "exact bias": np.array([0.0770765, 0.0041583])}
    values |= {"gradient": np.array([-0.03272585, -0.03524847, 0.03272585, 0.03524847])}
    values |= {"bias": np.array([[0.0770, 0.0772], [0.0040, 0.0043]]), "decision": np.array([0, 10])}
    return values | {"earned": np.array([[0.5, 0.7995], [0.5, 0.7992]])}


def test_figures_of_others_are_judged_within_a_tenth():
    judged = [claim.holds for claim in Learner().claims(synthetic(0.0)) if "mean relative error" in claim.statement]
    assert judged == [True] * 6
    # a shift of 0.3 of a spread of one half
    judged = [claim.verdict for claim in Learner().claims(synthetic(0.3)) if "mean relative error" in claim.statement]
    assert judged == ["refuted"] * 6


def test_one_seed_that_does_not_learn_refutes_that_every_seed_does():
    values = synthetic(0.0)
    assert list(Learner().claims(values))[-1].holds
    values["earned"][1, -1] = 0.79
    assert not list(Learner().claims(values))[-1].holds


# --- from end to end ---

QUICK = [pytest.param(HillClimbing, marks=pytest.mark.ci), Learner, Baselines]


@pytest.mark.slow
@pytest.mark.parametrize("kind", QUICK)
def test_a_quick_run_goes_from_end_to_end_and_is_taken_up(kind, tmp_path):
    assert EXPERIMENTS[kind.name] is kind
    done = reproduce(kind.quick(), tmp_path, quick=True, progress=False)
    assert done.figure.stat().st_size > 10_000
    assert len(done.claims) >= 6
    for claim in done.claims:
        assert np.isfinite(claim.measured.value), claim.statement
        assert claim.measured.low <= claim.measured.value <= claim.measured.high
    again = reproduce(kind.quick(), tmp_path, quick=True, progress=False)
    assert again.claims == done.claims


@pytest.mark.parametrize(
    ("kind", "settings", "named"),
    [
        (HillClimbing, {"columns": 2}, "columns"),
        (HillClimbing, {"decisions": 10}, "decisions"),
        (Learner, {"longest": 500}, "longest"),
        (Learner, {"decays": (0.0, 0.5)}, "decays"),
        (Baselines, {"runs": 3}, "runs"),
        (Baselines, {"decays": (0.0,)}, "decays"),
        (Baselines, {"constants": (0.5, 0.2)}, "constants"),
    ],
)
def test_impossible_settings_are_refused_by_name(kind, settings, named):
    with pytest.raises(ValueError, match=rf"^{named} = "):
        dataclasses.replace(kind(), **settings)
