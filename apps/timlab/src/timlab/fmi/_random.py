"""JAX's random numbers by plain operations on whole numbers, so that they can be translated."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, UInt32

from timlab.compiler import SPAN

ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))
PARITY = 0x1BD11BDA
Key = tuple[Any, Any]


def threefry(key: Key, first: Array, second: Array) -> tuple[UInt32[Array, "..."], UInt32[Array, "..."]]:
    """The block cipher Threefry-2×32 with 20 rounds (Salmon, Moraes, Dror & Shaw, 2011), element by element."""
    keys = (*key, key[0] ^ key[1] ^ jnp.uint32(PARITY))
    x = first + keys[0]
    y = second + keys[1]
    for round in range(5):
        for rotation in ROTATIONS[round % 2]:
            x = x + y
            y = ((y << jnp.uint32(rotation)) | (y >> jnp.uint32(32 - rotation))) ^ x
        x = x + keys[(round + 1) % 3]
        y = y + keys[(round + 2) % 3] + jnp.uint32(round + 1)
    return x, y


def folded(key: Key, number: Array | int) -> Key:
    """`jax.random.fold_in`."""
    return threefry(key, jnp.uint32(0), jnp.asarray(number, jnp.uint32))


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
    mantissa = ((high ^ low) >> jnp.uint32(9)) | jnp.uint32(0x3F800000)
    return jax.lax.bitcast_convert_type(mantissa, jnp.float32) - 1.0
