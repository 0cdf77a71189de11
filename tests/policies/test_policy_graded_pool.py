"""Units of learned strength: their density, score and Fisher matrix, by quadrature and automatic differentiation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import Compiled

from motorgrad.policies import (
    Factored,
    GradedPool,
    Hyperplanes,
    LocalGaussians,
    abilities,
    describe,
    graded_tiles,
    mixture,
    rebuild,
    trainable,
)


def pool_of(seed, units=3):
    rng = np.random.default_rng(seed)
    local = LocalGaussians(rng.normal(size=(units, 2)), rng.normal(size=(units, 2), scale=0.4), p_max=0.8)
    return GradedPool(local, rng.normal(size=units), rng.normal(size=units) - 1, 0.1)


def drawn(policy, y, count, seed=0):
    return Compiled(policy).samples(y, np.random.default_rng(seed).random((count, policy.uniforms)))


@pytest.mark.parametrize("seed", range(3))
def test_silence_and_strengths_make_up_a_distribution(seed):
    policy, y = Compiled(pool_of(seed, units=1)), np.array([0.2, -0.3])
    spots, step = np.linspace(-40, 40, 200_001, retstep=True)
    spots[np.abs(spots) < 1e-9] = 1e-12
    density = policy.over("log_prob", y, spots[:, None])
    silent = np.exp(policy.log_prob(y, np.zeros(1)))
    assert silent + np.exp(density).sum() * step == pytest.approx(1, abs=1e-4)
    assert silent == pytest.approx(1 - float(policy.prob(y)[0]), rel=1e-5)


def test_it_fires_as_its_pool_does_and_acts_with_its_strength():
    policy, y = pool_of(4), jnp.array([0.1, 0.4])
    actions, p = drawn(policy, y, 40_000), Compiled(policy).prob(y)
    strength, deviation = np.asarray(policy.strength), np.asarray(policy.deviation)
    np.testing.assert_allclose((actions != 0).mean(0), p, atol=0.012)
    for unit in range(3):
        fired = actions[actions[:, unit] != 0, unit]
        error = deviation[unit] / np.sqrt(len(fired))
        assert abs(fired.mean() - strength[unit]) < 5 * error
        assert fired.std() == pytest.approx(deviation[unit], rel=0.1)
    np.testing.assert_allclose(Compiled(policy).mode(y), np.where(p > 0.5, strength, 0))


@pytest.mark.parametrize("seed", range(4))
def test_the_score_is_the_gradient_of_the_log_probability(seed):
    with jax.enable_x64(True):
        policy, y = pool_of(seed), np.random.default_rng(seed + 9).normal(size=2)
        actions = drawn(policy, y, 6, seed)
        analytic, automatic = Compiled(policy).scores(y, actions), Compiled(policy).derivatives(y, actions)
    assert analytic.dtype == np.float64
    np.testing.assert_allclose(analytic, automatic, atol=1e-9)


@pytest.mark.slow
def test_the_fisher_matrix_is_the_mean_of_the_scores_squared():
    policy, y = pool_of(1), jnp.array([-0.2, 0.1])
    (exact,) = abilities.fisher(policy, y, jnp.zeros(3))
    rows = jax.vmap(lambda action: abilities.blocks(policy, policy.score(y, action))[0])(drawn(policy, y, 200_000, 3))
    sampled = jnp.einsum("nui,nuj->uij", rows, rows) / len(rows)
    scale = jnp.sqrt(jnp.einsum("uii,ujj->uij", exact, exact)) + 1e-6
    np.testing.assert_allclose(sampled / scale, exact / scale, atol=0.06)


def test_blocks_are_undone_and_a_stored_policy_is_rebuilt():
    policy = pool_of(2)
    ask = Compiled(policy)
    gradient = ask.score(jnp.array([0.3, 0.3]), jnp.array([0.5, 0.0, -1.0]))
    again = ask.from_blocks(ask.blocks(gradient))
    assert jax.tree.structure(again) == jax.tree.structure(trainable(policy))
    for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(gradient), strict=True):
        np.testing.assert_array_equal(a, b)
    shapes = rebuild(describe(policy))
    assert jax.tree.structure(shapes) == jax.tree.structure(policy)
    assert shapes.strength.shape == (3,)


def test_a_silent_unit_learns_nothing_about_its_strength():
    gradient = Compiled(pool_of(5)).score(jnp.array([0.1, 0.1]), jnp.zeros(3))
    np.testing.assert_array_equal(gradient.strength, 0)
    np.testing.assert_array_equal(gradient.log_deviation, 0)
    assert np.abs(gradient.pool.centre).max() > 0


def test_what_cannot_be_is_refused_by_name():
    local = LocalGaussians(jnp.zeros((2, 2)), jnp.zeros((2, 2)))
    with pytest.raises(ValueError, match=r"strength = \(3,\): must be of shape \(2,\)"):
        GradedPool(local, jnp.zeros(3), jnp.zeros(2))
    with pytest.raises(ValueError, match=r"floor = 0\.0: must be positive"):
        GradedPool(local, jnp.zeros(2), jnp.zeros(2), 0.0)
    with pytest.raises(ValueError, match="pool = 'Factored': must be independent units of one kind"):
        GradedPool(Factored([local, Hyperplanes(jnp.zeros((1, 2)), jnp.zeros(1))]), jnp.zeros(3), jnp.zeros(3))
    with pytest.raises(ValueError, match="infinitely many actions"):
        abilities.enumerate(pool_of(0))


def test_initial_mixtures_and_graded_tiles():
    policy = mixture(2, 10, hyperplanes=2, copies=2, bias=-1.0)
    assert [type(pool).__name__ for pool in policy.pools] == ["LocalGaussians", "Hyperplanes"]
    np.testing.assert_allclose(Compiled(policy).prob(jnp.array([0.25, 0.25]))[-2:], 1 / (1 + np.e), rtol=1e-5)
    graded = graded_tiles(2, 8, copies=2, deviation=0.4, floor=0.1)
    np.testing.assert_allclose(graded.deviation, 0.4, rtol=1e-5)
    for make, named in (
        (lambda: mixture(2, 3, hyperplanes=3), "hyperplanes = 3"),
        (lambda: graded_tiles(2, 4, deviation=0.01), "floor, deviation = "),
    ):
        with pytest.raises(ValueError, match=named):
            make()
