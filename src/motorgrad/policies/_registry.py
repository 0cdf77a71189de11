"""Initial policies by name: the registry, and the output units that a policy has behind other units."""

from collections.abc import Callable
from typing import Any

import jax

from motorgrad._errors import unknown
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._policy import Policy

Initial = Policy | Callable[[jax.Array], Policy]
"""A policy, or a function from a seed's key to a policy."""

INITIAL: dict[str, Callable[..., Initial]] = {}
"""Initial policies by name, as used in configurations and on the command line.

Each takes a task (anything with `observation_size` and `action_size`), or a number of inputs and a number of units;
`mirrored` needs a task with a `mirror`. A random initial policy is a function of a key, so that every seed has its own.
`_initial.py` registers those of the library: configurations, command line, TimLab and tests find them by these names.
"""


def initial(name: str, task: SizedTask | int, **settings: Any) -> Initial:
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


OUTPUTS = {"discrete": "softmax", "binary": "hyperplanes", "graded": "bounded-hyperplanes"}
"""Output units by the kind of a task's actions."""


class Resized:
    """A task as the output units see it: with other inputs, of which nothing is known but their number."""

    observation_range = mirror = None

    def __init__(self, task: SizedTask | int, inputs: int, outputs: int):
        self.observation_size, self.action_size, self._task = inputs, outputs, task

    def __getattr__(self, name: str) -> Any:
        return getattr(self._task, name)


def output_units(
    task: SizedTask | int, units: int | None, output: str
) -> tuple[Callable[[int, jax.Array], Policy], bool]:
    """The output units of a task over other inputs.

    **Arguments:** `task` and `units`, as in `sizes`; `output`, a name in `INITIAL`, or an empty string for the units
    that suit the task's actions.

    **Returns** a function from the number of inputs and a key to the initial units; and whether they need a constant
    input.
    """
    _, outputs = sizes(task, units)
    name = output or OUTPUTS.get(getattr(task, "actions", "binary"), "mixed")

    def make(inputs: int, key: jax.Array) -> Policy:
        resized = inputs if isinstance(task, int) else Resized(task, inputs, outputs)
        made = initial(name, resized, units=outputs)
        return made if isinstance(made, Policy) else made(key)

    return make, name == "softmax"
