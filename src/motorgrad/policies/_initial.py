"""The registry of initial policies."""

from collections.abc import Callable
from typing import Any

import jax

from motorgrad._errors import unknown
from motorgrad.policies._binary import hyperplanes, motoneurons
from motorgrad.policies._bounded import bounded_hyperplanes
from motorgrad.policies._composed import gated, mixture
from motorgrad.policies._controller import finite_state_controller
from motorgrad.policies._graded import graded_hyperplanes, graded_motoneurons
from motorgrad.policies._grow_and_prune import growing
from motorgrad.policies._hybrid import graded_tiles, primitives
from motorgrad.policies._layered import layered
from motorgrad.policies._local import gaussians, tiles
from motorgrad.policies._mirrored import mirrored
from motorgrad.policies._mixed import mixed
from motorgrad.policies._policy import Policy
from motorgrad.policies._querying import querying_motoneurons
from motorgrad.policies._recurrent import recurrent
from motorgrad.policies._soft_shapes import soft_boxes, soft_spheres
from motorgrad.policies._softmax import softmax

Initial = Policy | Callable[[jax.Array], Policy]
"""A policy, or a function from a seed's key to a policy."""

INITIAL: dict[str, Callable[..., Initial]] = {
    "bounded-hyperplanes": bounded_hyperplanes,
    "finite-state-controller": finite_state_controller,
    "gated": gated,
    "gaussians": gaussians,
    "graded-hyperplanes": graded_hyperplanes,
    "graded-motoneurons": graded_motoneurons,
    "graded-tiles": graded_tiles,
    "growing": growing,
    "hyperplanes": hyperplanes,
    "layered": layered,
    "mirrored": mirrored,
    "mixed": mixed,
    "mixture": mixture,
    "motoneurons": motoneurons,
    "primitives": primitives,
    "querying-motoneurons": querying_motoneurons,
    "recurrent": recurrent,
    "soft-boxes": soft_boxes,
    "soft-spheres": soft_spheres,
    "softmax": softmax,
    "tiles": tiles,
}
"""Initial policies by name, as used in configurations and on the command line.

Each takes a task (anything with `observation_size` and `action_size`), or a number of inputs and a number of units;
`mirrored` needs a task with a `mirror`. A random initial policy is a function of a key, so that every seed has its own.
A new kind of policy is registered here: configurations, command line, TimLab and tests find it by this name.
"""


IMPLIED: dict[str, dict[str, str]] = {"growing": {"growth": "clock"}}
"""Settings of the learner that an initial policy implies, by its name."""


def initial(name: str, task: Any, **settings: Any) -> Initial:
    """The initial policy called `name` for a task.

    **Arguments:**

    - `name`: a name in `INITIAL`.
    - `task`: a task, or anything with `observation_size` and `action_size`; or a number of inputs.
    - `settings`: those of the function of this name, such as `units`.

    **Returns:** a policy, or, where it is random, a function from a seed's key to a policy.

    **Raises:** `ValueError` for an unknown name, suggesting the closest one.

    **Example:**

    ```python
    initial("tiles", motorgrad.make("particle"), copies=2, width=0.2)
    initial("motoneurons", 1, units=4)(jax.random.key(0))  # one input, four units, random thresholds
    ```
    """
    if name not in INITIAL:
        raise unknown("policy", name, INITIAL, registered=True)
    return INITIAL[name](task, **settings)
