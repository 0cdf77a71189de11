"""The baseline that learns its rate: its meta-gradient by autodiff, the best rate of a random walk, and units."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import FixedStep, LearnedStep
from motorgrad.policies import hyperplanes

POLICY = hyperplanes(1, 1)


def follow(baseline, rewards, dtype=jnp.float32):
    """The states after every reward."""

    def step(state, reward):
        state = baseline.learn(state, reward)
        return state, state

    return jax.lax.scan(step, baseline.init(POLICY, dtype), jnp.asarray(rewards, dtype))[1]


def test_without_a_meta_rate_it_is_a_fixed_step_and_knows_how_its_level_depends_on_the_rate():
    rewards = np.random.default_rng(0).normal(size=50)
    with jax.enable_x64(True):

        def last(log_rate):
            return follow(FixedStep(jnp.exp(log_rate)), rewards, jnp.float64)[-1]

        level, slope = jax.value_and_grad(last)(jnp.log(0.2))
        found = follow(LearnedStep(0.2, meta_rate=0.0), rewards, jnp.float64)
    assert float(found.value[-1]) == pytest.approx(float(level), rel=1e-12)
    assert float(found.sensitivity[-1]) == pytest.approx(float(slope), rel=1e-9)


def kalman_gain(ratio):
    """The steady gain for a random walk whose steps have `ratio` times the variance of the noise."""
    return (np.sqrt(ratio**2 + 4 * ratio) - ratio) / 2


@pytest.mark.parametrize("ratio", [0.001, 0.1])
def test_it_learns_the_gain_of_the_kalman_filter(ratio):
    rng = np.random.default_rng(1)
    seeds, length = 40, 60_000
    walk = np.cumsum(rng.normal(size=(seeds, length), scale=np.sqrt(ratio)), axis=1)
    rewards = (walk + rng.normal(size=(seeds, length))).astype(np.float32)
    rates = np.asarray(jax.jit(jax.vmap(lambda r: follow(LearnedStep(0.03), r).log_rate))(rewards))
    late = rates[:, length // 2 :].mean(1)
    assert late.mean() == pytest.approx(np.log(kalman_gain(ratio)), abs=0.1)


def test_the_unit_of_rewards_changes_nothing_and_a_level_of_them_does_no_harm():
    rewards = np.random.default_rng(2).normal(size=300).cumsum() + np.random.default_rng(3).normal(size=300)
    small, large = (follow(LearnedStep(0.05), scale * rewards) for scale in (1.0, 1024.0))
    np.testing.assert_allclose(large.log_rate, small.log_rate, rtol=1e-5)
    np.testing.assert_allclose(large.value, 1024 * small.value, rtol=1e-4)
    still = follow(LearnedStep(0.01), np.full(2_000, 7.0))
    assert float(still.value[-1]) == pytest.approx(7.0, abs=1e-3)
    assert np.isfinite(still.log_rate).all()


def test_the_rate_stays_in_its_range():
    alternating = np.where(np.arange(4_000) % 2 == 0, 1.0, -1.0)
    found = follow(LearnedStep(1e-6, meta_rate=1.0), alternating)
    assert np.exp(found.log_rate).min() == pytest.approx(1e-6, rel=1e-3)
    ramp = follow(LearnedStep(0.01, meta_rate=0.5), np.arange(4_000.0))
    assert np.exp(ramp.log_rate).max() <= 1.0
