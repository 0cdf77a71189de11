"""Every analytic score against automatic differentiation, and where arithmetic is hardest."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import (
    EXAMPLES,
    EXTREME_REPRESENTATIVES,
    EXTREMES,
    REPRESENTATIVES,
    Compiled,
    answers,
    answers_at,
    policy_of,
)

from motorgrad.policies import Factored, LocalGaussians, abilities, trainable


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_analytic_score_is_the_derivative_of_the_log_probability(name):
    for answer in answers(name):
        # Either side rounds a few times; 1e-9 leaves room for the near-certain unit, where −p/(1 − p) is up to 1e6.
        np.testing.assert_allclose(answer["score"], answer["derivative"], rtol=1e-9, atol=1e-12)


@pytest.mark.representatives(*EXTREME_REPRESENTATIVES)
@pytest.mark.parametrize("place", EXTREMES)
def test_analytic_score_is_the_derivative_of_the_log_probability_at_extremes(place):
    answer = answers_at(place, True)
    assert np.isfinite(answer["score"]).all()
    # A − p is exact to 1 ulp of p; potentials of 700 and distances of 40² multiply that.
    np.testing.assert_allclose(answer["score"], answer["derivative"], rtol=1e-9, atol=1e-12)


@pytest.mark.representatives(*EXTREME_REPRESENTATIVES)
@pytest.mark.parametrize("place", EXTREMES)
def test_single_precision_is_finite_and_agrees_with_double_at_extremes(place):
    single, double = (answers_at(place, precise) for precise in (False, True))
    assert single["score"].dtype == single["log_prob"].dtype == np.float32
    assert np.isfinite(single["score"]).all()
    assert np.isfinite(single["log_prob"]).all()
    # Single precision resolves 6e-8 of what enters: potentials of 700, squares of 40 and, at 1.5e-3 widths, 1/(1 − p)
    # near its greatest value, where the input's rounding counts a thousandfold.
    np.testing.assert_allclose(single["score"], double["score"], rtol=2e-4, atol=1e-4)
    np.testing.assert_allclose(single["log_prob"], double["log_prob"], rtol=2e-4, atol=1e-6)


@pytest.mark.representatives("local-gaussians-p-max", "softmax-5", "layered-skip")
@pytest.mark.parametrize("name", EXAMPLES)
def test_score_has_the_structure_and_shapes_of_the_trainable_part(name):
    policy = policy_of(name)
    score = jax.eval_shape(lambda seen: policy.score(seen, abilities.enumerate(policy)[-1]), jnp.ones(policy.inputs))
    part = trainable(policy)
    assert jax.tree.structure(score) == jax.tree.structure(part)
    assert [x.shape for x in jax.tree.leaves(score)] == [x.shape for x in jax.tree.leaves(part)]


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_expected_score_is_zero(name):
    for answer in answers(name):
        terms = np.exp(answer["log_prob"])[:, None] * answer["score"]
        # The sum of at most 32 terms, each rounded to 1e-16 of itself.
        np.testing.assert_allclose(terms.sum(0), 0, atol=1e-13 * (1 + np.abs(terms).max()))


@eqx.filter_jit
def asked(unit, observation, action):
    return unit.score(observation, action), unit.prob(observation), unit.log_prob(observation, action)


@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize("action", [0.0, 1.0])
def test_at_the_centre_of_a_certain_unit_the_score_is_zero_and_the_probability_capped(action, double):
    with jax.enable_x64(double):
        unit = LocalGaussians([[0.3, -0.2]], [[-1.0, -2.0]], 1.0)
        centre, action = unit.centre[0], jnp.asarray([action])
        score, p, log_prob = jax.tree.map(np.asarray, asked(unit, centre, action))
        fires = bool(action[0])
    for leaf in jax.tree.leaves(score):
        np.testing.assert_array_equal(leaf, 0)
    cap = 1 - 1e-6
    assert p[0] == np.asarray(cap, p.dtype)
    # The log-probability is formed without subtracting p from 1, which single precision resolves to 6 % of 1e-6 only.
    assert float(log_prob) == pytest.approx(np.log(cap if fires else 1e-6), rel=1e-6)


def test_a_capped_unit_is_sampled_with_the_capped_probability():
    with jax.enable_x64(True):
        unit = LocalGaussians([[0.0]], [[0.0]], 1.0)
        at = jnp.zeros(1)
        assert unit.sample(at, jnp.asarray([1 - 1.1e-6])) == 1
        assert unit.sample(at, jnp.asarray([1 - 0.9e-6])) == 0


def test_the_score_leaves_zero_where_the_cap_ends():
    with jax.enable_x64(True):
        unit = LocalGaussians([[0.0]], [[0.0]], 1.0)
        edge = np.sqrt(-2 * np.log1p(-1e-6))  # where p = 1 − 1e-6
        inside, outside = (
            float(unit.score(jnp.asarray([edge * f]), jnp.zeros(1)).centre[0, 0]) for f in (0.999, 1.001)
        )
    assert inside == 0
    # −p/(1 − p) · z, with 1 − p = 1e-6 at the edge and 0.2 % more at 1.001 of it
    assert outside == pytest.approx(-edge / 1e-6, rel=3e-3)


@pytest.mark.representatives("factored-nested")
@pytest.mark.parametrize("name", ["factored", "factored-nested"])
def test_factored_log_probability_is_the_sum_and_score_the_concatenation_of_the_pools(name):
    policy = policy_of(name)
    assert isinstance(policy, Factored)
    ask, observation = Compiled(policy), np.full(policy.inputs, 0.4)
    ends = np.cumsum([pool.outputs for pool in policy.pools])
    actions = ask.enumerate()
    parts = np.split(actions, ends[:-1], axis=1)
    pools = [Compiled(pool) for pool in policy.pools]
    total = sum(pool.over("log_prob", observation, part) for pool, part in zip(pools, parts, strict=True))
    # a sum of at most four float32 numbers, in another order
    np.testing.assert_allclose(ask.over("log_prob", observation, actions), total, rtol=1e-6)
    scores = ask.over("score", observation, actions).pools
    for own, pool, part in zip(scores, pools, parts, strict=True):
        for a, b in zip(*map(jax.tree.leaves, (own, pool.over("score", observation, part))), strict=True):
            np.testing.assert_array_equal(a, b)
