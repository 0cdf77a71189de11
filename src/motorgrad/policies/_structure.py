"""A policy's structure as plain text, so that a stored policy can be rebuilt without running anybody's code."""

import re
from typing import Any

import jax
import numpy as np

from motorgrad._errors import unknown
from motorgrad.policies._policy import Policy


def describe(value: Any) -> Any:
    """A policy as a table: its kind, and for every field the type and shape of an array, or a nested table."""
    if isinstance(value, Policy):
        fields = {name: describe(getattr(value, name)) for name in value.__dataclass_fields__}
        return {"kind": _kind(type(value)), **{name: field for name, field in fields.items() if field is not None}}
    if isinstance(value, tuple | list):
        return [describe(item) for item in value]
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return f"{np.dtype(value.dtype).name}[{','.join(map(str, value.shape))}]"
    return value


def rebuild(description: Any) -> Any:
    """The inverse of `describe`: a policy whose arrays are only shapes (`jax.ShapeDtypeStruct`).

    **Raises:** `ValueError` for a kind that is not a known policy. A class is known once its module is imported.
    """
    if isinstance(description, dict):
        known = _kinds()
        if description["kind"] not in known:
            raise unknown("kind of policy", description["kind"], known)
        policy = object.__new__(known[description["kind"]])
        for name in policy.__dataclass_fields__:
            object.__setattr__(policy, name, rebuild(description.get(name)))
        return policy
    if isinstance(description, list):
        return tuple(rebuild(item) for item in description)
    if isinstance(description, str) and (found := re.fullmatch(r"(\w+)\[([\d,]*)\]", description)):
        shape = tuple(int(size) for size in found[2].split(",") if size)
        return jax.ShapeDtypeStruct(shape, np.dtype(found[1]))
    return description


def _kind(cls: type) -> str:
    """Classes of this library by their public place, so that moving a private file loses no stored policy."""
    parts = [part for part in cls.__module__.split(".") if not part.startswith("_")]
    return ".".join([*parts, cls.__qualname__])


def _kinds() -> dict[str, type[Policy]]:
    found, todo = {}, [Policy]
    while todo:
        cls = todo.pop()
        found[_kind(cls)] = cls
        todo.extend(cls.__subclasses__())
    return found
