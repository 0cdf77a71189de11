"""Random numbers that depend on the seed, the purpose and the block of decisions, and on nothing else.

Keys are folded from (seed, purpose, block of `BLOCK` decisions), and the numbers of a block are drawn at once, because
a key per decision would cost several times the decision itself. Changing the chunk length, or adding a seed or a
purpose, changes no existing number.
"""

import zlib

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from motorgrad._errors import check

BLOCK = 128
"""Decisions per block: few enough that the numbers of a thousand seeds stay in the cache."""
MIN_UNIFORM = 2.0**-24
"""What takes the place of a uniform number of 0, whose normal quantile is −∞: less than the resolution of float32."""


def block_at(decision: int) -> tuple[int, int]:
    """The number of the block of a decision, and its place in it. **Raises** `ValueError` from 549,755,813,888
    decisions on: blocks are numbered in 32 bits, and must not repeat."""
    block, place = divmod(decision, BLOCK)
    check(block < 2**32, "decisions", f"{decision:,}", f"at most {2**32 * BLOCK:,}; begin another run")
    return block, place


def key_of(seed: Int[Array, ""] | int, purpose: str | int | Array) -> jax.Array:
    """The key of a seed for one purpose: a name such as `"policy"`, or the 32-bit CRC of a name."""
    number = zlib.crc32(purpose.encode()) if isinstance(purpose, str) else purpose
    return jax.random.fold_in(jax.random.key(seed), number)


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
    def draw(seed: Int[Array, ""]) -> Array:
        return jax.random.uniform(jax.random.fold_in(key_of(seed, purpose), block), shape)

    return jax.vmap(draw, out_axes=-1)(jnp.asarray(seeds))


def normals(uniforms: Float[Array, " even"]) -> Float[Array, " even"]:
    """As many standard normal numbers, from pairs of U[0, 1) numbers (Box & Muller, 1958)."""
    first, second = uniforms.reshape(2, -1)
    radius = jnp.sqrt(-2 * jnp.log1p(-first))
    angle = 2 * jnp.pi * second
    return jnp.concatenate([radius * jnp.cos(angle), radius * jnp.sin(angle)])
