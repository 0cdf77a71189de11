"""Numbers by group of parameters: a learning rate or a damping for every field of a policy, by its name."""

from collections.abc import Mapping
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from motorgrad._errors import check, unknown
from motorgrad._tree import Range

P = TypeVar("P")


def check_groups(kind: str, name: str, values: Any) -> None:
    """Refuse values that are negative, infinite or not numbers, in one value for all or in a mapping."""
    single = not isinstance(values, Mapping)
    for group, value in [(name, values)] if single else values.items():
        more = ", or a mapping from groups to such numbers" if single else ""
        check(Range(0).allows(value), f"{kind} {group}", value, f"{Range(0)}, or an array of them{more}")


def by_group(kind: str, name: str, values: Any, parameters: P, default: float | None = None) -> P:
    """One value for all, or a mapping from names of fields to values, as a tree of the parameters' structure.

    **Arguments:** the `kind` of value and the setting's `name`, for errors; the `default` of fields without a value,
    where there is one. A value broadcasts to its field. A name stands for that field in every pool of a policy.

    **Raises:** `ValueError` for a field without a value, a value without a field, or one whose shape does not fit.
    """
    if not isinstance(values, Mapping):
        return jax.tree.map(lambda p: _fitting(f"{kind} {name}", values, p), parameters)
    fields = {_field(path) for path, _ in jax.tree_util.tree_leaves_with_path(parameters)}
    for group in values:
        if group not in fields:
            raise unknown(f"group of parameters in the {kind}s:", group, fields)

    def look_up(path: tuple[Any, ...], parameter: Array) -> Array:
        group = _field(path)
        if group not in values and default is None:
            raise unknown(f"group of parameters without a {kind}:", group, values)
        return _fitting(f"{kind} {group}", values.get(group, default), parameter)

    return jax.tree_util.tree_map_with_path(look_up, parameters)


def _fitting(name: str, value: Any, parameter: Array) -> Array:
    """A value as data, in the parameter's type; one that would change the parameter's shape is refused."""
    shape = np.shape(value)
    try:
        fits = np.broadcast_shapes(shape, parameter.shape) == parameter.shape
    except ValueError:
        fits = False
    check(fits, name, shape, f"one number or of a shape that broadcasts to {parameter.shape}")
    return jnp.asarray(value, parameter.dtype)


def _field(path: tuple[Any, ...]) -> str:
    """The name of the field that a leaf belongs to: the last attribute on the way to it."""
    names = [key.name for key in path if isinstance(key, jax.tree_util.GetAttrKey)]
    return names[-1] if names else ""
