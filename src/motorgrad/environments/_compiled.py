"""A task's functions for many rows at once, compiled: what one decision of an environment calls."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.tasks import BodyTask, Task
from motorgrad.worlds import World


class Compiled(NamedTuple):
    """`begin(packed, numbers)` and `again(carry, packed, numbers)`, for a first and a further episode, give the carry
    and the observation; `decide(carry, packed, action, numbers)` gives the carry and the outcome.

    Rows lead everywhere. `carry` is the task's memory and a world's state; `packed` the rows of a `BodyBatch`, of no
    width for a world. `begins` and `decides` say how many numbers from U[0, 1) a row consumes. An outcome is one
    vector, since every array at the border of compiled code costs time: the observation, the reward, `terminated`,
    `truncated` by the dynamics themselves, and of each reading the value and whether it occurred.
    """

    begin: Callable[..., Any]
    again: Callable[..., Any]
    decide: Callable[..., Any]
    begins: int
    decides: int


def compiled(task: Task) -> Compiled:
    """The functions of `task`, made once for all environments of equal tasks."""
    try:
        hash(task)
    except TypeError:  # a task that holds an array
        return _compile(task)
    return _once(task)


def _compile(task: Task) -> Compiled:
    dynamics = task.dynamics
    world = dynamics if isinstance(dynamics, World) else None
    # a batch of its own: the functions outlive the environment, whose threads must go with it
    unpack = task.batch([0], threads=1).unpack if isinstance(task, BodyTask) else None
    reset, step = (world.reset_uniforms, world.uniforms) if world else (0, 0)

    def start(memory: Callable[[Any], Any], packed: Any, numbers: Any) -> Any:
        fresh, init, look = jnp.split(numbers, (reset, reset + task.init_uniforms))
        state = world.reset(fresh) if world else ()
        after, observation = task.observe(memory(init), unpack(packed) if unpack else state, look)
        return (after, state), observation

    def begin(packed: Any, numbers: Any) -> Any:
        return start(task.init, packed, numbers)

    def again(carry: Any, packed: Any, numbers: Any) -> Any:
        return start(lambda init: task.renew(carry[0], init), packed, numbers)

    def decide(carry: Any, packed: Any, action: Any, numbers: Any) -> Any:
        memory, state = carry
        chance, look = jnp.split(numbers, (step,))
        state = world.step(state, action, chance) if world else ()
        seen = unpack(packed) if unpack else state
        memory, reward, terminated = task.reward(memory, seen, action)
        memory, observation = task.observe(memory, seen, look)
        readings = task.readings(memory, seen)
        numbers = [
            reward,
            terminated,
            task.truncated(memory, seen),
            *(part for name in task.reports for part in readings[name]),
        ]
        return (memory, state), jnp.concatenate([observation, jnp.stack([jnp.asarray(n, float) for n in numbers])])

    return Compiled(
        jax.jit(jax.vmap(begin)),
        jax.jit(jax.vmap(again)),
        jax.jit(jax.vmap(decide)),
        reset + task.init_uniforms + task.uniforms,
        step + task.uniforms,
    )


_once = functools.lru_cache(maxsize=32)(_compile)


def choose(mask: np.ndarray, new: Any, old: Any) -> Any:
    """`new` in the rows of `mask`, `old` elsewhere."""

    def pick(a: Any, b: Any) -> np.ndarray:
        a, b = np.asarray(a), np.asarray(b)
        return np.where(mask.reshape((-1,) + (1,) * (a.ndim - 1)), a, b)

    return new if mask.all() else jax.tree.map(pick, new, old)
