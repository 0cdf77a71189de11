"""What policies are given: the sizes of a new one, and the observations of one that acts."""

import functools
from collections.abc import Callable
from typing import Any, Protocol

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array
from numpy.typing import ArrayLike

from motorgrad._errors import check, counted, shown
from motorgrad.policies import abilities


class SizedTask(Protocol):
    """A task, of which a policy needs to know how many numbers it shows, and how many actions it takes."""

    @property
    def observation_size(self) -> int: ...
    @property
    def action_size(self) -> int: ...


SEE = ("prob", "sample", "mode", "log_prob", "score", "entropy", "hidden_activations")
"""The methods of a policy whose first argument is what its units see."""


def check_arguments(kind: type) -> None:
    """Let the methods that a class of policies defines take lists as well as arrays, and refuse observations and
    uniform numbers of another size. Shapes are static, so that compiled calls do not pay for it."""
    for name in SEE:
        if name in kind.__dict__:
            setattr(kind, name, _seeing(kind.__dict__[name]))
    if "observation_with_memory" in kind.__dict__:
        setattr(kind, "observation_with_memory", _remembering(kind.__dict__["observation_with_memory"]))  # noqa: B010


def _seeing(method: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(method)
    def checked(self: Any, observation: ArrayLike, *others: ArrayLike, **named: ArrayLike) -> Any:
        observation = _vector("observation", observation, self.inputs, functools.partial(_seen, self))
        if method.__name__ == "sample":
            for uniforms in (*others, *named.values()):
                _vector("uniforms", uniforms, self.uniforms, lambda: "drawn from U[0, 1)")
        given = {name: _array(value) for name, value in named.items()}
        return method(self, observation, *map(_array, others), **given)

    return checked


def _remembering(method: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(method)
    def checked(self: Any, memory: Array | None, observation: ArrayLike) -> Any:
        return method(self, memory, _vector("observation", observation, self.observation_size, lambda: _OBSERVED))

    return checked


_OBSERVED = "what the task shows"


def _seen(policy: Any) -> str:
    """What the units of a policy see, in words."""
    if not abilities.has_memory(policy):
        return f"{_OBSERVED}; batches need jax.vmap"
    remembered = policy.inputs - policy.observation_size
    source = "policy.observation_with_memory(memory, observation)"
    return f"{policy.observation_size} observed and {remembered} remembered, from {source}"


def _array(value: ArrayLike) -> Array:
    return value if isinstance(value, jax.Array) else jnp.asarray(value)


def _vector(name: str, value: ArrayLike, size: int, meaning: Callable[[], str]) -> Array:
    """A value as an array of `size` real numbers; an error that shows the value, or the shape of a long array, if it is
    something else."""
    try:
        array = _array(value)
    except (TypeError, ValueError):
        array = None
    if array is None or array.shape != (size,):
        if array is not None and (array.size > 8 or isinstance(array, Tracer)):
            given = f"an array of shape {array.shape}"
        else:
            given = " ".join(str(value).split()) if eqx.is_array(value) else shown(value)
        raise ValueError(f"{name} = {given}: must be {counted(size, 'number')}, {meaning()}")
    return array if eqx.is_inexact_array(array) else array.astype(jnp.result_type(float))


def sizes(task: SizedTask | int, outputs: int | None) -> tuple[int, int]:
    """The numbers of inputs and outputs of a policy for a task, for functions that return an initial policy.

    **Arguments:**

    - `task`: a task, or anything with `observation_size` and `action_size`; or a number of inputs.
    - `outputs`: the number of units, or of alternatives; by default one for each action of the task.

    **Returns:** both numbers.

    **Raises:** `ValueError` for what is neither, and where `outputs` is `None` without a task.
    """
    check(not isinstance(task, type), "task", task, "a task, such as motorgrad.make('hopper'), or a number")
    try:
        inputs, actions = (task, None) if isinstance(task, int) else (task.observation_size, task.action_size)
    except AttributeError as error:
        words = "must be a task, such as motorgrad.make('hopper'), or a number"
        raise ValueError(f"task = {shown(task)}: {words}; {error}") from error
    outputs = actions if outputs is None else outputs
    check(inputs > 0, "inputs", inputs, "a positive number of inputs")
    check(outputs is not None and outputs > 0, "outputs", outputs, "a positive number of units or actions")
    return inputs, int(outputs or 0)


def python_numbers(values: ArrayLike) -> Any:
    """Whole numbers as Python integers, so that `describe` can store them; others stay, to be refused."""
    found = np.ravel(np.asarray(values)).tolist()
    return tuple(int(n) if isinstance(n, int | float) and float(n).is_integer() else n for n in found)
