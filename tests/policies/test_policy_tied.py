"""Units in groups that fire as one: what they draw, that a group counts once, and finer groups."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from policy_examples import policy_of

import motorgrad as mg
from motorgrad.policies import LocalGaussians, Motoneurons, Tied, abilities, tied_motoneurons
from motorgrad.worlds import immediate_gradient

POOL = Motoneurons([0.2, 0.5], [3.0, -8.0])
POLICY = Tied(POOL, [0, 1, 0, 1, 1])
SEEN = jnp.array([0.6])


def test_a_group_fires_as_one_with_its_probability():
    drawn = np.random.default_rng(0).random((20_000, 2)).astype(np.float32)
    actions = np.asarray(jax.vmap(POLICY.sample, (None, 0))(SEEN, drawn))
    assert np.ptp(actions[:, [0, 2]], axis=1).max() == 0
    np.testing.assert_allclose(actions.mean(0), POLICY.prob(SEEN), atol=0.01)
    np.testing.assert_array_equal(POLICY.prob(SEEN), np.asarray(POOL.prob(SEEN))[[0, 1, 0, 1, 1]])


def test_probabilities_of_all_patterns_add_up_to_one_and_those_that_differ_within_a_group_are_impossible():
    patterns = jnp.array(list(itertools.product([0.0, 1.0], repeat=5)))
    chances = np.exp(np.asarray(jax.vmap(POLICY.log_prob, (None, 0))(SEEN, patterns)))
    assert chances.sum() == pytest.approx(1, abs=1e-6)
    possible = {tuple(row) for row in np.asarray(abilities.enumerate(POLICY)).tolist()}
    assert {tuple(row) for row, p in zip(patterns.tolist(), chances, strict=True) if p > 0} == possible
    assert len(possible) == 4


def test_the_score_of_a_group_counts_once():
    action = jnp.array([1.0, 0, 1, 0, 0])
    np.testing.assert_array_equal(
        ravel_pytree(POLICY.score(SEEN, action))[0], ravel_pytree(POOL.score(SEEN, jnp.array([1.0, 0])))[0]
    )
    assert POLICY.entropy(SEEN) == POOL.entropy(SEEN)


def test_groups_learn_as_a_pool_of_fewer_units_whose_force_is_a_ratio():
    """Section 4.4: a fixed number of units with correlated activation is equivalent to fewer units."""
    task = mg.make("linear-recruitment", units=6, output="ratio")
    few = mg.make("linear-recruitment", units=2, output="ratio")
    loads, weights = np.linspace(0.05, 0.95, 10)[:, None], np.full(10, 0.1)
    tied = immediate_gradient(Tied(POOL, [0, 0, 0, 1, 1, 1]), loads, weights, task.immediate)
    alone = immediate_gradient(POOL, loads, weights, few.immediate)
    np.testing.assert_allclose(ravel_pytree(tied)[0], ravel_pytree(alone)[0], rtol=1e-6)


def test_halves_start_with_the_parameters_of_their_group():
    finer = POLICY.halved()
    assert finer.groups == (0, 2, 1, 2, 3)
    np.testing.assert_array_equal(finer.pool.threshold, np.array([0.2, 0.2, 0.5, 0.5], np.float32))
    np.testing.assert_array_equal(finer.prob(SEEN), POLICY.prob(SEEN))
    single = finer.halved()
    assert sorted(single.groups) == [0, 1, 2, 3, 4]
    assert single.independent
    assert single.halved().groups == single.groups
    gaussians = Tied(LocalGaussians([[0.4]], [[0.3]], 0.7), [0, 0])
    np.testing.assert_allclose(gaussians.halved().prob(SEEN), gaussians.prob(SEEN))


def test_initial_groups_are_of_consecutive_units_and_are_learned(tmp_path):
    task = mg.make("linear-recruitment", units=5)
    agent = mg.agent_for(task, policy={"kind": "tied-motoneurons", "groups": 2})
    run = mg.train(task, agent, 200, 2, tmp_path / "run", progress=False)
    assert run.policies.groups == (0, 0, 0, 1, 1)
    assert mg.load(tmp_path / "run").policies.groups == run.policies.groups
    assert run.policies.pool.threshold.shape == (2, 2)
    assert jax.vmap(Tied.halved)(run.policies).pool.threshold.shape == (2, 4)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Tied(POOL, [0, 0]), "groups = "),
        (lambda: Tied(POOL, [0, 1, 2]), "groups = "),
        (lambda: Tied(POOL, [0, 0.5, 1]), "groups = "),
        (lambda: Tied(policy_of("gated"), [0]), "pool = 'Gated': must be a pool of independent units"),
        (lambda: tied_motoneurons(1, units=3, groups=4), "groups = 4"),
    ],
)
def test_what_makes_no_sense_is_refused(make, named):
    with pytest.raises(ValueError, match=named):
        make()
