"""Pools that grow: what a grown pool is, of every kind, and what is refused."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import EXAMPLES, Compiled, observation_of, policy_of

from motorgrad.policies import Factored, GradedMotoneurons, LocalGaussians, Motoneurons, Softmax, grow

POOLS = ("motoneurons", "hyperplanes", "local-gaussians-p-max", "local-gaussians", "free-gaussians")


@pytest.mark.parametrize("name", POOLS)
def test_a_grown_pool_has_the_units_of_both_in_order(name):
    pool, more = (EXAMPLES[name](np.random.default_rng(seed)) for seed in (0, 1))
    whole = grow(pool, more)
    seen = observation_of(pool)
    assert type(whole) is type(pool)
    assert whole.outputs == pool.outputs + more.outputs
    pool, more, whole = (Compiled(policy) for policy in (pool, more, whole))
    np.testing.assert_array_equal(whole.prob(seen), np.concatenate([pool.prob(seen), more.prob(seen)]))
    action = np.float32([1.0, 0.0, 1.0, 0.0, 0.0, 1.0])
    apart = pool.log_prob(seen, action[:3]) + more.log_prob(seen, action[3:])
    assert whole.log_prob(seen, action) == pytest.approx(apart, rel=1e-5)


def test_graded_units_grow_too_and_keep_their_floor():
    pool = GradedMotoneurons([0.1, 0.2], [1.0, 2.0], [-1.0, -2.0], 0.05)
    whole = grow(pool, GradedMotoneurons([0.3], [0.0], [-3.0], 0.05))
    np.testing.assert_allclose(whole.log_deviation, [-1, -2, -3])
    np.testing.assert_allclose(whole.floor, 0.05)


def test_the_pools_of_many_seeds_grow_together():
    pools = jax.tree.map(lambda *leaves: np.stack(leaves), *(policy_of("motoneurons", seed) for seed in range(4)))
    thresholds = jnp.linspace(0.0, 0.9, 4)
    add = jax.vmap(lambda pool, threshold: grow(pool, Motoneurons(threshold[None], jnp.zeros(1))))
    grown = add(pools, thresholds)
    assert grown.threshold.shape == (4, 4)
    np.testing.assert_array_equal(grown.threshold[:, :3], pools.threshold)
    np.testing.assert_array_equal(grown.threshold[:, 3], thresholds)
    np.testing.assert_array_equal(grown.gain[:, 3], 0)


def test_a_unit_of_gain_zero_leaves_the_others_as_they_are():
    pool = Motoneurons([0.3], [9.0])
    whole = grow(pool, Motoneurons([0.8], [0.0]))
    seen = jnp.array([0.1])
    assert whole.prob(seen)[0] == pool.prob(seen)[0]
    assert whole.prob(seen)[1] == 0.5
    assert eqx.tree_equal(pool, Motoneurons([0.3], [9.0]))


square = np.zeros((1, 1))


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: grow(Motoneurons([0.0], [0.0]), Softmax([[1.0]])), "more = 'Softmax': must be of the pool's kind"),
        (
            lambda: grow(LocalGaussians(square, square), LocalGaussians(np.zeros((1, 2)), np.zeros((1, 2)))),
            "more.inputs = 2: must be the pool's, 1",
        ),
        (
            lambda: grow(LocalGaussians(square, square, 0.5), LocalGaussians(square, square, 0.7)),
            "more.p_max = 0.6",
        ),
        (
            lambda: grow(LocalGaussians(square, square, 0.5), LocalGaussians(square, square, [0.7])),
            "more.p_max.shape = (1,): must be the pool's, ()",
        ),
        (
            lambda: grow(Factored([Motoneurons([0.0], [0.0])]), Factored([Motoneurons([0.0], [0.0])])),
            "pool = 'Factored': must be a pool of one kind of units, binary or graded",
        ),
        (lambda: grow(Softmax([[1.0]]), Softmax([[2.0]])), "pool = 'Softmax': must be a pool of one kind of units"),
    ],
)
def test_what_cannot_be_joined_is_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)


def test_the_limits_of_widths_stay_and_must_be_the_same():
    first, second = (LocalGaussians(np.zeros((n, 2)), np.zeros((n, 2)), log_width_limits=(-4.0, 2.0)) for n in (2, 1))
    assert grow(first, second).log_width_limits == (-4.0, 2.0)
    with pytest.raises(ValueError, match=r"more.log_width_limits = None: must be the pool's, \(-4.0, 2.0\)"):
        grow(first, LocalGaussians(np.zeros((1, 2)), np.zeros((1, 2))))
