"""Policies that ask for their next input: what they ask for, and that all else is the policy's within."""

import json

import jax
import numpy as np
import pytest
from policy_examples import Compiled, compiled

from motorgrad.policies import (
    Hyperplanes,
    Motoneurons,
    Querying,
    Softmax,
    abilities,
    describe,
    querying_motoneurons,
    rebuild,
    trainable,
)

POOL = Motoneurons([0.2, 0.7], [30.0, 8.0])


def queries(policy, count=200_000):
    return np.asarray(_queries(policy, (np.arange(count) + 0.5) / count))


@compiled
def _queries(policy, uniforms):
    return jax.vmap(policy.query)(uniforms)


@pytest.mark.representatives("0.0-0.0-1.0", "0.25--2.0-14.0")
@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-2.0, 14.0)])
@pytest.mark.parametrize("explore", [0.0, 0.25, 1.0])
def test_cells_are_asked_for_in_proportion_to_the_entropy_and_evenly_within(low, high, explore):
    pool = Motoneurons(low + (high - low) * np.array([0.2, 0.7]), np.array([30.0, 8.0]) / (high - low))
    policy = Querying(pool, low, high, explore, 20)
    edges = np.linspace(low, high, 21)
    middle = (edges[1:] + edges[:-1]) / 2
    ask = Compiled(pool)
    entropy = np.array([ask.entropy(np.array([y])) for y in middle])
    expected = explore / 20 + (1 - explore) * entropy / entropy.sum()
    found = queries(policy)
    count, _ = np.histogram(found, edges)
    np.testing.assert_allclose(count / len(found), expected, atol=1e-4)
    np.testing.assert_allclose(Compiled(policy).query_probabilities(), expected, rtol=1e-5)
    assert low <= found.min()
    assert found.max() <= high
    likely = int(np.argmax(expected))
    within = found[(found >= edges[likely]) & (found < edges[likely + 1])]
    halves = np.mean(within < middle[likely])
    assert halves == pytest.approx(0.5, abs=5e-3)


@pytest.mark.slow
def test_a_policy_that_is_sure_everywhere_asks_uniformly():
    policy = Querying(Motoneurons([50.0], [1e6]), 0.0, 1.0, 0.0, 8)
    np.testing.assert_allclose(policy.query_probabilities(), 1 / 8)
    found = queries(policy, 8_000)
    np.testing.assert_array_equal(np.histogram(found, np.linspace(0, 1, 9))[0], 1_000)


def test_cells_without_entropy_are_asked_for_only_by_the_share_that_explores():
    sharp = Motoneurons([0.5], [1e4])
    assert not np.any(np.abs(queries(Querying(sharp, 0.0, 1.0, 0.0, 9)) - 0.5) > 1 / 18 + 1e-6)
    away = np.abs(queries(Querying(sharp, 0.0, 1.0, 0.2, 9)) - 0.5) > 1 / 18
    assert away.mean() == pytest.approx(0.2 * 8 / 9, abs=1e-3)


def test_all_but_the_query_is_the_policys_within():
    policy = Querying(POOL)
    seen, uniforms = np.float32([0.35]), np.float32([0.4, 0.9, 0.3])
    assert (policy.inputs, policy.outputs, policy.uniforms, policy.actions) == (1, 3, 3, "querying")
    whole, pool = Compiled(policy), Compiled(POOL)
    action = whole.sample(seen, uniforms)
    np.testing.assert_array_equal(action[:2], pool.sample(seen, uniforms[:2]))
    assert action[2] == pytest.approx(whole.query(uniforms[2]))
    np.testing.assert_array_equal(whole.mode(seen)[:2], pool.mode(seen))
    assert whole.log_prob(seen, action) == pool.log_prob(seen, action[:2])
    assert whole.entropy(seen) == pool.entropy(seen)
    np.testing.assert_array_equal(whole.prob(seen), pool.prob(seen))
    for a, b in zip(abilities.fisher(whole, seen, action), abilities.fisher(pool, seen, action[:2]), strict=True):
        np.testing.assert_array_equal(a, b)
    with pytest.raises(ValueError, match="Querying: has infinitely many actions"):
        abilities.enumerate(policy)


def test_the_mode_asks_for_the_least_certain_cell():
    assert Compiled(Querying(Motoneurons([0.31], [40.0]), cells=10)).mode(np.zeros(1))[1] == pytest.approx(0.35)


def test_the_score_is_the_derivative_of_the_log_probability_and_knows_no_query():
    with jax.enable_x64(True):
        policy = Querying(Motoneurons([0.2, 0.7], [3.0, -2.0]))
        ask, seen, actions = Compiled(policy), np.array([0.4]), np.array([[1.0, 0.0, 0.77], [1.0, 0.0, 0.1]])
        score = ask.score(seen, actions[0])
        assert jax.tree.structure(score) == jax.tree.structure(trainable(policy))
        analytic, elsewhere = ask.scores(seen, actions)
        np.testing.assert_allclose(analytic, ask.derivatives(seen, actions)[0], rtol=1e-12)
        np.testing.assert_array_equal(analytic, elsewhere)
        again = ask.from_blocks(ask.blocks(score))
        for found, wanted in zip(jax.tree.leaves(again), jax.tree.leaves(score), strict=True):
            np.testing.assert_array_equal(found, wanted)


def test_bounds_and_share_are_not_learned_and_survive_storing():
    policy = Querying(POOL, 0.0, 2.0, 0.3, 16)
    learned = trainable(policy)
    assert learned.low is learned.high is learned.explore is None
    shapes = rebuild(json.loads(json.dumps(describe(policy))))
    assert jax.tree.structure(shapes) == jax.tree.structure(policy)
    assert shapes.cells == 16


def test_the_initial_pool_has_one_unit_fewer_than_there_are_actions():
    start = querying_motoneurons(1, units=4, explore=0.2, cells=10)(jax.random.key(0))
    assert (start.policy.outputs, start.outputs, start.cells) == (3, 4, 10)
    assert float(start.explore) == pytest.approx(0.2)
    np.testing.assert_array_equal(start.policy.gain, 0)


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: Querying(Softmax([[1.0], [2.0]])), "policy = 'Softmax': must be a pool of binary units"),
        (lambda: Querying(Hyperplanes(np.zeros((2, 2)), np.zeros(2))), "policy.inputs = 2: must be 1"),
        (lambda: Querying(POOL, 1.0, 1.0), "low, high = (1.0, 1.0)"),
        (lambda: Querying(POOL, explore=1.5), "explore = 1.5: must be in [0, 1]"),
        (lambda: Querying(POOL, cells=0), "cells = 0: must be from 1"),
        (lambda: querying_motoneurons(1, units=1), "outputs = 1: must be at least 2"),
        (lambda: querying_motoneurons(1, units=3, explore=-0.1), "explore = -0.1"),
    ],
)
def test_what_is_impossible_is_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
