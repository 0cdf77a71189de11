"""The output units that a policy has behind other units."""

from collections.abc import Callable
from typing import Any

import jax

from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._policy import Policy
from motorgrad.policies._starting import initial

OUTPUTS = {"discrete": "softmax", "binary": "hyperplanes", "continuous": "bounded-hyperplanes"}
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
