"""Random numbers that depend on the seed, the purpose and the block of decisions, and on nothing else.

Keys are folded from (seed, purpose, block of `BLOCK` decisions), and the numbers of a block are drawn at once, because
a key per decision would cost several times the decision itself. Changing the chunk length, or adding a seed or a
purpose, changes no existing number.
"""

import zlib
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Float, Int, UInt32

from motorgrad._errors import check

BLOCK = 128
"""Decisions per block: few enough that the numbers of a thousand seeds stay in the cache."""
MIN_UNIFORM = 2.0**-24
"""What takes the place of a uniform number of 0, whose normal quantile is −∞: less than the resolution of float32."""
ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))
PARITY = 0x1BD11BDA
Key = tuple[Any, Any]


def block_at(decision: int) -> tuple[int, int]:
    """The number of the block of a decision, and its place in it. **Raises** `ValueError` from 549,755,813,888
    decisions on: blocks are numbered in 32 bits, and must not repeat."""
    block, place = divmod(decision, BLOCK)
    if block >= 2**32:
        check(False, "decisions", f"{decision:,}", f"at most {2**32 * BLOCK:,}; begin another run")
    return block, place


def key_of(seed: Int[Array, ""] | int, purpose: str | int | Array) -> jax.Array:
    """The key of a seed for one purpose: a name such as `"policy"`, or the 32-bit CRC of a name."""
    number = zlib.crc32(purpose.encode()) if isinstance(purpose, str) else purpose
    return jax.random.fold_in(jax.random.key(seed, impl="threefry2x32"), number)


def draw_block(
    seeds: Int[Array | np.ndarray, " seeds"], purpose: str, block: Int[Array, ""], size: int
) -> Float[Array, "decisions size seeds"]:
    """Draw the U[0, 1) numbers of a block: `size` per decision, seeds last."""
    return _drawn(seeds, purpose, block, (BLOCK, size)) if size else jnp.zeros((BLOCK, 0, len(seeds)))


def draw_places(
    seeds: Int[Array | np.ndarray, " seeds"], purpose: str, block: Int[Array, ""], size: int
) -> Float[Array, "decisions size seeds"]:
    """Like `draw_block`, with different numbers: a larger `size` appends numbers and keeps the existing ones."""
    return jnp.swapaxes(_drawn(seeds, purpose, block, (size, BLOCK)), 0, 1)


def _drawn(seeds: Int[Array | np.ndarray, " seeds"], purpose: str, block: Array, shape: tuple[int, int]) -> Array:
    keys = jax.vmap(lambda seed: jax.random.key_data(key_of(seed, purpose)), out_axes=-1)(jnp.asarray(seeds))
    places = jnp.arange(shape[0] * shape[1], dtype=jnp.uint32).reshape(*shape, 1)
    return from_bits(*threefry(folded((keys[0], keys[1]), block), jnp.uint32(0), places), jnp.result_type(float))


def threefry(key: Key, first: Array, second: Array) -> tuple[UInt32[Array, "..."], UInt32[Array, "..."]]:
    """The block cipher Threefry-2×32 with 20 rounds (Salmon, Moraes, Dror & Shaw, 2011), element by element: the bits
    of `jax.random`, from a key and the upper and the lower half of a place.

    On the CPU, JAX rolls the rounds into a loop, whose rotations are data then. XLA hardly vectorises that: a number
    takes 13 ns, and 2 ns here, of the 60 ns that a decision of a small learner takes.
    """
    keys = (*key, key[0] ^ key[1] ^ jnp.uint32(PARITY))
    x = first + keys[0]
    y = second + keys[1]
    for turn in range(5):
        for rotation in ROTATIONS[turn % 2]:
            x = x + y
            y = ((y << jnp.uint32(rotation)) | (y >> jnp.uint32(32 - rotation))) ^ x
        x = x + keys[(turn + 1) % 3]
        y = y + keys[(turn + 2) % 3] + jnp.uint32(turn + 1)
    return x, y


def folded(key: Key, number: Array | int) -> Key:
    """`jax.random.fold_in`."""
    return threefry(key, jnp.uint32(0), jnp.asarray(number, jnp.uint32))


def from_bits(high: Array, low: Array, dtype: DTypeLike) -> Float[Array, "..."]:
    """The U[0, 1) numbers that `jax.random.uniform` makes of such bits, float32 or float64: a random mantissa of a
    number in [1, 2), less 1."""
    if dtype == jnp.float64:
        mantissa = (high.astype(jnp.uint64) << jnp.uint64(32) | low) >> jnp.uint64(12)
        return jax.lax.bitcast_convert_type(mantissa | jnp.uint64(0x3FF << 52), jnp.float64) - 1
    mantissa = (high ^ low) >> jnp.uint32(9)
    return jax.lax.bitcast_convert_type(mantissa | jnp.uint32(0x3F800000), jnp.float32) - 1


def normals(uniforms: Float[Array, " even"]) -> Float[Array, " even"]:
    """As many standard normal numbers, from pairs of U[0, 1) numbers (Box & Muller, 1958)."""
    first, second = uniforms.reshape(2, -1)
    radius = jnp.sqrt(-2 * jnp.log1p(-first))
    angle = 2 * jnp.pi * second
    return jnp.concatenate([radius * jnp.cos(angle), radius * jnp.sin(angle)])
