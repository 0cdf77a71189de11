"""Graded units that act between two bounds: distributions against SciPy, scores against automatic differentiation."""

import json
import types

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from policy_examples import Compiled, compiled
from scipy import special, stats

from motorgrad.policies import (
    BoundedHyperplanes,
    GradedUnits,
    Hyperplanes,
    Network,
    Primitives,
    abilities,
    bounded_hyperplanes,
    describe,
    rebuild,
    split,
    trainable,
)
from motorgrad.policies._densities import DENSITIES

LOW, HIGH = np.array([0.0, -1.0, -3.0]), np.array([1.0, 1.0, 5.0])
SQUASHED_AT = 4.0  # where the normal number is clipped


def pool_of(density, seed, scale=1.0):
    rng = np.random.default_rng(seed)
    levels, noise = rng.normal(size=3, scale=scale), rng.normal(size=3, scale=0.5) - 1
    return BoundedHyperplanes(rng.normal(size=(3, 2), scale=scale), levels, noise, 0.05, LOW, HIGH, density)


class Reference:
    """A density on [−1, 1] by SciPy: density inside, distribution function, and the probabilities of the ends."""

    def __init__(self, density, m, s):
        self.name, self.ends = density, np.zeros(2)
        normal = stats.norm(m, s)
        if density in ("clipped", "squashed"):
            bound = 1.0 if density == "clipped" else SQUASHED_AT
            self.ends = np.array([normal.cdf(-bound), normal.sf(bound)])
            top = np.tanh(bound)
            if density == "clipped":
                self.logpdf, self.cdf = normal.logpdf, normal.cdf
            else:
                self.cdf = lambda u: normal.cdf(np.arctanh(u * top))
                self.logpdf = lambda u: normal.logpdf(np.arctanh(u * top)) + np.log(top / (1 - (u * top) ** 2))
        elif density == "truncated":
            found = stats.truncnorm((-1 - m) / s, (1 - m) / s, m, s)
            self.logpdf, self.cdf = found.logpdf, found.cdf
        else:
            found = stats.beta(1 + special.expit(2 * m) / s**2, 1 + special.expit(-2 * m) / s**2, -1, 2)
            self.logpdf, self.cdf = found.logpdf, found.cdf


SHAPES = [(0.0, 0.3), (0.5, 1.0), (1.5, 0.3), (-1.0, 0.05), (-3.0, 0.3), (2.2, 0.1), (0.2, 20.0)]


@compiled
def log_prob(density, m, s, u):
    return DENSITIES[density].log_prob(m, s, u)


@compiled
def sample(density, m, s, p):
    return jax.vmap(DENSITIES[density].sample, (None, None, 0))(m, s, p)


@pytest.mark.parametrize("density", DENSITIES)
def test_the_density_is_that_of_its_name(density):
    family, u = DENSITIES[density], np.concatenate([np.linspace(-0.999, 0.999, 41), [-1.0, 1.0]])
    with jax.enable_x64(True):
        found = np.stack([log_prob(density, np.full(43, m), np.full(43, s), u) for m, s in SHAPES])
        has_ends = family.at_end(jnp.ones(1)) is not False
    for (m, s), log in zip(SHAPES, found, strict=True):
        known = Reference(density, m, s)
        wanted = known.logpdf(u[:-2])
        seen = wanted > -1e4
        np.testing.assert_allclose(log[:-2][seen], wanted[seen], rtol=1e-8, atol=1e-6)
        if has_ends:
            np.testing.assert_allclose(np.exp(log[-2:]), known.ends, rtol=1e-9, atol=1e-12)


@pytest.mark.representatives(*[f"{density}-False" for density in DENSITIES if density != "truncated"], "truncated-True")
@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize("density", DENSITIES)
def test_samples_invert_the_distribution_function(density, double):
    with jax.enable_x64(double):
        m, s = np.array(SHAPES).T
        p = (np.arange(500) + 0.5) / 500
        numbers = np.concatenate([p, [0.0, 1 - 2.0**-24]])[:, None] * np.ones(len(SHAPES))
        drawn = np.asarray(sample(density, m, s, numbers))
        u, edges = drawn[:-2].astype(float), drawn[-2:]
    assert np.abs(u).max() <= 1
    assert np.isfinite(edges).all()
    for (location, spread), column in zip(SHAPES, u.T, strict=True):
        known = Reference(density, location, spread)
        inside = np.abs(column) < 1
        if known.ends.any():
            assert (np.abs((column == -1).mean() - known.ends[0])) <= 0.002
            assert (np.abs((column == 1).mean() - known.ends[1])) <= 0.002
        # one rounding of u counts as much as the density is high; Newton's method ends within rounding of log F
        tolerance = 1e-8 if double else 1e-4
        tolerance = 3e-5 if (density, location) == ("truncated", 2.2) else tolerance  # far outside, by an expansion
        np.testing.assert_allclose(known.cdf(column[inside]), p[inside], atol=tolerance)


@compiled
def scores_of(policies, observations, uniforms):
    """The score of actions that are drawn and of both bounds, analytic and automatic, of many pools."""

    def of_one(policy, observation, uniforms):
        drawn = jax.vmap(policy.sample, (None, 0))(observation, uniforms)
        actions = jnp.concatenate([drawn, np.stack([LOW, HIGH])])
        parameters, rest = split(policy)

        def automatic(action):
            derivative = jax.grad(lambda theta: eqx.combine(theta, rest).log_prob(observation, action))
            return ravel_pytree(derivative(parameters))[0]

        analytic = jax.vmap(lambda action: ravel_pytree(policy.score(observation, action))[0])(actions)
        return analytic, jax.vmap(automatic)(actions)

    return jax.vmap(of_one)(policies, observations, uniforms)


@pytest.mark.representatives("truncated", "beta")
@pytest.mark.parametrize("density", DENSITIES)
def test_the_analytic_score_is_the_derivative_of_the_log_density(density):
    rng = np.random.default_rng(0)
    with jax.enable_x64(True):
        policies = [pool_of(density, seed) for seed in range(25)]
        stacked = jax.tree.map(lambda *leaves: np.stack(leaves), *policies)
        analytic, automatic = scores_of(stacked, rng.normal(size=(25, 2)), rng.random((25, 6, 3)))
        score = jax.eval_shape(policies[0].score, jnp.zeros(2), jnp.zeros(3))
        assert jax.tree.structure(score) == jax.tree.structure(trainable(policies[0]))
    assert np.isfinite(analytic).all()
    np.testing.assert_allclose(analytic, automatic, rtol=1e-8, atol=1e-8)


@eqx.filter_jit  # with the compiler's optimisation: here time passes by searching for quantiles
def quantiles(policy, observation, p):
    return jax.vmap(lambda p: policy.sample(observation, jnp.full(policy.uniforms, p)))(p)


@compiled
def over_the_distribution(policy, observation, actions):
    """Blocks of scores and log-probabilities of actions, and what these must be on average."""
    score = policy.score(observation, actions[0])
    return {
        "rows": jax.vmap(lambda action: abilities.blocks(policy, policy.score(observation, action))[0])(actions),
        "log_probs": jax.vmap(lambda action: policy.log_probs(observation, action))(actions),
        "fisher": abilities.fisher(policy, observation, actions[0])[0],
        "entropy": policy.entropy(observation),
        "prob": policy.prob(observation),
        "score": score,
        "score from its blocks": abilities.from_blocks(policy, abilities.blocks(policy, score)),
    }


@pytest.mark.representatives("0-clipped")  # whose bounds have a probability, too
@pytest.mark.parametrize("density", DENSITIES)
@pytest.mark.parametrize("seed", [0, 1])
def test_scores_have_mean_zero_and_their_square_is_the_fisher_matrix(density, seed):
    p = (np.arange(20_000) + 0.5) / 20_000
    with jax.enable_x64(True):
        policy, observation = pool_of(density, seed), np.random.default_rng([seed, 1]).normal(size=2)
        actions = np.asarray(quantiles(policy, observation, p))
        told = jax.tree.map(np.asarray, over_the_distribution(policy, observation, actions))
    rows, fisher = told["rows"], told["fisher"]
    scale = np.sqrt(np.einsum("uii->ui", fisher)) + 1e-9
    # quantiles cut the extreme 1/40,000 at either end, where scores are largest
    np.testing.assert_allclose(np.mean(rows, axis=0) / scale, 0, atol=2e-3)
    square = np.einsum("nui,nuj->uij", rows, rows) / len(p)
    np.testing.assert_allclose(
        square / (scale[:, :, None] * scale[:, None, :]), fisher / (scale[:, :, None] * scale[:, None, :]), atol=5e-3
    )
    assert -np.mean(told["log_probs"], axis=0).sum() == pytest.approx(float(told["entropy"]), abs=5e-3)
    np.testing.assert_allclose(actions.mean(0), told["prob"], atol=1e-4)
    score, again = (jax.tree.leaves(told[name]) for name in ("score", "score from its blocks"))
    for found, wanted in zip(again, score, strict=True):
        np.testing.assert_array_equal(found, wanted)


EXTREMES = [(m, v) for m in (-700.0, -9.0, -1.0, 0.0, 4.0, 700.0) for v in (-200.0, -1.0, 9.0)]


@pytest.mark.ci
@pytest.mark.parametrize("density", DENSITIES)
def test_nothing_is_infinite_where_a_unit_is_saturated(density):
    """Locations up to 700 and spreads from the floor to e^9, at the bounds, beside them and in the middle."""
    levels, noise = np.array(EXTREMES).T
    low, high = -np.ones_like(levels), np.linspace(0.5, 9.0, len(levels))
    beside = np.nextafter(np.float32(high), np.float32(low))
    actions = np.stack([low, high, beside, (low + high) / 2]).astype(np.float32)
    uniforms = np.array([0.0, 0.3, 1 - 2.0**-24])[:, None] * np.ones_like(levels)
    found = []
    for double in (False, True):
        with jax.enable_x64(double):
            policy = BoundedHyperplanes(np.zeros((len(levels), 1)), levels, noise, 0.02, low, high, density)
            seen, ask = jnp.ones(1), Compiled(policy)
            scores, sampled = ask.over("score", seen, jnp.asarray(actions)), ask.samples(seen, uniforms)
            found.append(np.stack([scores.bias, scores.log_deviation]))
            slopes = [np.asarray(leaf) for leaf in jax.tree.leaves(entropy_slope(policy, seen))]
            log = ask.over("log_probs", seen, jnp.asarray(sampled))
            fisher = ask.fisher(seen, actions[0])[0]
            everything = [*found, sampled, log, *slopes, fisher, ask.entropy(seen), ask.prob(seen), ask.mode(seen)]
            assert all(np.isfinite(x).all() for x in everything)
            assert (sampled >= policy.low).all()
            assert (sampled <= policy.high).all()
            assert found[-1].dtype == (np.float64 if double else np.float32)
    # What single precision can tell: a beta density's bounds are at a distance of one rounding.
    same = [3] if density == "beta" else [0, 1, 3]
    single, exact = (each[:, same] for each in found)
    assert (np.abs(single - exact) <= 1e-2 * (1 + np.abs(exact))).all()


@eqx.filter_jit
def entropy_slope(policy, observation):
    parameters, rest = split(policy)
    return jax.grad(lambda theta: eqx.combine(theta, rest).entropy(observation))(parameters)


@compiled
def entropies(policy, observation, uniforms):
    """The entropy and the mean of its estimates, each with its gradient."""
    learned, settings = split(policy)

    def exact(learned):
        return eqx.combine(learned, settings).entropy(observation)

    def estimate(learned):
        policy = eqx.combine(learned, settings)
        return jnp.mean(jax.vmap(lambda u: abilities.entropy_estimate(policy, observation, u))(uniforms))

    return jax.value_and_grad(exact)(learned), jax.value_and_grad(estimate)(learned)


def test_the_estimate_of_the_entropy_has_the_entropy_and_its_gradient_as_mean():
    with jax.enable_x64(True):
        policy = BoundedHyperplanes([[0.5], [-2.0]], [0.2, 0.0], [-1.0, -0.5], low=[0.0, -2.0], high=[1.0, 2.0])
        policy = Network(policy, eqx.nn.Lambda(jnp.tanh), observed=1)  # it is asked through layers
        uniforms = np.random.default_rng(0).random((40_000, 2))
        (exact, slopes), (found, means) = entropies(policy, np.array([0.7]), uniforms)
    np.testing.assert_allclose(found, exact, atol=0.02)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=0.03), means, slopes)


@pytest.mark.representatives("clipped")
@pytest.mark.parametrize("density", ["clipped", "squashed"])
def test_the_bounds_themselves_are_reached_and_have_a_probability(density):
    policy = BoundedHyperplanes(np.zeros((3, 1)), [0.0] * 3, [np.log(5.0)] * 3, 0.02, LOW, HIGH, density)
    p = np.repeat(((np.arange(1000) + 0.5) / 1000)[:, None], 3, axis=1).astype(np.float32)
    ask, seen = Compiled(policy), jnp.ones(1)
    actions = ask.samples(seen, p)
    share = special.ndtr(-(1.0 if density == "clipped" else SQUASHED_AT) / 5.02)
    for bound in (LOW, HIGH):
        np.testing.assert_allclose((actions == np.float32(bound)).mean(0), share, atol=2e-3)
        np.testing.assert_allclose(np.exp(ask.log_probs(seen, bound)), share, rtol=1e-5)


def test_a_temperature_multiplies_the_spread_above_the_floor():
    policy = pool_of("squashed", 0)
    np.testing.assert_allclose(
        abilities.with_temperature(policy, 2.0).deviation - 0.05, 2 * (policy.deviation - 0.05), rtol=1e-6
    )


@pytest.mark.parametrize("density", DENSITIES)
def test_a_start_acts_around_its_level_within_the_range_of_the_task(density):
    task = types.SimpleNamespace(observation_size=4, action_size=2, action_range=((0.0, 1.0), (-0.4, 0.4)))
    policy = bounded_hyperplanes(task, density=density, level=0.5, deviation=0.3)
    assert isinstance(policy, GradedUnits)
    assert (policy.inputs, policy.outputs, policy.actions) == (4, 2, "continuous")
    np.testing.assert_allclose(Compiled(policy).mode(np.ones(4)), [0.75, 0.2], rtol=1e-3)
    np.testing.assert_allclose(policy.deviation, 0.3, rtol=1e-6)
    np.testing.assert_array_equal(bounded_hyperplanes(3, 2).low, [-1, -1])


def test_the_bounds_are_not_learned_and_survive_storing():
    policy = pool_of("beta", 0)
    assert trainable(policy).low is None
    assert trainable(policy).high is None
    shapes = rebuild(json.loads(json.dumps(describe(policy))))
    assert shapes.density == "beta"
    assert jax.tree.structure(shapes) == jax.tree.structure(policy)


@pytest.mark.ci
def test_primitives_move_within_bounds():
    movement = BoundedHyperplanes(
        np.zeros((2, 1)), [0.3, -0.2], [-1.0, -1.0], 0.05, [0.0, -2.0], [1.0, 2.0], "squashed"
    )
    policy = Primitives(Hyperplanes([[1.0], [0.0]], [0.0, 0.0]), movement)
    seen = np.array([1.0, 1.0, 0.5])
    with jax.enable_x64(True):
        ask = Compiled(jax.tree.map(lambda x: jnp.asarray(np.asarray(x, float)), policy))
        actions = ask.samples(seen, np.random.default_rng(0).random((200, 4)))
        assert actions[:, 2].min() >= 0
        assert np.isfinite(ask.entropy(seen))
        np.testing.assert_allclose(ask.scores(seen, actions[:5]), ask.derivatives(seen, actions[:5]), atol=1e-5)


two = np.zeros(2)


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: BoundedHyperplanes(two, two, two), "weights = (2,): must be of shape (units, inputs)"),
        (lambda: BoundedHyperplanes(np.zeros((2, 1)), two, two, 0.0), "floor = 0.0: must be positive"),
        (lambda: BoundedHyperplanes(np.zeros((2, 1)), two, two, low=[0.0] * 3), "low = (3,): must be one number, or"),
        (lambda: BoundedHyperplanes(np.zeros((2, 1)), two, two, low=1.0), "low, high = (1.0, 1.0): must be finite"),
        (
            lambda: BoundedHyperplanes(np.zeros((2, 1)), two, two, high=np.inf),
            "low, high = (-1.0, inf): must be finite",
        ),
        (
            lambda: bounded_hyperplanes(2, 2, density="gamma"),
            "unknown density 'gamma': known are beta, clipped, squashed, truncated",
        ),
        (lambda: bounded_hyperplanes(2, 2, density="betta"), "did you mean 'beta'"),
        (lambda: bounded_hyperplanes(2, 2, level=1.0), "level = 1.0: must be in (-1, 1)"),
        (lambda: bounded_hyperplanes(2, 2, deviation=0.01), "floor, deviation = (0.02, 0.01)"),
        (lambda: abilities.enumerate(pool_of("beta", 0)), "BoundedHyperplanes: has infinitely many actions"),
    ],
)
def test_what_is_impossible_is_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
