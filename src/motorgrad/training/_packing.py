"""A pytree as one array.

A compiled call costs some microseconds for every array that crosses its border, which for a small learner is more than
the learning itself. Packed, a whole learner crosses as one array of 32-bit words (and one more for each wider type).
Only what is large crosses by itself, as copying it would cost more.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

Packed = dict[str, Array]
WORD = jnp.dtype("uint32")
LARGE = 128  # numbers; where a copy begins to cost more than a border


class Packing:
    """How to pack trees of the structure of `example` (arrays or shapes), of one seed."""

    def __init__(self, example: PyTree[Any]):
        leaves, self._structure = jax.tree.flatten(example)
        self._shapes = [(leaf.shape, jnp.dtype(leaf.dtype)) for leaf in leaves]
        self._places = [_place(index, *each) for index, each in enumerate(self._shapes)]

    def pack(self, tree: PyTree[Array]) -> Packed:
        """One vector of words, bit for bit the numbers of the tree; types of another width have their own."""
        parts: dict[str, list[Array]] = {}
        for leaf, place in zip(jax.tree.leaves(tree), self._places, strict=True):
            vector = jnp.ravel(leaf)
            words = jax.lax.bitcast_convert_type(vector, WORD) if place == WORD.name else vector
            parts.setdefault(place, []).append(words)
        return {place: _overlay(v) if place == WORD.name else jnp.concatenate(v) for place, v in parts.items()}

    def unpack(self, packed: Packed) -> PyTree[Array]:
        """The inverse of `pack`."""
        leaves, start = [], dict.fromkeys(packed, 0)
        for (shape, kind), place in zip(self._shapes, self._places, strict=True):
            size = math.prod(shape)
            vector = packed[place][start[place] : start[place] + size]
            start[place] += size
            leaves.append((jax.lax.bitcast_convert_type(vector, kind) if place == WORD.name else vector).reshape(shape))
        return jax.tree.unflatten(self._structure, leaves)


def _place(index: int, shape: tuple[int, ...], kind: Any) -> str:
    """In which of the vectors a leaf stands."""
    if math.prod(shape) > LARGE:
        return f"leaf {index}"
    return WORD.name if kind.itemsize == WORD.itemsize else kind.name


def _overlay(vectors: list[Array]) -> Array:
    """Vectors of words one after the other. XLA fuses this into what makes them; it does not a long concatenation."""
    size, start = sum(vector.size for vector in vectors), 0
    total = jnp.zeros(size, WORD)
    for vector in vectors:
        total = total | jnp.pad(vector, (start, size - start - vector.size))
        start += vector.size
    return total
