"""A pytree as few arrays, and an array that compiled calls read where it is.

A compiled call costs some microseconds for every array that crosses its border, which for a small learner is more than
the learning itself. Packed, a whole learner crosses as one array of 32-bit words, flags among them, and one more for
each other type. Large leaves cross by themselves, because copying them would cost more. Leaves that a call does not
change stand apart, so that they need not come back.
"""

import math
from collections.abc import Collection, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from motorgrad._arrays import AnyArray

Packed = dict[str, Array]
WORD = jnp.dtype("uint32")
LARGE = 4096  # numbers of all seeds; where a copy begins to cost more than a border


class Packing:
    """How to pack trees with the structure of `example` (arrays or shapes), for one of several seeds. The leaves whose
    indices are in `still` stand in arrays of their own, whose names the attribute `still` has."""

    def __init__(self, example: PyTree[Any], seeds: int, still: Collection[int] = ()):
        leaves, self._structure = jax.tree.flatten(example)
        self._leaves = [jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in leaves]
        self._names = [_name(i, leaf, seeds, i in still) for i, leaf in enumerate(self._leaves)]
        self.still = frozenset(self._names[index] for index in still)

    def pack(self, tree: PyTree[Array]) -> Packed:
        """Vectors with the numbers of the tree, bit for bit, and its large leaves."""
        parts: dict[str, list[Array]] = {name: [] for name in self._names}
        for leaf, name in zip(jax.tree.leaves(tree), self._names, strict=True):
            parts[name].append(_words(leaf) if name.endswith(WORD.name) else leaf)
        return {
            name: leaves[0] if _alone(name) else jnp.concatenate([jnp.ravel(leaf) for leaf in leaves])
            for name, leaves in parts.items()
        }

    def unpack(self, packed: Packed) -> PyTree[Array]:
        """The inverse of `pack`."""
        leaves = []
        start = dict.fromkeys(packed, 0)
        for like, name in zip(self._leaves, self._names, strict=True):
            leaf = packed[name]
            if not _alone(name):
                size = math.prod(like.shape)
                leaf = leaf[start[name] : start[name] + size].reshape(like.shape)
                start[name] += size
            leaves.append(_of_words(leaf, like.dtype) if name.endswith(WORD.name) else leaf)
        return jax.tree.unflatten(self._structure, leaves)

    def unpack_all(self, packed: Mapping[str, AnyArray]) -> PyTree[np.ndarray]:
        """The trees of all seeds, stacked, without a program, which would have to be compiled."""
        rows = {name: np.asarray(part) for name, part in packed.items()}
        leaves = []
        start = dict.fromkeys(rows, 0)
        for like, name in zip(self._leaves, self._names, strict=True):
            leaf = rows[name]
            if not _alone(name):
                size = math.prod(like.shape)
                leaf = leaf[:, start[name] : start[name] + size].reshape(len(leaf), *like.shape)
                start[name] += size
            flags = name.endswith(WORD.name) and like.dtype.kind == "b"
            leaves.append(leaf != 0 if flags else leaf.view(like.dtype))
        return jax.tree.unflatten(self._structure, leaves)


def shared_memory(rows: int, width: int) -> tuple[Float[np.ndarray, "rows width"], Float[Array, "rows width"]]:
    """An array, and JAX's view of the same memory: compiled code takes an array of JAX's some microseconds sooner than
    one of NumPy's. JAX thinks that its arrays never change, so write only while no call runs, or waits to.
    """
    alignment = 64  # bytes, which XLA requires of memory that it does not copy
    size = rows * width * np.dtype(np.float32).itemsize
    raw = np.zeros(size + alignment, np.uint8)
    first = -raw.ctypes.data % alignment
    array = raw[first : first + size].view(np.float32).reshape(rows, width)
    return array, jax.dlpack.from_dlpack(array, copy=False)


def _name(index: int, leaf: jax.ShapeDtypeStruct, seeds: int, still: bool) -> str:
    """The name of the array in which a leaf stands."""
    if math.prod(leaf.shape) * seeds > LARGE:
        return f"leaf {index}"
    kind = WORD if leaf.dtype.kind == "b" or leaf.dtype.itemsize == WORD.itemsize else leaf.dtype
    return f"still {kind.name}" if still else kind.name


def _words(leaf: Array) -> Array:
    return leaf.astype(WORD) if leaf.dtype.kind == "b" else jax.lax.bitcast_convert_type(leaf, WORD)


def _of_words(words: Array, kind: jnp.dtype) -> Array:
    return words != 0 if kind.kind == "b" else jax.lax.bitcast_convert_type(words, kind)


def _alone(name: str) -> bool:
    return name.startswith("leaf")
