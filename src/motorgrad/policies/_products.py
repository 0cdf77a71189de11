"""Weighted sums of inputs: those of one decision, or of a batch of decisions at once."""

import contextlib
from collections.abc import Iterator
from contextvars import ContextVar

import jax.numpy as jnp
from jaxtyping import Array, Float

_in_batches = ContextVar("_in_batches", default=False)


@contextlib.contextmanager
def in_batches() -> Iterator[None]:
    """What is traced within it maps policies over batches of decisions: the last digits of weighted sums may depend on
    the size of a batch, which makes them fast."""
    token = _in_batches.set(True)
    try:
        yield
    finally:
        _in_batches.reset(token)


def weighted(weights: Float[Array, "units inputs"], inputs: Float[Array, "*decisions inputs"]) -> Array:
    r"""$w_i \cdot y$ of each unit: for one decision or, in one product of matrices, for several in rows."""
    if inputs.ndim > 1:
        return inputs @ weights.T
    if _in_batches.get():
        # Mapped over a batch, a sum of products writes batch × units × inputs numbers to memory: with 128, 39 and 128
        # it takes ten times as long as a matrix product, forwards and backwards.
        return weights @ inputs
    # A sum of products instead of a matrix product: XLA then rounds alike for one seed and for many.
    return jnp.sum(weights * inputs, axis=-1)
