"""Coordinates whose derivatives make up the Fisher matrix, for every kind of policy."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from policy_examples import EXAMPLES, EXTREME_REPRESENTATIVES, EXTREMES, compiled, observation_of, policy_of
from test_policy_fisher_sum import MORE

from motorgrad.policies import abilities, split


def jacobian(policy, observation, action):
    """The derivatives of the coordinates, (coordinates, parameters)."""
    learned, settings = split(policy)
    flat, shaped = ravel_pytree(learned)
    return jax.jacrev(lambda v: abilities.fisher_coordinates(eqx.combine(shaped(v), settings), observation, action))(
        flat
    )


@compiled
def of_all_actions(policy, observation):
    """The log-probability, the score and the derivatives of the coordinates of every action."""

    def of(action):
        score = ravel_pytree(policy.score(observation, action))[0]
        return policy.log_prob(observation, action), score, jacobian(policy, observation, action)

    return jax.vmap(of)(abilities.enumerate(policy))


@compiled
def of_one_action(policy, observation, uniforms):
    """The derivatives of the coordinates, the blocks of each parameter alone, and the Fisher matrices."""
    action = policy.sample(observation, uniforms)
    flat, shaped = ravel_pytree(split(policy)[0])
    basis = jax.vmap(lambda row: abilities.blocks(policy, shaped(row)))(jnp.eye(flat.size, dtype=flat.dtype))
    return jacobian(policy, observation, action), basis, abilities.fisher(policy, observation, action)


@compiled
def at_the_mode(policy, observation):
    return jacobian(policy, observation, policy.mode(observation))


@pytest.mark.representatives("softmax-5", "local-gaussians-p-max")
@pytest.mark.parametrize("name", EXAMPLES)
def test_they_make_up_the_expected_square_of_the_score(name):
    policy = policy_of(name)
    log_prob, scores, roots = map(np.asarray, of_all_actions(policy, observation_of(policy)))
    share = np.exp(log_prob)
    wanted = np.einsum("a,ai,aj->ij", share, scores, scores)
    found = np.einsum("a,aki,akj->ij", share, roots, roots)
    np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-5 * np.abs(wanted).max())


@pytest.mark.representatives("mixed", "featured")
@pytest.mark.parametrize("name", ["graded", "squashed", "truncated", "mixed", "featured"])
def test_graded_units_have_the_blocks_of_their_fisher_matrices(name):
    policy = MORE[name]()
    uniforms = np.full(policy.uniforms, 0.3, np.float32)
    root, bases, fisher = of_one_action(policy, observation_of(policy), uniforms)
    found = np.asarray(root.T @ root)
    for basis, matrices in zip(map(np.asarray, bases), map(np.asarray, fisher), strict=True):  # parameters, units, own
        own = np.einsum("pui,pq,quj->uij", basis, found, basis)
        np.testing.assert_allclose(own, matrices, rtol=1e-4, atol=1e-5 * np.abs(matrices).max())


@pytest.mark.representatives(*EXTREME_REPRESENTATIVES)
@pytest.mark.parametrize("name", EXTREMES)
def test_they_are_finite_where_actions_are_certain(name):
    policy, seen = EXTREMES[name]()
    assert np.isfinite(at_the_mode(policy, np.asarray(seen, np.float32))).all()
