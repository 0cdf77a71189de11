"""Numbers by group of parameters: a learning rate or a damping for every field of a policy, by its name."""

from collections.abc import Mapping
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jaxtyping import Array

from motorgrad._errors import check, unknown
from motorgrad.schema import Range, path_of

P = TypeVar("P")


def check_groups(kind: str, name: str, values: object) -> None:
    """Refuse values that are negative, infinite or not numbers, in one value for all or in a mapping."""
    single = not isinstance(values, Mapping)
    for group, value in [(name, values)] if single else values.items():
        more = ", or a mapping from groups to such numbers" if single else ""
        check(Range(0).allows(value), f"{kind} {group}", value, f"{Range(0)}, or an array of them{more}")


def by_group(
    kind: str,
    name: str,
    values: Mapping[str, npt.ArrayLike] | npt.ArrayLike,
    parameters: P,
    default: float | None = None,
) -> P:
    """One value for all, or a mapping from names of fields to values, as a tree of the parameters' structure.

    A value broadcasts to its field. A name stands for that field in every pool of a policy, or, as `movement.weights`,
    for that of one pool; a field has the value of the longest name, or the `default`, where there is one. **Raises**
    `ValueError` for a field without a value, a value without a field, or one whose shape does not fit.
    """
    if not isinstance(values, Mapping):
        return jax.tree.map(lambda p: _fitting(f"{kind} {name}", values, p), parameters)
    places = [_field(path) for path, _ in jax.tree_util.tree_leaves_with_path(parameters)]
    groups = {place: max((n for n in values if _names(n, place)), key=len, default=None) for place in places}
    for group in values:
        if group in groups.values():
            continue
        longer = sorted({str(groups[place]) for place in places if _names(group, place)})
        check(not longer, f"{kind} {group}", values[group], f"left out: all that it names is in {', '.join(longer)}")
        known = places if "." in group else [place.rpartition(".")[2] for place in places]
        raise unknown(f"group of parameters in the {kind}s:", group, set(known))

    def look_up(path: jax.tree_util.KeyPath, parameter: Array) -> Array:
        place = _field(path)
        group = groups[place]
        value = default if group is None else values[group]
        if value is None:
            raise unknown(f"group of parameters without a {kind}:", place.rpartition(".")[2], values)
        return _fitting(f"{kind} {group}", value, parameter)

    return jax.tree_util.tree_map_with_path(look_up, parameters)


def _names(group: str, place: str) -> bool:
    """Whether a name is that of a field, or ends the path to it."""
    return f".{place}".endswith(f".{group}")


def _fitting(name: str, value: npt.ArrayLike, parameter: Array) -> Array:
    """A value as data, in the parameter's type; one that would change the parameter's shape is refused."""
    shape = np.shape(value)
    try:
        fits = np.broadcast_shapes(shape, parameter.shape) == parameter.shape
    except ValueError:
        fits = False
    check(fits, name, shape, f"one number or of a shape that broadcasts to {parameter.shape}")
    return jnp.asarray(value, parameter.dtype)


def _field(path: jax.tree_util.KeyPath) -> str:
    """The path of the field that a leaf belongs to, up to the last attribute on the way to it."""
    last = max((n for n, key in enumerate(path, 1) if isinstance(key, jax.tree_util.GetAttrKey)), default=0)
    return path_of(path[:last])
