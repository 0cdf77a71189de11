"""The entropy bonus: what keeps a policy from being sure before it has tried."""

import equinox as eqx
import jax
from jaxtyping import Array, Float, PyTree

from motorgrad.policies import Policy, split


def entropy_gradient(policy: Policy, observation: Float[Array, " inputs"]) -> PyTree[Array]:
    r"""$\nabla_\theta H(\pi(\cdot \mid y))$, the entropy of the action in nats, that of all units together; in the
    structure of the trainable part."""
    parameters, settings = split(policy)
    return jax.grad(lambda theta: eqx.combine(theta, settings).entropy(observation))(parameters)
