"""Weighted sums of inputs: of a batch of decisions they are one product of matrices."""

import contextlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.policies import GradedHyperplanes, Hyperplanes, Softmax, in_batches

RNG = np.random.default_rng(0)
WEIGHTS, BATCH = RNG.normal(size=(4, 3)), RNG.normal(size=(5, 3))
BIAS = np.ones(4)


@pytest.mark.parametrize(
    "policy",
    [Hyperplanes(WEIGHTS, BIAS), GradedHyperplanes(weights=WEIGHTS, bias=BIAS, log_deviation=BIAS), Softmax(WEIGHTS)],
    ids=lambda policy: type(policy).__name__,
)
def test_in_batches_the_weighted_sums_of_units_are_one_product_of_matrices(policy):
    found = []
    for context, products in ((in_batches, 2), (contextlib.nullcontext, 0)):  # forwards, and backwards to the weights

        def slopes(policy, batch):  # another function each time, as JAX keeps what it has traced
            return jax.grad(lambda own: jnp.sum(jax.vmap(own.prob)(batch) ** 2))(policy)

        with context():
            words = str(jax.make_jaxpr(slopes)(policy, BATCH))
            found.append(slopes(policy, BATCH))
        assert words.count("dot_general") == products
        assert ("5,4,3" in words) != bool(products)  # every product of every unit at every decision
    for one, other in zip(*map(jax.tree.leaves, found), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-6)
