"""Leaves of a module that are not arrays, kept out of the traced tree."""

from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

T = TypeVar("T")


@jax.tree_util.register_static
class Frozen:
    """A leaf that is not an array, such as an activation function, as part of the structure of a tree.

    Two are equal if their values are equal and of one type, so that programs are shared by modules that differ in their
    arrays alone.

    **Arguments:** the `value`.
    """

    def __init__(self, value: Any):
        self.value = value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Frozen) and type(self.value) is type(other.value) and bool(self.value == other.value)

    def __hash__(self) -> int:
        try:
            return hash((type(self.value), self.value))
        except TypeError:  # a set, or an object that defines equality alone
            return hash(type(self.value))

    def __call__(self, *arguments: object, **named: object) -> Any:
        return self.value(*arguments, **named)

    def __repr__(self) -> str:
        return f"Frozen({self.value!r})"


def frozen(module: T) -> T:
    """A module whose leaves are arrays alone: each other leaf is wrapped in `Frozen`. NumPy's arrays become JAX's.

    **Arguments:** the `module`.
    """

    def wrapped(leaf: object) -> object:
        if isinstance(leaf, np.ndarray | np.generic):
            return jnp.asarray(leaf)
        return leaf if eqx.is_array(leaf) or isinstance(leaf, jax.ShapeDtypeStruct) else Frozen(leaf)

    return jax.tree.map(wrapped, module)


def with_frozen_functions(module: T) -> T:
    """A module whose leaves that are functions, such as the activation of an `eqx.nn.MLP`, are wrapped in `Frozen`,
    which is called as they are. So a custom policy may hold any equinox module.

    **Arguments:** the `module`.
    """
    return jax.tree.map(lambda leaf: Frozen(leaf) if callable(leaf) and not eqx.is_array(leaf) else leaf, module)


def thawed(module: T) -> T:
    """The inverse of `frozen`: the module as it is called.

    **Arguments:** the `module`.
    """

    def unwrapped(leaf: object) -> object:
        return leaf.value if isinstance(leaf, Frozen) else leaf

    return jax.tree.map(unwrapped, module, is_leaf=lambda leaf: isinstance(leaf, Frozen))
