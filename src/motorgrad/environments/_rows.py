"""Several copies of a task stepped together, without a learner: the core of an environment."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from gymnasium.error import ClosedEnvironmentError
from gymnasium.utils.seeding import np_random
from jaxtyping import Array, PyTree

from motorgrad._arrays import AnyArray
from motorgrad._errors import check_integer
from motorgrad.bodies import BodyBatch
from motorgrad.tasks import BodyTask, Task
from motorgrad.worlds import World

Carry = tuple[PyTree, PyTree]
"""The memory of a task, and the state of its world, `()` for a body."""


class Functions(NamedTuple):
    """The compiled functions of a task, for many rows at once, which lead everywhere.

    `begin` and `again`, for the first and for further episodes, return the carry and the observation; `decide` returns
    the carry and the outcome. `begins` and `decides` say how many numbers from U[0, 1) a row consumes. `packed` holds
    the rows of a `BodyBatch`, with width 0 for a world. An outcome is a single vector, because every array that crosses
    the border of compiled code costs time: observation, reward, `terminated`, `truncated` by the dynamics themselves,
    and for each metric the value and whether it occurred.
    """

    begin: Callable[[AnyArray, AnyArray], tuple[Carry, Array]]
    again: Callable[[Carry, AnyArray, AnyArray], tuple[Carry, Array]]
    decide: Callable[[Carry, AnyArray, AnyArray, AnyArray], tuple[Carry, Array]]
    begins: int
    decides: int


class Outcome(NamedTuple):
    """The result of a decision, rows leading. `metrics` has for each name the values and whether each occurred."""

    observation: np.ndarray
    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    diverged: np.ndarray
    metrics: dict[str, tuple[np.ndarray, np.ndarray]]


class Rows:
    """`count` copies of `task`, each with its own random generator, so that no row affects another's numbers.
    `decisions` counts those of each row's current episode."""

    def __init__(self, task: Task, count: int, threads: int = 1):
        check_integer("num_envs", count, 1)
        if not isinstance(task.dynamics, World) and not isinstance(task, BodyTask):
            raise ValueError(f"task = {task.name!r}: must be over a world or a body to become an environment")
        self.task, self.period = task, task.period
        self._size, self._limit = task.observation_code.size, task.episode_limit
        self.generators = [np_random()[0] for _ in range(count)]
        self.decisions = np.zeros(count, np.int64)
        on_body = isinstance(task, BodyTask)
        self._body = task.batch(range(count), threads) if on_body else None
        self.activation = np.zeros((count, 0 if self._body is None else len(self._body.groups)))
        """The input of the simulations in the last decision, rows leading; zeros at the start of an episode."""
        self._packed = np.zeros((count, 0), np.float32) if self._body is None else self._body.packed
        self._every = np.ones(count, bool)
        self._nothing = np.zeros((count, 0), np.float32)
        self._functions = functions_of(task)
        self._carry: Any = None  # a `Carry` once an episode has begun
        self._closed = False

    @property
    def body(self) -> BodyBatch | None:
        """The simulations; `None` for a world. **Raises** `gymnasium.error.ClosedEnvironmentError` after `close`."""
        if self._closed:
            raise ClosedEnvironmentError("this environment is closed: make another one")
        return self._body

    def reset(self, mask: np.ndarray, anew: bool = False) -> np.ndarray:
        """Start new episodes in the rows of `mask` (all of them the first time), and return the observations there.
        `anew` discards what the task's memory keeps from one episode to the next."""
        functions = self._functions
        numbers = self._draw(self._functions.begins, mask)
        if self.body is not None:
            assert isinstance(self.task, BodyTask)
            self.body.reset(mask, **self.task.begin(numbers[mask, : self.task.init_uniforms]))
            self.activation = np.where(mask[:, None], 0.0, self.activation)
        if anew or self._carry is None:
            carry, observation = functions.begin(self._packed, numbers)
        else:
            carry, observation = functions.again(self._carry, self._packed, numbers)
        observation = np.array(observation, np.float32)  # also waits until `packed` has been read
        self._carry = select_rows(mask, carry, self._carry)
        self.decisions[mask] = 0
        return observation[mask]

    def step(self, action: np.ndarray, live: np.ndarray | None = None) -> Outcome:
        """One decision in the rows of `live`. The others are ignored and must be reset. A diverged row is back at its
        start: it is truncated, its reward is 0, and none of its metrics occurred."""
        body, size, limit = self.body, self._size, self._limit
        if body is None:
            diverged = np.zeros(len(action), bool)
        else:
            assert isinstance(self.task, BodyTask)
            self.activation = np.asarray(self.task.control(action, self._carry[0]))
            body.step(self.activation)
            diverged = body.packed[:, -1] > 0
        numbers = self._draw(self._functions.decides, self._every if live is None else live)
        self._carry, outcome = self._functions.decide(self._carry, self._packed, action, numbers)
        outcome = np.array(outcome, float)  # waits until `packed` and `action` have been read
        good = ~diverged
        if live is not None:
            diverged = diverged & live
            good = good & live
        self.decisions += 1 if live is None else live
        terminated = (outcome[:, size + 1] > 0) & good
        cut = outcome[:, size + 2] > 0
        if limit is not None:
            cut |= self.decisions >= limit
        truncated = diverged | (cut & good & ~terminated)
        metrics = {
            name: (outcome[:, first], (outcome[:, first + 1] > 0) & good)
            for first, name in zip(range(size + 3, outcome.shape[1], 2), self.task.metric_names, strict=True)
        }
        observation = np.array(outcome[:, :size], np.float32)
        return Outcome(observation, np.where(good, outcome[:, size], 0.0), terminated, truncated, diverged, metrics)

    def close(self) -> None:
        """Release the simulations and their threads."""
        self._body = None
        self._packed = np.zeros((0, 0))
        self._carry = None
        self._closed = True

    def _draw(self, size: int, mask: np.ndarray) -> np.ndarray:
        """Draw numbers from U[0, 1) for the rows of `mask`; the others draw nothing."""
        if not size:
            return self._nothing
        drawn = np.zeros((len(mask), size), np.float32)
        for row in np.flatnonzero(mask):
            drawn[row] = self.generators[row].random(size, np.float32)
        return drawn


def functions_of(task: Task) -> Functions:
    """The functions of `task`, compiled once for all environments of equal tasks."""
    try:
        hash(task)
    except TypeError:  # a task that holds an array
        return _compile(task)
    return _once(task)


def _compile(task: Task) -> Functions:
    dynamics = task.dynamics
    world = dynamics if isinstance(dynamics, World) else None
    # a separate batch, because the functions outlive the environment, and its threads must not
    unpack = task.batch([0], threads=1).unpack if isinstance(task, BodyTask) else None
    reset, step = (world.reset_uniforms, world.uniforms) if world else (0, 0)

    def start(memory: Callable[[Array], PyTree], packed: Array, numbers: Array) -> tuple[Carry, Array]:
        fresh, init, sensing = jnp.split(numbers, (reset, reset + task.init_uniforms))
        state = world.reset(fresh) if world else ()
        after, observation = task.sense(memory(init), unpack(packed) if unpack else state, sensing)
        return (after, state), observation

    def begin(packed: Array, numbers: Array) -> tuple[Carry, Array]:
        return start(task.init, packed, numbers)

    def again(carry: Carry, packed: Array, numbers: Array) -> tuple[Carry, Array]:
        return start(lambda init: task.renew(carry[0], init), packed, numbers)

    def decide(carry: Carry, packed: Array, action: Array, numbers: Array) -> tuple[Carry, Array]:
        memory, state = carry
        chance, sensing = jnp.split(numbers, (step,))
        state = world.step(state, action, chance) if world else ()
        seen = unpack(packed) if unpack else state
        memory, reward, terminated = task.reward(memory, seen, action)
        memory, observation = task.sense(memory, seen, sensing)
        metrics = task.metrics(memory, seen)
        outcome = [reward, terminated, task.truncated(memory, seen)]
        outcome += [part for name in task.metric_names for part in metrics[name]]
        numbers = jnp.stack([jnp.asarray(part, float) for part in outcome])
        return (memory, state), jnp.concatenate([observation, numbers])

    first, further, decision = (jax.jit(jax.vmap(each)) for each in (begin, again, decide))
    return Functions(first, further, decision, reset + task.init_uniforms + task.uniforms, step + task.uniforms)


_once = functools.lru_cache(maxsize=32)(_compile)


def select_rows(mask: np.ndarray, new: PyTree[AnyArray], old: PyTree[AnyArray]) -> PyTree[AnyArray]:
    """`new` in the rows of `mask`, `old` elsewhere."""

    def pick(a: npt.ArrayLike, b: npt.ArrayLike) -> np.ndarray:
        a = np.asarray(a)
        b = np.asarray(b)
        return np.where(mask.reshape((-1,) + (1,) * (a.ndim - 1)), a, b)

    return new if mask.all() else jax.tree.map(pick, new, old)
