"""A pytree as a few arrays, one for each type of number.

A compiled call costs some microseconds for every array that crosses its border, which for a small learner is more than
the learning itself. Packed, a whole learner crosses as two or three arrays.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

Packed = dict[str, Array]


class Packing:
    """How to pack trees of the structure of `example` (arrays or shapes), of one seed."""

    def __init__(self, example: PyTree[Any]):
        leaves, self._structure = jax.tree.flatten(example)
        self._shapes = [(leaf.shape, jnp.dtype(leaf.dtype).name) for leaf in leaves]

    def pack(self, tree: PyTree[Array]) -> Packed:
        """One vector for each type of number."""
        parts: dict[str, list[Array]] = {}
        for leaf, (_, kind) in zip(jax.tree.leaves(tree), self._shapes, strict=True):
            parts.setdefault(kind, []).append(jnp.ravel(leaf))
        return {kind: jnp.concatenate(vectors) for kind, vectors in parts.items()}

    def unpack(self, packed: Packed) -> PyTree[Array]:
        """The inverse of `pack`."""
        leaves, start = [], dict.fromkeys(packed, 0)
        for shape, kind in self._shapes:
            size = math.prod(shape)
            leaves.append(packed[kind][start[kind] : start[kind] + size].reshape(shape))
            start[kind] += size
        return jax.tree.unflatten(self._structure, leaves)
