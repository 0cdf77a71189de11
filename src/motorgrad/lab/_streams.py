"""Random numbers of blocks: from the seed, the block's identity and a span of ticks, so that nothing else can change
them. A block with the id of a purpose in training has the same numbers as that has."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._random import BLOCK as SPAN
from motorgrad._random import key_of

__all__ = ["SPAN", "draw_span", "draw_start"]
START = 0xFFFFFFFF  # no span of ticks has this number


def draw_span(seed: Any, stream: Any, span: Any, size: int) -> Float[Array, "ticks size"]:
    """The U[0, 1) numbers of a span of `SPAN` ticks, `size` a tick."""
    return jax.random.uniform(jax.random.fold_in(key_of(seed, stream), span), (SPAN, size))


def draw_start(seed: Any, stream: Any, size: int) -> Float[Array, " size"]:
    """The numbers that a block's `init` is given."""
    if size == 0:
        return jnp.zeros(0)
    return jax.random.uniform(jax.random.fold_in(key_of(seed, stream), jnp.uint32(START)), (size,))
