"""Pruning: which units take no part, what taking them away changes, and that rows or the mask go."""

import equinox as eqx
import jax
import numpy as np
import pytest
from policy_examples import Compiled, compiled, observation_of, policy_of

from motorgrad.policies import (
    FreeGaussians,
    Hyperplanes,
    LocalGaussians,
    Masked,
    SoftBoxes,
    SoftSpheres,
    activity,
    grow,
    prune,
    reach,
)

KEPT = np.array([True, False, True])
LOCAL = {
    "local": lambda c, s: LocalGaussians(c, s, 0.9),
    "free": lambda c, s: FreeGaussians(c, s, np.full(len(c), -3.0)),
    "spheres": lambda c, s: SoftSpheres(c, s[:, 0], np.full(len(c), 1.5)),
    "boxes": lambda c, s: SoftBoxes(c, s, np.full(len(c), 1.5)),
}


def made(name, units=6, seed=0):
    rng = np.random.default_rng(seed)
    return LOCAL[name](rng.uniform(-1, 2, size=(units, 2)), rng.normal(-1, 0.3, size=(units, 2)))


def test_activity_is_the_mean_probability_of_firing_over_what_was_visited():
    policy = made("local")
    looks = np.random.default_rng(1).random((50, 2))
    wanted = np.mean([Compiled(policy).prob(y) for y in looks], axis=0)
    np.testing.assert_allclose(activity(policy, looks), wanted, rtol=1e-5)


@pytest.mark.ci
def test_without_a_unit_actions_differ_by_exactly_its_activity():
    """The stated bound: the total variation distance, by enumeration of all joint actions."""
    with jax.enable_x64(True):
        policy = made("local", 4)
        looks = np.random.default_rng(1).random((8, 2))
        share = np.asarray(activity(policy, looks))
        chance = lambda policy, y: np.exp(Compiled(policy).over("log_prob", y, actions))  # noqa: E731
        actions = Compiled(policy).enumerate()
        for unit in range(4):
            without = prune(Masked(policy), np.arange(4) != unit)
            pairs = [(chance(policy, y), chance(without, y)) for y in looks]
            distance = np.mean([0.5 * np.abs(a - b).sum() for a, b in pairs])
            assert distance == pytest.approx(share[unit], abs=1e-12)


@pytest.mark.representatives("local", "boxes")
@pytest.mark.parametrize("name", LOCAL)
def test_reach_is_the_greatest_probability_on_a_fine_grid_of_the_box(name):
    policy = made(name)
    low, high = np.array([0.0, 0.2]), np.array([1.0, 0.8])
    side = [np.linspace(a, b, 201) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*side), axis=-1).reshape(-1, 2)
    greatest = np.asarray(jax.jit(jax.vmap(policy.prob))(grid)).max(0)
    found = np.asarray(compiled(reach)(policy, low, high))
    assert (found >= greatest - 1e-6).all()
    np.testing.assert_allclose(found, greatest, rtol=0.02, atol=1e-6)  # the grid misses a centre by .005 at most
    assert found.min() < 0.5 * found.max()


def test_a_masked_unit_that_is_off_has_neither_activity_nor_reach():
    masked = Masked(made("local", 3), KEPT)
    looks = np.random.default_rng(1).random((9, 2))
    active_share = compiled(activity)
    assert active_share(masked, looks)[1] == compiled(reach)(masked, 0.0, 1.0)[1] == 0
    every, active = (np.asarray(active_share(policy, looks)) for policy in (masked.pool, masked))
    np.testing.assert_array_equal(active[KEPT], every[KEPT])


@pytest.mark.representatives("motoneurons", "local-gaussians-p-max")
@pytest.mark.parametrize("name", ["motoneurons", "hyperplanes", "local-gaussians-p-max", "soft-spheres", "soft-boxes"])
def test_pruning_a_pool_removes_rows_and_undoes_growing(name):
    pool, more = policy_of(name, 0), policy_of(name, 1)
    assert eqx.tree_equal(prune(grow(pool, more), np.arange(6) < 3), pool)
    y = observation_of(pool)
    np.testing.assert_array_equal(Compiled(prune(pool, KEPT)).prob(y), Compiled(pool).prob(y)[KEPT])


def test_a_common_setting_stays_what_it_is():
    assert prune(LocalGaussians(np.zeros((3, 1)), np.zeros((3, 1)), 0.7), KEPT).p_max == np.float32(0.7)


def test_pruning_a_masked_pool_keeps_its_arrays_and_never_switches_on():
    masked = Masked(made("local", 3), [True, True, False])
    pruned = prune(masked, KEPT)
    assert eqx.tree_equal(pruned.pool, masked.pool)
    np.testing.assert_array_equal(pruned.active, [True, False, False])


def test_masked_pools_of_many_seeds_are_pruned_together_each_by_its_own_units():
    pools = jax.tree.map(lambda *leaves: np.stack(leaves), *(Masked(made("local", 5, seed)) for seed in range(3)))
    looks = np.random.default_rng(1).random((40, 2), np.float32)
    pruned = jax.jit(jax.vmap(lambda policy: prune(policy, activity(policy, looks) >= 0.05)))(pools)
    wanted = [np.asarray(compiled(activity)(made("local", 5, seed), looks)) >= 0.05 for seed in range(3)]
    np.testing.assert_array_equal(pruned.active, wanted)
    assert not np.all(wanted)
    assert np.any(wanted)


@pytest.mark.parametrize(
    ("call", "names"),
    [
        (lambda: prune(made("local", 3), [True, False]), "kept = Array([ True, False], dtype=bool): must be 3 of true"),
        (lambda: prune(made("local", 3), [1.0, 0.0, 1.0]), "must be 3 of true and false"),
        (lambda: prune(made("local", 3), [False] * 3), "kept = 'no unit': must be at least one"),
        (lambda: prune(policy_of("factored-gated"), [True] * 4), "policy = 'Factored': must be a pool of one kind"),
        (lambda: jax.jit(lambda k: prune(made("local", 3), k))(KEPT), "must be Masked where it is pruned in compiled"),
        (lambda: activity(made("local"), np.zeros((0, 2))), "visited = (0, 2): must be at least one observation of 2"),
        (lambda: activity(made("local"), np.zeros((4, 3))), "visited = (4, 3)"),
        (lambda: reach(Hyperplanes([[1.0]], [0.0]), 0.0, 1.0), "policy = 'Hyperplanes': must be a pool of local units"),
        (lambda: reach(made("local"), 1.0, 0.0), "low, high = ([1.0, 1.0], [0.0, 0.0])"),
    ],
)
def test_impossible_pruning_is_refused_by_name(call, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        call()
    assert names in str(error.value)
