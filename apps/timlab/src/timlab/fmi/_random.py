"""JAX's random numbers by plain operations on whole numbers, so that they can be translated."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._random import folded, from_bits, threefry
from timlab.compiler import SPAN


def draw(seed: int, stream: int, tick: Array, size: int) -> Float[Array, " size"]:
    """The U[0, 1) numbers of a block for one tick: those of `draw_span`, bit for bit, without the rest of the span.

    **Raises:** `ValueError` in double precision, or where JAX is set to draw numbers otherwise.
    """
    plain = jax.config.jax_threefry_partitionable and jax.config.jax_default_prng_impl == "threefry2x32"  # pyright: ignore
    if not plain or jnp.result_type(float) != jnp.float32:
        raise ValueError("random numbers can be exported in single precision, with JAX's default generator only")
    key = folded(folded((jnp.uint32(0), jnp.uint32(seed)), stream), tick // jnp.uint32(SPAN))
    places = (tick % jnp.uint32(SPAN)) * jnp.uint32(size) + np.arange(size, dtype=np.uint32)
    high, low = threefry(key, jnp.zeros(size, jnp.uint32), places)
    return from_bits(high, low, jnp.float32)
