"""Temperatures: what they scale, that composed policies pass them on, and that a new unit declares nothing else."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import policy_of

from motorgrad.policies import (
    GradedHyperplanes,
    GradedMotoneurons,
    GradedPool,
    Hyperplanes,
    LocalGaussians,
    Masked,
    Motoneurons,
    Primitives,
    Querying,
    abilities,
)


@pytest.mark.parametrize("name", ["hyperplanes", "motoneurons", "soft-spheres"])
def test_a_temperature_divides_the_potential(name):
    policy = policy_of(name)
    seen = jnp.full(policy.inputs, 0.3)
    np.testing.assert_allclose(
        abilities.with_temperature(policy, 4.0).potential(seen), policy.potential(seen) / 4, rtol=1e-5
    )


def test_a_temperature_divides_the_log_odds_of_a_choice():
    policy, seen = policy_of("softmax-5"), jnp.array([0.3, -1.0, 0.5])
    log_odds = [np.diff(np.log(each.prob(seen))) for each in (policy, abilities.with_temperature(policy, 2.0))]
    np.testing.assert_allclose(log_odds[1], log_odds[0] / 2, rtol=1e-4)


@pytest.mark.parametrize("policy", [GradedMotoneurons([0.2], [3.0], [-1.0]), GradedHyperplanes([[1.0]], [0.5], [-1.0])])
def test_a_temperature_multiplies_the_noise_of_graded_units_above_the_floor(policy):
    seen, hotter = jnp.array([0.4]), abilities.with_temperature(policy, 3.0)
    np.testing.assert_allclose(hotter.deviation - policy.floor, 3 * (policy.deviation - policy.floor), rtol=1e-5)
    np.testing.assert_array_equal(hotter.mean(seen), policy.mean(seen))


@pytest.mark.parametrize("name", ["local-gaussians", "free-gaussians", "soft-boxes", "admission-thresholds"])
def test_other_units_have_no_temperature_and_stay(name):
    policy = policy_of(name)
    assert not abilities.has_temperature(policy)
    assert eqx.tree_equal(abilities.with_temperature(policy, 2.0), policy)


def composed():
    line, gauss = Hyperplanes([[1.0], [2.0]], [0.5, -0.5]), LocalGaussians([[0.0], [1.0]], [[0.0], [0.0]])
    movement = GradedHyperplanes([[1.0], [0.5]], [0.0, 1.0], [-1.0, -2.0])
    return {
        "masked": (Masked(line, [True, False]), lambda p: [p.pool]),
        "querying": (Querying(Motoneurons([0.5], [3.0])), lambda p: [p.policy]),
        "primitives": (Primitives(line, movement), lambda p: [p.precondition, p.movement]),
        "graded-pool": (GradedPool(line, [1.0, 2.0], [-1.0, -1.0]), lambda p: [p.pool]),
        "graded-gaussians": (GradedPool(gauss, [1.0, 2.0], [-1.0, -1.0]), lambda p: [p.pool]),
        "factored": (policy_of("factored"), lambda p: [*p.pools]),
        "gated": (policy_of("gated"), lambda p: [p.gate, p.branches[0], *p.branches[1].pools]),
        "mirrored": (policy_of("mirrored"), lambda p: [p.pool]),
    }


COMPOSED = ("masked", "querying", "primitives", "graded-pool", "graded-gaussians", "factored", "gated", "mirrored")


@pytest.mark.parametrize("name", COMPOSED)
def test_composed_policies_pass_a_temperature_on_to_their_parts(name):
    examples = composed()
    assert set(examples) == set(COMPOSED)
    policy, parts = examples[name]
    hotter = abilities.with_temperature(policy, 2.0)
    assert abilities.has_temperature(policy) == any(abilities.has_temperature(part) for part in parts(policy))
    for part, own in zip(parts(policy), parts(hotter), strict=True):
        assert eqx.tree_equal(own, abilities.with_temperature(part, 2.0))
    rest = [eqx.tree_at(lambda p: parts(p), each, [0.0] * len(parts(each))) for each in (policy, hotter)]
    assert eqx.tree_equal(*rest)  # nothing else has changed


def test_parameters_of_many_seeds_are_scaled_together():
    pools = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(policy_of("factored", seed) for seed in range(3)))
    hotter = abilities.with_temperature(pools, 2.0)
    for seed in range(3):
        alone = abilities.with_temperature(policy_of("factored", seed), 2.0)
        assert eqx.tree_equal(jax.tree.map(lambda x, seed=seed: x[seed], hotter), alone)


def test_a_new_unit_has_a_temperature_by_overriding_one_method():
    class Scaled(Motoneurons):
        def with_temperature(self, factor):
            return Scaled(self.threshold, self.gain / factor**2)

    assert abilities.has_temperature(Masked(Scaled([0.0], [4.0])))
    assert float(abilities.with_temperature(Masked(Scaled([0.0], [4.0])), 2.0).pool.gain[0]) == 1.0
