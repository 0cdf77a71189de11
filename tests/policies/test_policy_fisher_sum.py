"""The sum of Fisher matrices over many decisions, by any policy's own way of adding them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import EXAMPLES, call, policy_of

from motorgrad.policies import (
    BoundedHyperplanes,
    FeatureMap,
    GradedHyperplanes,
    GradedPool,
    Hyperplanes,
    Mixed,
    Policy,
    Primitives,
    bounded_hyperplanes,
)
from motorgrad.policies._densities import DENSITIES

PLANE = Hyperplanes([[1.0, -0.5], [0.2, 0.3]], [0.1, -0.4])
GRADED = GradedHyperplanes([[1.0, -0.5], [0.2, 0.3]], [0.1, -0.4], [-1.0, 0.3])
MORE: dict[str, Policy] = {
    "graded": GRADED,
    **{name: BoundedHyperplanes(GRADED.slope, GRADED.level, GRADED.log_deviation, density=name) for name in DENSITIES},
    "pool": GradedPool(PLANE, [1.0, -0.5], [-1.0, -0.5]),
    "primitives": Primitives(PLANE, GRADED),
    "mixed": Mixed([PLANE, GRADED]),
    "featured": bounded_hyperplanes(2, 3, features=FeatureMap(products=True, nonlinear=5)),
}
CASES = {**{name: lambda name=name: policy_of(name) for name in EXAMPLES}, **{n: lambda n=n: MORE[n] for n in MORE}}


@pytest.mark.representatives("hyperplanes", "gated", "squashed", "featured")
@pytest.mark.parametrize("name", CASES)
def test_it_is_the_sum_of_the_matrices_of_all_decisions(name):
    policy, rng = CASES[name](), np.random.default_rng(0)
    seen = jnp.asarray(rng.normal(size=(7, policy.inputs)), jnp.float32)
    uniforms = jnp.asarray(rng.random((7, policy.uniforms)), jnp.float32)
    weights = jnp.asarray([0.3, 0.0, 1.0, 0.2, 0.0, 2.0, 0.5])
    actions = jnp.stack([call(policy, "sample", y, u) for y, u in zip(seen, uniforms, strict=True)])
    found = call(policy, "fisher_sum", seen, actions, weights)
    each = [call(policy, "fisher", y, a) for y, a in zip(seen, actions, strict=True)]
    wanted = jax.tree.map(lambda *matrices: sum(w * m for w, m in zip(weights, matrices, strict=True)), *each)
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-5 * (1 + np.abs(other).max()))
