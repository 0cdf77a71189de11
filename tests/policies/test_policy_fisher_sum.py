"""The sum of Fisher matrices over many decisions, by any policy's own way of adding them."""

from collections.abc import Callable

import jax
import numpy as np
import pytest
from policy_examples import EXAMPLES, compiled, policy_of

from motorgrad.policies import (
    BoundedHyperplanes,
    FeatureMap,
    GradedHyperplanes,
    GradedPool,
    Hyperplanes,
    Mixed,
    Policy,
    Primitives,
    abilities,
    bounded_hyperplanes,
)
from motorgrad.policies._densities import DENSITIES

UNITS = ([[1.0, -0.5], [0.2, 0.3]], [0.1, -0.4], [-1.0, 0.3])


def plane():
    return Hyperplanes(*UNITS[:2])


def graded():
    return GradedHyperplanes(*UNITS)


MORE: dict[str, Callable[[], Policy]] = {
    "graded": graded,
    **{name: lambda name=name: BoundedHyperplanes(*UNITS, density=name) for name in DENSITIES},
    "pool": lambda: GradedPool(plane(), [1.0, -0.5], [-1.0, -0.5]),
    "primitives": lambda: Primitives(plane(), graded()),
    "mixed": lambda: Mixed([plane(), graded()]),
    "featured": lambda: bounded_hyperplanes(2, 3, features=FeatureMap(products=True, nonlinear=5)),
}
CASES = {**{name: lambda name=name: policy_of(name) for name in EXAMPLES}, **MORE}


@compiled
def sums(policy, observations, uniforms, weights):
    """The sum in the policy's own way, and the matrix of each decision."""
    actions = jax.vmap(policy.sample)(observations, uniforms)
    each = jax.vmap(lambda seen, action: abilities.fisher(policy, seen, action))(observations, actions)
    return abilities.fisher_sum(policy, observations, actions, weights), each


@pytest.mark.representatives("hyperplanes", "gated", "featured")
@pytest.mark.parametrize("name", CASES)
def test_it_is_the_sum_of_the_matrices_of_all_decisions(name):
    policy, rng = CASES[name](), np.random.default_rng(0)
    seen = np.asarray(rng.normal(size=(7, policy.inputs)), np.float32)
    uniforms = np.asarray(rng.random((7, policy.uniforms)), np.float32)
    weights = np.array([0.3, 0.0, 1.0, 0.2, 0.0, 2.0, 0.5], np.float32)
    found, each = sums(policy, seen, uniforms, weights)
    for one, matrices in zip(found, each, strict=True):
        wanted = np.tensordot(weights, matrices, 1)
        np.testing.assert_allclose(one, wanted, rtol=1e-4, atol=1e-5 * (1 + np.abs(wanted).max()))
