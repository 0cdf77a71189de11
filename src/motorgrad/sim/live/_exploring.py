"""How freely a policy explores: a factor on the temperature of its units, put into their parameters."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from motorgrad.policies import (
    GradedHyperplanes,
    GradedMotoneurons,
    Hyperplanes,
    Motoneurons,
    Policy,
    Softmax,
    SoftSpheres,
)

# Which parameters a temperature divides, and to which logarithms it is added.
DIVIDED: dict[type, tuple[str, ...]] = {
    Hyperplanes: ("weights", "bias"),
    Softmax: ("weights",),
    Motoneurons: ("gain",),
}
ADDED: dict[type, dict[str, float]] = {
    GradedHyperplanes: {"log_deviation": 1.0},
    GradedMotoneurons: {"log_deviation": 1.0},
    SoftSpheres: {"log_hardness": -1.0},
}


def explores(policy: Any) -> bool:
    """Whether any unit of a policy has a temperature or a noise of its own."""
    return any(type(part) in DIVIDED or type(part) in ADDED for part in _parts(policy))


def hotter(policy: Any, factor: float) -> Any:
    """The policy at `factor` times its temperature, or with so many times its units' own noise.

    Where a unit fires with probability σ(φ), a temperature divides φ; the noise of graded units and the softness of
    spheres are parameters of their own. The other parameters stay as they are. Any leading axes of seeds.
    """
    if isinstance(policy, tuple | list):
        return type(policy)(hotter(part, factor) for part in policy)
    if not isinstance(policy, Policy):
        return policy
    changed = {}
    for field in dataclasses.fields(policy):
        value = getattr(policy, field.name)
        if field.name in DIVIDED.get(type(policy), ()):
            changed[field.name] = jax.tree.map(lambda x: x / factor, value)
        elif field.name in ADDED.get(type(policy), {}):
            changed[field.name] = value + ADDED[type(policy)][field.name] * jnp.log(factor)
        else:
            changed[field.name] = hotter(value, factor)
    made = object.__new__(type(policy))
    for name, value in changed.items():
        object.__setattr__(made, name, value)
    return made


def _parts(policy: Any) -> list[Any]:
    if isinstance(policy, tuple | list):
        return [found for part in policy for found in _parts(part)]
    if not isinstance(policy, Policy):
        return []
    inner = [_parts(getattr(policy, field.name)) for field in dataclasses.fields(policy)]
    return [policy, *(found for parts in inner for found in parts)]
