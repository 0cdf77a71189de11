"""Graded units: their density, score and Fisher matrix, by quadrature and automatic differentiation."""

import json

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from policy_examples import Compiled, compiled
from scipy import stats

from motorgrad.learning import FisherMetric
from motorgrad.policies import (
    Factored,
    GradedHyperplanes,
    GradedMotoneurons,
    GradedUnits,
    abilities,
    describe,
    fixed,
    graded_hyperplanes,
    graded_motoneurons,
    rebuild,
    split,
    trainable,
)

seeds = st.integers(0, 2**31)
few = settings(max_examples=30, deadline=None, derandomize=True)


class Bumps(GradedUnits):
    """Another positive function of two inputs, one of whose parameters all units share."""

    centre: jax.Array = eqx.field(converter=jnp.asarray)
    height: jax.Array = eqx.field(converter=jnp.asarray)
    log_deviation: jax.Array = eqx.field(converter=jnp.asarray)
    floor: jax.Array = fixed(converter=jnp.asarray, default=0.1)
    inputs = 2

    def mean(self, observation):
        return self.height * jnp.exp(-jnp.sum((observation - self.centre) ** 2, axis=-1))

    def mean_gradient(self, observation):
        away = observation - self.centre
        bump = jnp.exp(-jnp.sum(away**2, axis=-1))
        return {"centre": 2 * away * (self.height * bump)[:, None], "height": bump}


def pool_of(seed, units=3, floor=0.05):
    rng = np.random.default_rng(seed)
    return GradedMotoneurons(rng.normal(size=units), rng.normal(size=units, scale=3), rng.normal(size=units) - 1, floor)


def bumps_of(seed):
    rng = np.random.default_rng(seed)
    return Bumps(rng.normal(size=(2, 2)), rng.normal(size=2), rng.normal(size=2), 0.1)


def hyperplanes_of(seed):
    rng = np.random.default_rng(seed)
    return GradedHyperplanes(rng.normal(size=(3, 2)), rng.normal(size=3), rng.normal(size=3) - 1, 0.05)


KINDS = {"motoneurons": pool_of, "bumps": bumps_of, "hyperplanes": hyperplanes_of}


def drawn(kind, seed):
    """A policy, an observation and an action up to five deviations away."""
    policy, rng = KINDS[kind](seed), np.random.default_rng([seed, 1])
    observation, noise = rng.normal(size=policy.inputs), rng.uniform(-5, 5, policy.outputs)
    return policy, observation, Compiled(policy).mean(observation) + deviation(policy) * noise


def deviation(policy):
    return np.asarray(policy.floor) + np.exp(np.asarray(policy.log_deviation))


@pytest.mark.representatives("motoneurons")
@pytest.mark.parametrize("kind", KINDS)
@few
@given(seed=seeds)
def test_the_analytic_score_is_the_derivative_of_the_log_density(kind, seed):
    with jax.enable_x64(True):
        policy, observation, action = drawn(kind, seed)
        ask = Compiled(policy)
        analytic, automatic = ask.scores(observation, action[None]), ask.derivatives(observation, action[None])
        assert jax.tree.structure(ask.score(observation, action)) == jax.tree.structure(trainable(policy))
    # z² reaches 25 and 1/s 20: some ulp of their product
    np.testing.assert_allclose(analytic, automatic, rtol=1e-9, atol=1e-10)


@few
@given(seed=seeds)
def test_the_log_density_is_that_of_independent_normals(seed):
    with jax.enable_x64(True):
        policy, observation, action = drawn("motoneurons", seed)
        ask = Compiled(policy)
        mean = ask.mean(observation)
        density = stats.norm(mean, 0.05 + np.exp(np.asarray(policy.log_deviation)))
        expected = density.logpdf(action).sum()
        assert ask.log_prob(observation, action) == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert ask.entropy(observation) == pytest.approx(density.entropy().sum(), abs=1e-9)
        gain, threshold = np.asarray(policy.gain), np.asarray(policy.threshold)
    np.testing.assert_allclose(mean, 1 / (1 + np.exp(-gain * (observation[0] - threshold))), rtol=1e-9)


@pytest.mark.ci
@pytest.mark.parametrize("kind", KINDS)
@few
@given(seed=seeds)
def test_the_expected_score_is_zero_and_its_square_the_fisher_matrix(kind, seed):
    with jax.enable_x64(True):
        policy, observation, _ = drawn(kind, seed)
        ask = Compiled(policy)
        nodes, weights = np.polynomial.hermite_e.hermegauss(12)  # exact for the polynomials of degree 4 in question
        weights = weights / weights.sum()
        # units are independent, and the rows of a block do not mix: one noise for all will do
        actions = ask.mean(observation) + deviation(policy) * nodes[:, None]
        (rows,) = blocks_of_scores(policy, observation, actions)
        mean = np.einsum("n,nui->ui", weights, rows)
        square = np.einsum("n,nui,nuj->uij", weights, rows, rows)
        mode = ask.mode(observation)
        (fisher,) = ask.fisher(observation, mode)
        scale = np.abs(fisher).max()
        np.testing.assert_allclose(mean, 0, atol=1e-12 * (1 + scale))
        np.testing.assert_allclose(square, fisher, atol=1e-12 * (1 + scale))
        score = ask.score(observation, mode + 0.1)
        again = ask.from_blocks(ask.blocks(score))
        for found, wanted in zip(jax.tree.leaves(again), jax.tree.leaves(score), strict=True):
            np.testing.assert_array_equal(found, wanted)


@compiled
def blocks_of_scores(policy, observation, actions):
    return jax.vmap(lambda action: abilities.blocks(policy, policy.score(observation, action)))(actions)


class Coupled(GradedUnits):
    """Two units whose mean is one number that they share."""

    level: jax.Array = eqx.field(converter=jnp.asarray)
    log_deviation: jax.Array = eqx.field(converter=jnp.asarray)
    floor: jax.Array = fixed(converter=jnp.asarray, default=0.1)
    inputs = 1

    def mean(self, observation):
        return jnp.broadcast_to(self.level, (2,))

    def mean_gradient(self, observation):
        return {"level": jnp.ones(2)}

    def score(self, observation, action):
        own = super().score(observation, action)
        return eqx.tree_at(lambda each: each.level, own, jnp.sum(own.level))


def test_units_that_share_a_parameter_have_the_sampled_matrix():
    policy, seen, action = Coupled(0.3, [-1.0, 0.0]), jnp.zeros(1), jnp.array([0.5, 1.5])
    (row,) = abilities.blocks(policy, policy.score(seen, action))
    assert row.shape == (1, 3)
    (fisher,) = abilities.fisher(policy, seen, action)
    np.testing.assert_allclose(fisher[0], np.outer(row[0], row[0]), rtol=1e-6)


def test_samples_have_the_mean_and_the_deviation_and_are_cut_nowhere():
    policy = GradedMotoneurons([0.2, 0.8], [10.0, -4.0], np.log([0.28, 0.5]), 0.02)
    seen = jnp.array([0.3])
    uniforms = ((np.arange(100_000) + 0.5) / 100_000).astype(np.float32)
    ask = Compiled(policy)
    drawn, mean = ask.samples(seen, np.stack([uniforms, 1 - uniforms], axis=1)), ask.prob(seen)
    np.testing.assert_allclose(drawn.mean(0), mean, atol=1e-4)
    np.testing.assert_allclose(drawn.std(0), [0.30, 0.52], rtol=1e-3)
    assert stats.kstest(drawn[:, 0], stats.norm(mean[0], 0.3).cdf).statistic < 1e-3
    assert drawn.min() < 0
    assert drawn.max() > 1
    ends = np.float32([0, 1 - 2.0**-24])
    assert np.isfinite(ask.samples(seen, np.stack([ends, ends], axis=1))).all()


def test_the_mode_is_the_mean():
    policy = pool_of(1)
    np.testing.assert_array_equal(policy.mode(jnp.array([0.4])), policy.mean(jnp.array([0.4])))


@pytest.mark.representatives("False")
@pytest.mark.parametrize("double", [False, True])
def test_however_sure_a_unit_is_its_score_is_bounded_by_the_floor(double):
    with jax.enable_x64(double):
        policy = GradedMotoneurons([0.5], [4.0], [-200.0], 0.02)
        seen = jnp.array([0.6])
        ask = Compiled(policy)
        action = ask.sample(seen, jnp.array([0.999]))
        score = ask.score(seen, action)
        assert float(policy.deviation[0]) == pytest.approx(0.02)
        z = stats.norm.ppf(0.999)
        slope = ask.mean_gradient(seen)["gain"][0]
        assert float(score.gain[0]) == pytest.approx(z / 0.02 * slope, rel=1e-4)
        assert abs(float(score.log_deviation[0])) < 1e-80  # nothing more to gain from it
        (fisher,) = ask.fisher(seen, action)
        metric = FisherMetric(1e-3, 0.01)
        direction = compiled(lambda p, s: metric.precondition(metric.init(p), p, s))(policy, score)
    assert np.isfinite(fisher).all()
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(direction))


@pytest.mark.parametrize("potential", [-700.0, 700.0])
def test_saturated_means_have_finite_scores(potential):
    policy = GradedMotoneurons([0.0], [potential], [-1.0])
    score = Compiled(policy).score(jnp.array([1.0]), jnp.array([0.5]))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(score))
    assert float(score.gain[0]) == 0


def everything(policy, observation, action, uniforms):
    return {
        "prob": policy.prob(observation),
        "sample": policy.sample(observation, uniforms),
        "mode": policy.mode(observation),
        "log_prob": policy.log_prob(observation, action),
        "score": policy.score(observation, action),
        "fisher": abilities.fisher(policy, observation, action),
        "entropy": policy.entropy(observation),
    }


@pytest.mark.ci
def test_mapping_over_seeds_gives_the_same_as_one_at_a_time():
    pools = [pool_of(seed) for seed in range(3)]
    rng = np.random.default_rng(0)
    looks, actions, uniforms = (jnp.asarray(rng.random((3, size)), jnp.float32) for size in (1, 3, 3))
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *pools)
    together = jax.jit(jax.vmap(everything))(stacked, looks, actions, uniforms)
    for seed, pool in enumerate(pools):
        alone = jax.jit(everything)(pool, looks[seed], actions[seed], uniforms[seed])
        for a, b in zip(jax.tree.leaves(alone), jax.tree.leaves(together), strict=True):
            np.testing.assert_allclose(b[seed], a, rtol=1e-5, atol=1e-5)


@few
@given(seed=seeds)
def test_single_precision_agrees_with_double(seed):
    found = []
    for double in (False, True):
        with jax.enable_x64(double):
            policy, observation, action = drawn("motoneurons", seed)
            found.append(Compiled(policy).scores(observation, action[None])[0])
            dtype = found[-1].dtype
        assert dtype == (np.float64 if double else np.float32)
    # z is a difference of two numbers of order 1, by a deviation of at least 0.05, and appears twice
    np.testing.assert_allclose(found[0], found[1], rtol=2e-4, atol=2e-4 * (1 + np.abs(found[1]).max()))


def test_the_floor_is_not_learned_and_survives_storing():
    policy = pool_of(0, floor=0.07)
    assert trainable(policy).floor is None
    shapes = rebuild(json.loads(json.dumps(describe(policy))))
    assert describe(policy)["kind"] == "motorgrad.policies.GradedMotoneurons"
    assert jax.tree.structure(shapes) == jax.tree.structure(policy)
    assert float(split(policy)[1].floor) == pytest.approx(0.07)


def test_the_initial_pool_has_gain_zero_and_the_deviation_that_is_asked_for():
    pool = graded_motoneurons(1, units=200, low=2.0, high=4.0, deviation=0.25, floor=0.05)(jax.random.key(0))
    np.testing.assert_array_equal(pool.gain, 0)
    np.testing.assert_allclose(pool.deviation, 0.25, rtol=1e-6)
    threshold = np.asarray(pool.threshold)
    assert 2 <= threshold.min() < 2.2 < 3.8 < threshold.max() <= 4


def test_the_mean_of_graded_hyperplanes_is_linear_in_what_they_see():
    policy = GradedHyperplanes([[1.0, -2.0], [0.0, 0.5]], [0.25, -1.0], [-1.0, -1.0])
    np.testing.assert_allclose(Compiled(policy).mean(jnp.array([0.5, 0.25])), [0.25, -0.875])
    start = graded_hyperplanes(3, 2, level=0.4, deviation=0.25, floor=0.05)
    np.testing.assert_array_equal(Compiled(start).mean(jnp.array([3.0, -1.0, 2.0])), np.float32([0.4, 0.4]))
    np.testing.assert_allclose(start.deviation, 0.25, rtol=1e-6)


two = np.zeros(2)


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: GradedMotoneurons(np.zeros((2, 2)), two, two), "threshold = (2, 2)"),
        (lambda: GradedMotoneurons(two, np.zeros(1), two), "gain = (1,): must be of shape (2,)"),
        (lambda: GradedMotoneurons(two, two, np.zeros(3)), "log_deviation = (3,): must be of shape (2,)"),
        (lambda: GradedMotoneurons(two, two, two, two), "floor = (2,): must be one number"),
        (lambda: GradedMotoneurons(two, two, two, 0.0), "floor = 0.0: must be positive"),
        (lambda: graded_motoneurons(1, 2, deviation=0.1, floor=0.1), "floor, deviation = (0.1, 0.1)"),
        (lambda: graded_motoneurons(2, 2), "inputs = 2: must be 1"),
        (lambda: GradedHyperplanes(two, two, two), "weights = (2,): must be of shape (units, inputs)"),
        (lambda: GradedHyperplanes(np.zeros((2, 1)), np.zeros(3), two), "bias = (3,): must be of shape (2,)"),
        (lambda: GradedHyperplanes(np.zeros((2, 1)), two, two, -1.0), "floor = -1.0: must be positive"),
        (lambda: graded_hyperplanes(2, 2, level=float("nan")), "level = nan: must be a finite number"),
        (lambda: graded_hyperplanes(2, 2, deviation=0.01), "floor, deviation = (0.02, 0.01)"),
        (lambda: Factored([pool_of(0)]), "pools = ['GradedMotoneurons']: must be pools of binary units"),
        (lambda: abilities.enumerate(pool_of(0)), "GradedMotoneurons: has infinitely many actions"),
    ],
)
def test_what_is_impossible_is_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
