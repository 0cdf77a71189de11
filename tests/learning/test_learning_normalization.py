"""Normalised advantages: against a plain reckoning, the exact oracle, and rewards in other units."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decided, started
from hypothesis import given, settings
from hypothesis import strategies as st

import motorgrad as mg
from motorgrad.learning import (
    SGD,
    Agent,
    BinnedBaseline,
    Estimator,
    Exponential,
    MeanReward,
    RootMeanSquare,
    olgarb,
)
from motorgrad.policies import Softmax
from motorgrad.tasks import ThreeState
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import oracle

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
BASELINES = {"mean": MeanReward(), "binned": BinnedBaseline(0.2, 0.8, 6)}


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    advantages=st.lists(st.floats(-100, 100).filter(lambda x: x == 0 or abs(x) > 1e-3), min_size=1, max_size=40),
    rate=st.sampled_from([0.01, 0.3]),
)
def test_the_factor_is_one_over_the_weighted_root_mean_square(advantages, rate):
    scale = RootMeanSquare(rate)
    with jax.enable_x64(True):
        state = scale.init(jnp.float64)
        for count, advantage in enumerate(advantages, 1):
            state = scale.update(state, np.float64(advantage))
            weights = (1 - rate) ** np.arange(count)[::-1]
            square = np.average(np.square(advantages[:count]), weights=weights)
            expected = 1 / np.sqrt(square) if square else 0.0
            assert float(scale.factor(state)) == pytest.approx(expected, rel=1e-9)
            assert abs(advantage * float(scale.factor(state))) <= 1 / np.sqrt(rate) + 1e-9


def walk(estimator, scale, steps=40):
    """The parameters along a made-up stream of rewards, in units of `scale`."""
    agent = Agent(POINT, estimator, SGD(0.1))
    state, rng = started(agent), np.random.default_rng(0)
    for _ in range(steps):
        state = decided(agent, state, rng.random(2), rng.random(1), scale * rng.normal()).state
    return np.asarray(state.policy.weights)


@pytest.mark.ci
@pytest.mark.parametrize("discount", [None, 0.9])
@pytest.mark.parametrize("name", BASELINES)
def test_the_unit_of_the_reward_does_not_matter(name, discount):
    normal, plain = (
        Estimator(Exponential(0.8), BASELINES[name], discount, normalization=scale)
        for scale in (RootMeanSquare(0.1), None)
    )
    # by powers of two, so that nothing is rounded otherwise
    np.testing.assert_array_equal(walk(normal, 1.0), walk(normal, 1024.0))
    assert not np.allclose(walk(plain, 1.0), walk(plain, 1024.0))


def test_the_mean_sample_is_the_gradient_by_the_usual_advantage():
    decay, task = 0.5, ThreeState()
    estimator = Estimator(Exponential(decay), update_every="never", normalization=RootMeanSquare(1e-3))
    stepper = stepper_for(task, Agent(POINT, estimator, SGD(0.0)), range(200))
    stepper.advance(4_000)
    found = np.asarray(stepper.state["cycle"].agent.gradient.mean.weights, float).reshape(200, -1)
    eta = oracle.average_reward(task.dynamics, POINT)  # rewards of 0 and 1: their deviation is √(η(1 − η))
    exact = oracle.flat(oracle.biased_gradient(task.dynamics, POINT, decay)) / np.sqrt(eta * (1 - eta))
    tolerance = 4 * found.std(0) / np.sqrt(len(found)) + 0.01 * np.abs(exact)
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), tolerance)


def test_without_any_advantage_nothing_moves():
    agent = Agent(POINT, Estimator(Exponential(0.8), None, normalization=RootMeanSquare()), SGD(0.1))
    state = started(agent)
    for _ in range(3):
        state = decided(agent, state, [0.3, 0.5], [0.3], 0.0).state
    np.testing.assert_array_equal(state.policy.weights, POINT.weights)


def test_a_diverged_decision_does_not_count():
    agent = Agent(POINT, Estimator(Exponential(0.8), normalization=RootMeanSquare()), SGD(0.1))
    state = decided(agent, started(agent), [0.3, 0.5], [0.3], 2.0).state
    after = decided(agent, state, [0.3, 0.5], [0.3], np.nan, diverged=True).state
    assert after.estimator.normalization == state.estimator.normalization
    np.testing.assert_array_equal(after.policy.weights, state.policy.weights)


@pytest.mark.ci
def test_a_run_that_was_stopped_goes_on_bit_for_bit(tmp_path):
    task = mg.make("call-admission")
    agent = agent_for(task, normalization={"rate": 0.01})
    whole = mg.train(task, agent, 600, 3, tmp_path / "whole", window=100, progress=False)
    mg.train(task, agent, 300, 3, tmp_path / "parts", window=100, progress=False)
    parts = mg.train(task, agent, 600, 3, tmp_path / "parts", window=100, progress=False)
    assert jax.tree.all(jax.tree.map(np.array_equal, parts.policies, whole.policies))
    plain = mg.train(task, agent_for(task), 600, 3, progress=False)
    assert not jax.tree.all(jax.tree.map(np.array_equal, plain.policies, whole.policies))


def test_settings_make_it_and_the_plain_learner_has_none():
    task = mg.make("chain")
    assert agent_for(task).estimator.normalization is None
    assert agent_for(task, normalization={"rate": 0.02}).estimator.normalization == RootMeanSquare(0.02)
    assert agent_for(task, normalization="root-mean-square").estimator.normalization == RootMeanSquare()
    assert Agent(POINT, olgarb(0.8)).init(jax.random.key(0)).estimator.normalization is None


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: RootMeanSquare(0.0), r"rate = 0.0: must be in \(0, 1\)"),
        (lambda: RootMeanSquare(1.0), r"rate = 1.0: must be in \(0, 1\)"),
        (lambda: RootMeanSquare(float("nan")), "rate = nan"),
        (lambda: Estimator(normalization=0.1), "normalization = 0.1: must be None or a RootMeanSquare"),
        (lambda: agent_for("chain", normalization="root-mean-squares"), "did you mean 'root-mean-square'"),
        (
            lambda: agent_for("chain", normalization={"rate": 2.0}),
            "agent.estimator.normalization.rate = 2.0",
        ),
    ],
)
def test_impossible_settings_are_refused_by_name(make, names):
    with pytest.raises(ValueError, match=names):
        make()
