"""Initial policies for a task: the usual starting points by name.

Each takes a task (anything with `observation_size` and `action_size`) or the sizes themselves. Where the start is
random the result is a function of a key, so that every seed starts differently.
"""

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from motorgrad._errors import check, unknown
from motorgrad.policies._gaussian import LocalGaussians
from motorgrad.policies._hyperplane import Hyperplanes
from motorgrad.policies._motoneuron import Motoneurons
from motorgrad.policies._policy import Policy
from motorgrad.policies._softmax import Softmax

Initial = Policy | Callable[[jax.Array], Policy]
"""A policy, or a function that makes one from a seed's key."""


def _sizes(task: Any, outputs: int | None) -> tuple[int, int]:
    sized = isinstance(task, int) or all(hasattr(task, name) for name in ("observation_size", "action_size"))
    check(sized and not isinstance(task, type), "task", task, "a task, such as motorgrad.make('hopper'), or a number")
    inputs = task if isinstance(task, int) else task.observation_size
    outputs = (None if isinstance(task, int) else task.action_size) if outputs is None else outputs
    check(inputs > 0, "inputs", inputs, "a positive number of inputs")
    check(outputs is not None and outputs > 0, "outputs", outputs, "a positive number of units or actions")
    return inputs, int(outputs or 0)


def hyperplanes(task: Any, units: int | None = None) -> Hyperplanes:
    """Hyperplane units with zero weights: every unit fires with probability one half, the policy of most entropy.

    **Arguments:** `task`, a task or the number of inputs; `units`, by default the task's number of binary actions.
    """
    inputs, outputs = _sizes(task, units)
    return Hyperplanes(jnp.zeros((outputs, inputs)), jnp.zeros(outputs))


def softmax(task: Any, units: int | None = None) -> Softmax:
    """A softmax policy with zero weights: every action is as likely."""
    inputs, outputs = _sizes(task, units)
    return Softmax(jnp.zeros((outputs, inputs)))


def motoneurons(
    task: Any, units: int | None = None, low: float = 0.0, high: float = 1.0
) -> Callable[[jax.Array], Motoneurons]:
    """Motoneurons of gain 0 whose thresholds are drawn from U[`low`, `high`] (section 4.3.1 of the thesis)."""
    inputs, outputs = _sizes(task, units)
    if inputs != 1 and not isinstance(task, int):
        named = f"task {getattr(task, 'name', type(task).__name__)!r} has {inputs} observed numbers"
        raise ValueError(f"policy = 'motoneurons': {named}, a motoneuron has a single input")
    check(inputs == 1, "inputs", inputs, "1: a motoneuron has a single input")
    check(low < high, "low, high", (low, high), "an interval, low < high")

    def initial(key: jax.Array) -> Motoneurons:
        return Motoneurons(jax.random.uniform(key, (outputs,), minval=low, maxval=high), jnp.zeros(outputs))

    return initial


def gaussians(
    task: Any, units: int | None = None, width: float = 0.5, p_max: float = 1.0, low: float = -1.0, high: float = 1.0
) -> Callable[[jax.Array], LocalGaussians]:
    """Local Gaussian units of one `width` whose centres are drawn from U[`low`, `high`] in every input."""
    inputs, outputs = _sizes(task, units)
    check(0 < width < math.inf, "width", width, "positive")
    check(0 < p_max <= 1, "p_max", p_max, "in (0, 1]")
    check(low < high, "low, high", (low, high), "an interval, low < high")

    def initial(key: jax.Array) -> LocalGaussians:
        centre = jax.random.uniform(key, (outputs, inputs), minval=low, maxval=high)
        return LocalGaussians(centre, jnp.full_like(centre, jnp.log(width)), jnp.asarray(p_max))

    return initial


INITIAL: dict[str, Callable[..., Initial]] = {
    "gaussians": gaussians,
    "hyperplanes": hyperplanes,
    "motoneurons": motoneurons,
    "softmax": softmax,
}
"""Initial policies by the name used in configurations and on the command line."""


def initial(name: str, task: Any, **settings: Any) -> Initial:
    """The initial policy called `name` for `task`; an unknown name is refused with the nearest one."""
    if name not in INITIAL:
        raise unknown("policy", name, INITIAL)
    return INITIAL[name](task, **settings)
