"""Normal numbers from uniform ones."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def normals(uniforms: Float[Array, " even"]) -> Float[Array, " even"]:
    """As many standard normal numbers, from pairs of U[0, 1) (Box & Muller, 1958)."""
    first, second = uniforms.reshape(2, -1)
    radius = jnp.sqrt(-2 * jnp.log1p(-first))
    angle = 2 * jnp.pi * second
    return jnp.concatenate([radius * jnp.cos(angle), radius * jnp.sin(angle)])
