"""Initial policies for a task: the usual starting points by name.

Each takes a task (anything with `observation_size` and `action_size`) or the sizes themselves; `mirrored` a task that
has a `mirror`. Where the start is random the result is a function of a key, so that every seed starts differently.
"""

from collections.abc import Callable
from typing import Any

import jax

from motorgrad._errors import unknown
from motorgrad.policies._initial_composed import gated, mirrored, mixture, primitives
from motorgrad.policies._initial_global import (
    graded_hyperplanes,
    graded_motoneurons,
    hyperplanes,
    motoneurons,
    querying_motoneurons,
    softmax,
)
from motorgrad.policies._initial_local import gaussians, graded_tiles, growing, soft_boxes, soft_spheres, tiles
from motorgrad.policies._policy import Policy

Initial = Policy | Callable[[jax.Array], Policy]
"""A policy, or a function that makes one from a seed's key."""

INITIAL: dict[str, Callable[..., Initial]] = {
    "gated": gated,
    "gaussians": gaussians,
    "graded-hyperplanes": graded_hyperplanes,
    "graded-motoneurons": graded_motoneurons,
    "graded-tiles": graded_tiles,
    "growing": growing,
    "hyperplanes": hyperplanes,
    "mirrored": mirrored,
    "mixture": mixture,
    "motoneurons": motoneurons,
    "primitives": primitives,
    "querying-motoneurons": querying_motoneurons,
    "soft-boxes": soft_boxes,
    "soft-spheres": soft_spheres,
    "softmax": softmax,
    "tiles": tiles,
}
"""Initial policies by the name used in configurations and on the command line."""


IMPLIED: dict[str, dict[str, str]] = {"growing": {"growth": "clock"}}
"""Settings of the learner that an initial policy implies, by its name."""


def initial(name: str, task: Any, **settings: Any) -> Initial:
    """The initial policy called `name` for `task`; an unknown name is refused with the nearest one."""
    if name not in INITIAL:
        raise unknown("policy", name, INITIAL)
    return INITIAL[name](task, **settings)
