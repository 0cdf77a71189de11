"""Gradients of functions of a policy, and room for its decisions."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad.policies import Policy, split, trainable


def gradient_of(gain: Callable[[Any], Float[Array, ""]], policy: Policy) -> PyTree[Array]:
    """The gradient of a function of a policy, in the structure and the types of its trainable part."""
    learned, settings = split(policy)
    slope = jax.grad(lambda parameters: gain(eqx.combine(parameters, settings)))(learned)
    return jax.tree.map(lambda g, p: g.astype(p.dtype), slope, learned)


def empty_rows(policy: Policy, size: int) -> tuple[Array, Array]:
    """Zeros in the place of the observations and actions of so many decisions."""
    observation = jnp.zeros(policy.inputs, jax.tree.leaves(trainable(policy))[0].dtype)
    observations, actions = (
        jnp.zeros((size, *each.shape), each.dtype) for each in (observation, policy.mode(observation))
    )
    return observations, actions
