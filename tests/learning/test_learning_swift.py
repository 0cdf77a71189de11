"""SwiftTD: what it is without meta-learning, its derivatives, its bound, and which features it comes to trust."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import CriticStep, NetworkCritic, SwiftTemporalDifference, TrueOnlineTemporalDifference


def follow(fit, features, targets, decay, discount=0.9):
    """The weights and the state after decisions whose temporal difference is a target less the value, in double
    precision; with `discount` of 1 less nothing bootstraps."""

    def decide(carry, now):
        weights, state = carry
        phi, after, target = now
        step = CriticStep(phi, after, target, jnp.zeros(()), target - weights @ phi, discount, decay)
        return fit.update(weights, state, step), None

    weights = jnp.zeros(features.shape[1], jnp.float64)
    start = weights, fit.init(weights, weights.size)
    return jax.jit(lambda start: jax.lax.scan(decide, start, (features[:-1], features[1:], targets))[0])(start)


def stream(size, steps=12, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(steps + 1, size)), rng.normal(size=steps)


def test_with_fixed_step_sizes_it_is_true_online_td():
    features, targets = stream(3)
    with jax.enable_x64(True):
        swift, state = follow(SwiftTemporalDifference(0.05, 0.0, bound=1.0), 0.3 * features, targets, 0.8)
        plain, other = follow(TrueOnlineTemporalDifference(0.05), 0.3 * features, targets, 0.8)
        np.testing.assert_allclose(swift, plain, atol=1e-12)
        np.testing.assert_allclose(state.trace, 0.05 * other.trace, atol=1e-12)  # it has the step size in it
        np.testing.assert_allclose(jnp.exp(state.log_rates), 0.05, atol=1e-12)


@pytest.mark.parametrize("decay", [pytest.param(0.0, marks=pytest.mark.ci), 0.8])
def test_the_slopes_are_the_derivatives_of_the_weight_by_the_step_size(decay):
    features, targets = stream(1)

    def weight(log_rate):
        fit = SwiftTemporalDifference(0.1, 0.0, bound=1.0)
        start = fit.init(jnp.zeros(1, jnp.float64), 1)

        def decide(carry, now):
            weights, state = carry
            phi, after, target = now
            step = CriticStep(phi, after, target, jnp.zeros(()), target - weights @ phi, 1.0, decay)
            return fit.update(weights, state, step), None

        carry = jnp.zeros(1), start._replace(log_rates=log_rate * jnp.ones(1))
        (weights, state), _ = jax.lax.scan(decide, carry, (0.5 * features[:-1], 0.5 * features[1:], targets))
        return weights[0], (state.slopes[0], state.trace_slopes[0], state.trace[0])

    with jax.enable_x64(True):
        (exact, derivatives), (_, (slope, trace_slope, _)) = (
            jax.jit(jax.jacfwd(weight))(np.log(0.1)),
            jax.jit(weight)(np.log(0.1)),
        )
        assert slope == pytest.approx(float(exact), rel=1e-9)
        assert trace_slope == pytest.approx(float(derivatives[2]), rel=1e-9)


def test_a_step_takes_away_no_more_than_the_bound_of_an_error():
    fit = SwiftTemporalDifference(0.1, 0.0, bound=0.1, shrinkage=0.5)
    phi = jnp.array([3.0, 4.0])  # Σ α φ² = 2.5
    step = CriticStep(phi, 0 * phi, jnp.ones(()), jnp.zeros(()), jnp.ones(()), 0.9, 0.8)
    weights, state = fit.update(jnp.zeros(2), fit.init(jnp.zeros(2), 2), step)
    assert float(weights @ phi) == pytest.approx(0.1, rel=1e-5)
    np.testing.assert_allclose(jnp.exp(state.log_rates), 0.1 * 0.5 ** np.square([3.0, 4.0]), rtol=1e-4)
    assert np.abs(state.slopes).max() == np.abs(state.trace_slopes).max() == 0


@pytest.mark.ci
def test_it_learns_which_features_predict():
    """Of ten features of ±1 one tells the reward, by a weight that changes its sign now and then (Sutton, 1992)."""
    fit, rng = SwiftTemporalDifference(0.01, 1e-3), np.random.default_rng(3)
    features = jnp.asarray(rng.choice([-1.0, 1.0], size=(4_001, 10)), jnp.float32)
    rewards = features[:-1, 0] * np.repeat(rng.choice([-1.0, 1.0], size=200), 20) + rng.normal(size=4_000)

    def decide(carry, now):
        weights, state = carry
        phi, after, reward = now
        error = reward - weights @ phi
        return fit.update(weights, state, CriticStep(phi, after, reward, jnp.zeros(()), error, 0.0, 0.0)), None

    first = jnp.zeros(10), fit.init(jnp.zeros(10), 10)
    _, state = jax.jit(lambda: jax.lax.scan(decide, first, (features[:-1], features[1:], rewards))[0])()
    rates = np.exp(state.log_rates)
    assert rates[0] > 0.05
    assert rates[1:].max() < 0.2 * rates[0]


@pytest.mark.ci
def test_a_dropped_decision_changes_nothing_and_an_episode_cuts_the_trace():
    features, targets = stream(2)
    with jax.enable_x64(True):
        fit = SwiftTemporalDifference(0.05)
        weights, state = follow(fit, features, targets, 0.8)
        nan = CriticStep(*[jnp.full(2, jnp.nan)] * 2, *[jnp.asarray(jnp.nan)] * 3, 0.9, 0.8)
        kept = fit.update(weights, state, nan, jnp.asarray(True))
        jax.tree.map(np.testing.assert_array_equal, kept, (weights, state))
        fresh = fit.restart(state)
        assert not fresh.trace.any()
        assert not fresh.credit.any()
        np.testing.assert_array_equal(fresh.slopes, state.slopes)
        # after a restart the step is that of TD(0)
        step = CriticStep(features[0], features[1], 1.0, jnp.zeros(()), jnp.asarray(0.7), 0.9, 0.8)
        moved, _ = fit.update(weights, fresh, step)
        share = np.exp(state.log_rates) * np.square(features[0])
        rates = np.exp(state.log_rates) * min(1, 0.5 / share.sum())
        np.testing.assert_allclose(moved - weights, 0.7 * rates * features[0], atol=1e-12)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: SwiftTemporalDifference(initial=0.2, bound=0.1), "initial = 0.2: must be at most the bound, 0.1"),
        (lambda: SwiftTemporalDifference(shrinkage=0.0), "shrinkage = 0.0"),
        (lambda: SwiftTemporalDifference(meta_rate=-1.0), "meta_rate = -1.0"),
        (lambda: NetworkCritic(fit=SwiftTemporalDifference()), "fit = 'SwiftTemporalDifference'"),
    ],
)
def test_impossible_settings_are_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()
