"""Reinforcement baselines against their formulas, and the running mean over very many samples."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorgrad.learning import (
    Constant,
    Estimator,
    FixedStep,
    MeanReward,
    RunningMean,
    Transition,
    add_sample,
    running_mean,
)
from motorgrad.policies import Softmax


def recency(rate):
    def after(rewards):
        ages = np.arange(len(rewards))[::-1]
        return np.sum(rate * (1 - rate) ** ages * rewards)

    return after


POLICY = Softmax([[0.5], [-0.5]])

# name: (the baseline, its value after an array of rewards)
BASELINES = {
    "constant": (Constant(-0.3), lambda rewards: -0.3),
    "mean": (MeanReward(), lambda rewards: np.mean(rewards) if len(rewards) else 0.0),
    "fixed step": (FixedStep(0.05), recency(0.05)),
    "fixed step of one": (FixedStep(1.0), lambda rewards: rewards[-1] if len(rewards) else 0.0),
}


@pytest.mark.ci
@pytest.mark.representatives("mean", "fixed step")
@pytest.mark.parametrize("name", BASELINES)
@settings(max_examples=30, deadline=None, derandomize=True)
@given(rewards=st.lists(st.floats(-1e3, 1e3), max_size=40))
def test_baseline_is_its_formula_after_any_rewards(name, rewards):
    baseline, formula = BASELINES[name]
    with jax.enable_x64(True):
        state = baseline.init(POLICY, jnp.float64)
        values = [float(baseline.level(state))]
        for reward in rewards:
            state = baseline.learn(state, jnp.asarray(reward))
            values.append(float(baseline.level(state)))
    expected = [formula(np.asarray(rewards[:n])) for n in range(len(rewards) + 1)]
    # forty roundings of numbers up to 1e3
    np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-11)


def test_without_a_baseline_the_level_is_nought_and_the_advantage_the_reward():
    estimator = Estimator(baseline=None)
    state = estimator.init(POLICY)
    assert float(estimator.level(state)) == 0
    state = estimator.act(state, jnp.zeros(1), POLICY)
    sample, _ = estimator.sample(state, POLICY, Transition(None, None, jnp.float32(3.0), jnp.zeros(1)))
    np.testing.assert_array_equal(sample.weights, 3 * POLICY.weights)


@pytest.mark.parametrize("rate", [0.0, -0.1, 1.5, float("nan")])
def test_a_fixed_step_outside_its_range_is_refused(rate):
    with pytest.raises(ValueError, match=r"rate = .*: must be in \(0, 1\]"):
        FixedStep(rate)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_constant_that_is_no_number_is_refused(value):
    with pytest.raises(ValueError, match=r"value = .*: must be a finite number"):
        Constant(value)


def naive(mean, first, samples):
    """The plain single-precision running mean, for comparison."""

    def step(carry, x):
        mean, n = carry
        n = n + 1
        return (mean + (x - mean) / n.astype(jnp.float32), n), None

    return jax.lax.scan(step, (jnp.float32(mean), jnp.uint32(first)), samples)[0][0]


@jax.jit
def add_all(running, samples):
    return jax.lax.scan(lambda state, x: (add_sample(state, x), None), running, samples)[0]


def double(running):
    return float(np.float64(running.mean) + np.float64(running.carry))


@pytest.mark.parametrize("sample", [1.0, 0.25, -3.0])
def test_the_mean_still_moves_at_a_thousand_million_samples(sample):
    before, count, more = 0.5, 999_999_999, 20_000
    running = RunningMean(jnp.float32(before), jnp.float32(0), jnp.uint32(count))
    samples = jnp.full(more, sample, jnp.float32)
    after = add_all(running, samples)
    exact = (before * count + sample * more) / (count + more)
    assert int(after.count) == count + more
    # The shift, of 5e-6 to 7e-5, comes out to a ten-thousandth of itself …
    assert double(after) - before == pytest.approx(exact - before, rel=1e-4)
    # … and the mean itself to its own rounding, 3e-8 at one half,
    assert float(after.mean) == pytest.approx(exact, abs=3.1e-8)
    # … whereas without the carry every single step is lost.
    if sample > 0:
        assert float(naive(before, count, samples)) == before


def test_a_mean_of_three_million_samples_is_that_of_double_precision_where_a_plain_one_lags_behind():
    # From the middle on a step is 0.01 / 1.5e6 = 7e-9 or less, below half an ulp of 0.5, 3e-8: a plain mean stays.
    samples = np.repeat(np.float32([0.5, 0.51]), 1_500_000)
    exact = samples.astype(np.float64).mean()
    running = add_all(running_mean(jnp.zeros(())), jnp.asarray(samples))
    assert float(running.mean) == pytest.approx(exact, abs=3.1e-8)  # half an ulp
    assert double(running) == pytest.approx(exact, abs=1e-9)
    assert float(naive(0, 0, jnp.asarray(samples))) == pytest.approx(0.5, abs=1e-6)


def test_the_mean_of_a_tree_is_the_mean_of_every_leaf():
    rng = np.random.default_rng(0)
    samples = {"a": rng.normal(size=(50, 3)), "b": (rng.normal(size=(50, 2, 2)),)}
    with jax.enable_x64(True):
        running = running_mean(jax.tree.map(lambda x: jnp.zeros(x.shape[1:]), samples))
        running = add_all(running, jax.tree.map(jnp.asarray, samples))
        mean = jax.tree.map(np.asarray, running.mean)
    assert int(running.count) == 50
    np.testing.assert_allclose(mean["a"], samples["a"].mean(0), atol=1e-14)
    np.testing.assert_allclose(mean["b"][0], samples["b"][0].mean(0), atol=1e-14)
