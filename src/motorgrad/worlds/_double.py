"""Policies in double precision, for exact answers."""

from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp

from motorgrad.policies import Policy

P = TypeVar("P", bound=Policy)


def double(policy: P) -> P:
    """The policy with its real numbers in double precision; to be called where JAX has that enabled."""
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64) if eqx.is_inexact_array(leaf) else leaf, policy)
