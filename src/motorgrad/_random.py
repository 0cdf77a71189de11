"""Random numbers: from a seed, a purpose and a block of decisions, so that nothing else can change them.

Keys are folded from (seed, purpose, block of `BLOCK` decisions) and a block's numbers are drawn at once: a key for
every decision would cost several times the decision itself. The length of a chunk, another seed or another purpose
changes no number.
"""

import zlib
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

BLOCK = 128
"""Decisions whose numbers are drawn together: few enough that a thousand seeds' stay in the cache."""


def key_of(seed: Int[Array, ""] | int, purpose: str | Any) -> jax.Array:
    """The key of a seed for one purpose, such as `"policy"` or `"world"`, or for the 32 bits of its name's CRC."""
    number = zlib.crc32(purpose.encode()) if isinstance(purpose, str) else purpose
    return jax.random.fold_in(jax.random.key(seed), number)


def draw_block(
    seeds: Int[Array | np.ndarray, " seeds"], purpose: str, block: Int[Array, ""], size: int
) -> Float[Array, "decisions size seeds"]:
    """The U[0, 1) numbers of a block of decisions, `size` a decision, seeds last."""

    def draw(seed: Any) -> Float[Array, "decisions size"]:
        return jax.random.uniform(jax.random.fold_in(key_of(seed, purpose), block), (BLOCK, size))

    if size == 0:
        return jnp.zeros((BLOCK, 0, len(seeds)))
    return jax.vmap(draw, out_axes=-1)(jnp.asarray(seeds))


def draw_places(
    seeds: Int[Array | np.ndarray, " seeds"], purpose: str, block: Int[Array, ""], size: int
) -> Float[Array, "decisions size seeds"]:
    """As `draw_block`, other numbers, of which more are drawn by a greater `size` and none is changed by it."""

    def draw(seed: Any) -> Float[Array, "size decisions"]:
        return jax.random.uniform(jax.random.fold_in(key_of(seed, purpose), block), (size, BLOCK))

    return jnp.swapaxes(jax.vmap(draw, out_axes=-1)(jnp.asarray(seeds)), 0, 1)
