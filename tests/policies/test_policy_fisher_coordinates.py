"""Coordinates whose derivatives make up the Fisher matrix, for every kind of policy."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from policy_examples import EXAMPLES, EXTREMES, Compiled, call, observation_of, policy_of
from test_policy_fisher_sum import MORE

from motorgrad.policies import split


@eqx.filter_jit
def jacobian(policy, observation, action):
    """The derivatives of the coordinates, (coordinates, parameters)."""
    learned, settings = split(policy)
    flat, shaped = ravel_pytree(learned)
    return jax.jacrev(lambda v: eqx.combine(shaped(v), settings).fisher_coordinates(observation, action))(flat)


@pytest.mark.representatives("gated", "network", "softmax-5", "local-gaussians-p-max", "hyperplanes")
@pytest.mark.parametrize("name", EXAMPLES)
def test_they_make_up_the_expected_square_of_the_score(name):
    policy = policy_of(name)
    seen, actions = observation_of(policy), policy.enumerate()
    ask = Compiled(policy)
    scores, share = ask.scores(seen, actions), np.exp(ask.over("log_prob", seen, actions))
    wanted = np.einsum("a,ai,aj->ij", share, scores, scores)
    roots = np.stack([jacobian(policy, seen, action) for action in actions])
    found = np.einsum("a,aki,akj->ij", share, roots, roots)
    np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-5 * np.abs(wanted).max())


@pytest.mark.parametrize("name", ["graded", "squashed", "truncated", "mixed", "featured"])
def test_graded_units_have_the_blocks_of_their_fisher_matrices(name):
    policy = MORE[name]
    seen = observation_of(policy)
    action = call(policy, "sample", seen, jnp.full(policy.uniforms, 0.3))
    root = jacobian(policy, seen, action)
    found = np.asarray(root.T @ root)
    learned, _ = split(policy)
    shaped = ravel_pytree(learned)[1]
    rows = [call(policy, "blocks", shaped(row)) for row in np.eye(len(found), dtype=np.float32)]
    for index, matrices in enumerate(call(policy, "fisher", seen, action)):
        basis = np.stack([blocks[index] for blocks in rows])  # (parameters, units, own)
        own = np.einsum("pui,pq,quj->uij", basis, found, basis)
        np.testing.assert_allclose(own, matrices, rtol=1e-4, atol=1e-5 * np.abs(matrices).max())


@pytest.mark.parametrize("name", EXTREMES)
def test_they_are_finite_where_actions_are_certain(name):
    policy, seen = EXTREMES[name]()
    action = call(policy, "mode", jnp.asarray(seen, jnp.float32))
    assert np.isfinite(jacobian(policy, jnp.asarray(seen, jnp.float32), action)).all()
