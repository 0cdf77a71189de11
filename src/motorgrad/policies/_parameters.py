"""A policy as a tree: the policies that it is made of, its trainable arrays, and these as rows, one for each unit."""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

T = TypeVar("T")
M = TypeVar("M", bound=eqx.Module)


class Parametric(eqx.Module):
    """What every policy is as a tree: a module of trainable and of fixed arrays, which may hold others of its kind."""


P = TypeVar("P", bound=Parametric)


def fixed(**keywords: Any) -> Any:
    """Declare a field of a policy whose arrays are *not* trainable, such as a mask or a maximal probability.

    **Arguments:** `keywords`: those of `equinox.field`.

    **Example:**

    ```python
    class Units(SigmoidUnits):
        threshold: Array  # trainable
        steepness: Array = fixed(converter=jnp.asarray, default=5.0)  # not trainable
    ```
    """
    return eqx.field(metadata={"fixed": True}, **keywords)


def parts_of(policy: Parametric) -> tuple[Any, ...]:
    """The policies that a policy is made of, in the order of its fields."""
    fields = [getattr(policy, field.name) for field in dataclasses.fields(policy)]
    leaves = jax.tree.leaves(fields, is_leaf=lambda node: isinstance(node, Parametric))
    return tuple(leaf for leaf in leaves if isinstance(leaf, Parametric))


def with_parts(policy: P, parts: Sequence[Any]) -> P:
    """Replace the policies that a policy is made of, unchecked, so that arrays may have leading axes of seeds."""
    return eqx.tree_at(parts_of, policy, tuple(parts)) if parts else policy


def with_fields(policy: P, /, **values: Any) -> P:
    """Replace fields of a policy, unchecked, so that arrays may have leading axes of seeds."""
    names = tuple(values)
    return eqx.tree_at(lambda node: tuple(getattr(node, name) for name in names), policy, tuple(values.values()))


def is_plain(policy: Parametric) -> bool:
    """Whether a policy is a pool of one kind of units, not made of other policies."""
    return not parts_of(policy)


def trainable(policy: P) -> P:
    """The trainable part of a policy.

    **Arguments:** `policy`: any policy.

    **Returns:** the policy with every fixed array replaced by `None`, as in `equinox.partition`.
    """
    return split(policy)[0]


def split(policy: M) -> tuple[M, M]:
    """Partition a policy into its trainable and its fixed arrays.

    **Arguments:** `policy`: any policy, or another module.

    **Returns:** the two parts, which `equinox.combine` joins again.
    """

    def is_trainable(path: tuple[Any, ...], leaf: object) -> bool:
        node: Any = policy
        for key in path:
            if isinstance(key, jax.tree_util.GetAttrKey) and hasattr(node, "__dataclass_fields__"):
                if node.__dataclass_fields__[key.name].metadata.get("fixed", False):
                    return False
                node = getattr(node, key.name)
            elif isinstance(key, jax.tree_util.SequenceKey | jax.tree_util.DictKey):
                node = node[key.idx if isinstance(key, jax.tree_util.SequenceKey) else key.key]
            else:  # within a node of the user's own kind, where nothing is declared
                break
        return eqx.is_inexact_array(leaf)

    return eqx.partition(policy, jax.tree_util.tree_map_with_path(is_trainable, policy))


def in_structure(policy: P, /, **values: Any) -> P:
    """A gradient of `policy`: its trainable structure with the given values of the fields."""
    return with_fields(trainable(policy), **values)


def rows(gradient: PyTree, units: int) -> Float[Array, "units parameters"]:
    """Arrays with a leading axis of `units`, flattened and side by side; for one unit, arrays of any shape."""
    parts = [leaf.reshape(units, leaf.size // units) for leaf in jax.tree.leaves(gradient)]
    return jnp.concatenate(parts, axis=1) if parts else jnp.zeros((units, 0))


def from_rows(like: T, matrix: Float[Array | np.ndarray, "units parameters"]) -> T:
    """The inverse of `rows`, with the structure, shapes and types of `like`."""
    leaves, structure = jax.tree.flatten(like)
    widths = [leaf.size // matrix.shape[0] for leaf in leaves]
    ends = itertools.accumulate(widths, initial=0)
    parts = [matrix[:, start:end] for start, end in itertools.pairwise(ends)]
    shaped = [part.reshape(leaf.shape).astype(leaf.dtype) for part, leaf in zip(parts, leaves, strict=True)]
    return jax.tree.unflatten(structure, shaped)


def outer(block: Float[Array, "units parameters"]) -> Float[Array, "units parameters parameters"]:
    """The outer product of each row with itself."""
    return block[:, :, None] * block[:, None, :]


def outer_sum(rows: Float[Array, "rows units parameters"]) -> Float[Array, "units parameters parameters"]:
    """The sum of the outer products of each unit's rows with themselves."""
    return jnp.einsum("tup,tuq->upq", rows, rows)


def shared_outer_sum(
    weights: Float[Array, "rows units"], rows: Float[Array, "rows inputs"]
) -> Float[Array, "units inputs inputs"]:
    """The sums of the outer products of rows with themselves that all units share, each by weights of its own."""
    units = weights.shape[1]
    size = rows.shape[1]
    weighted = (weights[:, :, None] * rows[:, None, :]).reshape(len(rows), units * size)
    return (weighted.T @ rows).reshape(units, size, size)  # one product is twice as fast as one for each unit


def per_unit(values: Float[Array, " units"], array: Array) -> Array:
    """`values` with trailing axes of length 1, to broadcast against an array that leads with the units."""
    return values.reshape(values.shape + (1,) * (array.ndim - 1))
