"""Row updates in a form that XLA compiles into one function with the loop around it."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

FEW = 256  # numbers


@jax.custom_batching.custom_vmap
def write_rows(
    array: Float[Array, "units *row"], units: Int[Array, " room"], values: Float[Array, "room *row"], count: Array
) -> Float[Array, "units *row"]:
    """The array with the first `count` values in the rows of these units.

    It is a scatter, written as a loop: XLA for CPUs then compiles it into one function with the decision loop, which
    runs several times as fast (`motorgrad._compiler`).
    """
    return jax.lax.fori_loop(0, count, lambda k, array: _set(array, values[k], (units[k],)), array)


def greatest(values: Float[Array, " units"]) -> Float[Array, ""]:
    """The maximum, by halves: like a scatter, a large reduction would not be compiled with the loop."""
    while len(values) > FEW:
        half = -(-len(values) // 2)
        values = jnp.maximum(values[:half], values[-half:])
    return jnp.max(values)


@write_rows.def_vmap
def _put_seeds(seeds: int, batched: Sequence[bool], *arguments: Array) -> tuple[Array, bool]:
    """A loop over seeds around the loop over units: `vmap` would turn it into a scatter after all."""
    array, units, values, count = (
        jnp.asarray(argument) if has else jnp.broadcast_to(argument, (seeds, *argument.shape))
        for argument, has in zip(arguments, batched, strict=True)
    )

    def seed(s: Array, array: Array) -> Array:
        return jax.lax.fori_loop(0, count[s], lambda k, array: _set(array, values[s, k], (s, units[s, k])), array)

    return jax.lax.fori_loop(0, seeds, seed, array), True


def _set(array: Array, value: Array, place: tuple[Array, ...]) -> Array:
    start = [*place, *[0] * value.ndim]
    return jax.lax.dynamic_update_slice(array, value.reshape((1,) * len(place) + value.shape), start)
