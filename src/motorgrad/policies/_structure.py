"""The structure of a policy as plain text, from which a stored policy is rebuilt."""

import dataclasses
import functools
import inspect
import re
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import numpy as np

from motorgrad._errors import unknown
from motorgrad.policies._frozen import Frozen
from motorgrad.policies._policy import Policy

UNSET = {"kind": "unset"}
"""Of a field that an instance leaves to its class."""


def describe(value: Any) -> Any:
    """The structure of a policy as plain data: its kind, and for every field a shape and type or a nested description.

    A stored policy is rebuilt from this, so that loading one never runs code from the file.

    **Arguments:** `value`: a policy, or the value of one of its fields.

    **Example:**

    ```python
    describe(Hyperplanes([[1.0, 2.0]], [0.0]))
    # {'kind': 'motorgrad.policies.Hyperplanes', 'weights': 'float32[1,2]', 'bias': 'float32[1]'}
    ```
    """
    if isinstance(value, Frozen):
        return {"kind": "frozen", "value": describe(value.value)}
    if isinstance(value, eqx.Module):
        own = vars(value)  # without defaults that the class still holds for the instance
        names = [field.name for field in dataclasses.fields(value)]
        if isinstance(value, Policy):
            names.remove("interface")  # which is no part of the policy, and stored beside it
        fields = {name: describe(own[name]) if name in own else UNSET for name in names}
        return {"kind": _kind(type(value)), **{name: field for name, field in fields.items() if field is not None}}
    if isinstance(value, tuple):
        return [describe(item) for item in value]
    if isinstance(value, list):
        return {"kind": "list", "items": [describe(item) for item in value]}
    if isinstance(value, dict):
        return {"kind": "dict", "keys": [*value], "items": [describe(item) for item in value.values()]}
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return f"{np.dtype(value.dtype).name}[{','.join(map(str, value.shape))}]"
    if callable(value):
        return {"kind": "function", "name": _function_name(value)}
    return value if value is None or isinstance(value, bool | int | float | str) else repr(value)


def rebuild(description: object) -> Any:
    """The inverse of `describe`: a policy whose arrays are placeholders (`jax.ShapeDtypeStruct`).

    **Arguments:** `description`: what `describe` returned.

    **Raises:** `ValueError` for an unknown kind of policy or module, and for a function that is not one of JAX's. A
    class is known once its module has been imported.
    """
    if isinstance(description, list):
        return tuple(rebuild(item) for item in description)
    if isinstance(description, str) and (found := re.fullmatch(r"(\w+)\[([\d,]*)\]", description)):
        shape = tuple(int(size) for size in found[2].split(",") if size)
        return jax.ShapeDtypeStruct(shape, np.dtype(found[1]))
    if not isinstance(description, dict):
        return description
    kind = description["kind"]
    if kind in _CONTAINERS:
        return _CONTAINERS[kind](description)
    known = _kinds()
    if kind not in known:
        raise unknown("kind of policy", kind, known)
    policy = object.__new__(known[kind])
    for field in dataclasses.fields(policy):
        if (described := description.get(field.name)) != UNSET:
            object.__setattr__(policy, field.name, rebuild(described))
    return policy


def _function(description: dict[str, Any]) -> Callable[..., Any]:
    name = description["name"]
    known = _functions()
    if name not in known:
        needed = "a function of jax.nn, jax.numpy or jax.lax; a policy with functions of its own must be given again"
        raise ValueError(f"function = {name!r}: must be {needed}")
    return known[name]


_CONTAINERS: dict[str, Callable[[dict[str, Any]], Any]] = {
    "dict": lambda found: dict(zip(found["keys"], map(rebuild, found["items"]), strict=True)),
    "frozen": lambda found: Frozen(rebuild(found["value"])),
    "function": _function,
    "list": lambda found: [rebuild(item) for item in found["items"]],
}


@functools.cache
def _functions() -> dict[str, Callable[..., Any]]:
    """The functions that a description may name."""
    modules = {"jax.nn": jax.nn, "jax.numpy": jax.numpy, "jax.lax": jax.lax}
    found = {
        f"{path}.{name}": function
        for path, module in modules.items()
        for name, function in vars(module).items()
        if callable(function) and not name.startswith("_") and not isinstance(function, type)
    }
    identity = inspect.signature(eqx.nn.MLP.__init__).parameters["final_activation"].default
    return {**found, "equinox.nn.MLP.final_activation": identity}


def _function_name(function: Callable[..., Any]) -> str:
    """The name of a function that a description may name; of another, its name in Python."""
    for name, known in _functions().items():
        if known is function:
            return name
    named = function if hasattr(function, "__qualname__") else type(function)
    return f"{named.__module__}.{named.__qualname__}"


def _kind(cls: type) -> str:
    """The public path of a class, without private modules: stored policies survive the move of a private file."""
    parts = [part for part in cls.__module__.split(".") if not part.startswith("_")]
    return ".".join([*parts, cls.__qualname__])


def _kinds() -> dict[str, type[Any]]:
    """Policies, and the modules that a policy may hold, by public path: equinox's layers and all classes of others."""
    found: dict[str, type[Any]] = {}
    pending: list[type[Any]] = [eqx.Module]
    while pending:
        cls = pending.pop()
        kind = _kind(cls)
        if not kind.startswith("equinox.") or kind.startswith("equinox.nn."):
            found[kind] = cls
        pending.extend(cls.__subclasses__())
    return found
