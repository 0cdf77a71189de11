"""The sums of scores and entropies over many decisions, by any policy's own way of adding them."""

import jax
import numpy as np
import pytest
from policy_examples import compiled
from test_policy_fisher_sum import CASES

from motorgrad.policies import abilities


@compiled
def sums(policy, observations, uniforms, weights):
    """The sums in the policy's own way, and the numbers of each decision."""
    actions = jax.vmap(policy.sample)(observations, uniforms)
    each = jax.vmap(policy.score)(observations, actions)
    found = abilities.score_sum(policy, observations, actions, weights)
    return found, each, abilities.entropy_sum(policy, observations), jax.vmap(policy.entropy)(observations)


@pytest.mark.representatives("hyperplanes", "softmax-5", "squashed", "featured")
@pytest.mark.parametrize("name", CASES)
def test_they_are_the_sums_over_all_decisions(name):
    policy, rng = CASES[name](), np.random.default_rng(0)
    seen = np.asarray(rng.normal(size=(7, policy.inputs)), np.float32)
    uniforms = np.asarray(rng.random((7, policy.uniforms)), np.float32)
    weights = np.asarray(rng.normal(size=(7, 2)), np.float32)
    found, each, entropy, entropies = sums(policy, seen, uniforms, weights)
    assert jax.tree.structure(found) == jax.tree.structure(each)
    for one, scores in zip(jax.tree.leaves(found), jax.tree.leaves(each), strict=True):
        wanted = np.tensordot(weights.T, scores, 1)
        np.testing.assert_allclose(one, wanted, rtol=1e-4, atol=1e-5 * (1 + np.abs(wanted).max()))
    np.testing.assert_allclose(entropy, np.sum(entropies), rtol=1e-5, atol=1e-5)
