"""Several copies of a task stepped together, without a learner: the core of an environment."""

import functools
import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.error import ClosedEnvironmentError
from gymnasium.utils.seeding import np_random
from jaxtyping import Array, Float, PyTree

from motorgrad._arrays import AnyArray
from motorgrad._compiler import in_one_piece
from motorgrad._errors import check_integer
from motorgrad._packing import Packed, Packing, shared_memory
from motorgrad.bodies import BodyBatch
from motorgrad.tasks import BodyTask, Task
from motorgrad.worlds import World

Carry = tuple[PyTree, PyTree, Array]
"""The memory of a task, the state of its world, `()` for a body, and the decisions since the start of the episode."""


class Columns(NamedTuple):
    """Where things are in an outcome, a row of numbers: the observation is before `reward`. `metrics` has for each name
    the place of the value; 1 in the next one says that it occurred."""

    reward: int
    terminated: int
    truncated: int
    diverged: int
    metrics: dict[str, int]


class Functions(NamedTuple):
    """The compiled functions of a task, for many rows at once, which lead everywhere.

    `begin` and `again`, for the first and for further episodes, return the carry and the observation, new in the rows
    of a mask; `decide` returns the carry and the outcome. They use up the carry that they are given, which is packed;
    `blank` makes one for so many rows. `control` is the input of a body; `None` where that is the action itself.

    They read one array of `width` numbers a row: the packed row of a `BodyBatch`, from `action` on the action, and from
    `chance` on numbers from U[0, 1), of which an episode consumes `begins` and a decision `decides`. An outcome is a
    single vector, too (`columns`), because every array that crosses the border of compiled code costs time.
    """

    blank: Callable[[int], Packed]
    begin: Callable[[Packed, Array, np.ndarray], tuple[Packed, Array]]
    again: Callable[[Packed, Array, np.ndarray], tuple[Packed, Array]]
    decide: Callable[[Packed, Array], tuple[Packed, Array]]
    control: Callable[[Packed, Array], Array] | None
    action: int
    chance: int
    begins: int
    decides: int
    columns: Columns

    @property
    def width(self) -> int:
        return self.chance + max(self.begins, self.decides)


class Rows:
    """`count` copies of `task`, each with its own random generator, so that no row affects another's numbers.
    `decisions` counts those of each row's current episode."""

    def __init__(self, task: Task, count: int, threads: int = 1):
        check_integer("num_envs", count, 1)
        if not isinstance(task.dynamics, World) and not isinstance(task, BodyTask):
            raise ValueError(f"task = {task.name!r}: must be over a world or a body to become an environment")
        self.task, self.period = task, task.period
        self.generators = [np_random()[0] for _ in range(count)]
        self.decisions = np.zeros(count, np.int64)
        on_body = isinstance(task, BodyTask)
        self._body = task.batch(range(count), threads) if on_body else None
        self.activation = np.zeros((count, 0 if self._body is None else len(self._body.groups)))
        """The input of the simulations in the last decision, rows leading; zeros at the start of an episode."""
        self._every = np.ones(count, bool)
        self._functions = functions = functions_of(task)
        seen, self._seen = shared_memory(count, functions.width)
        self._dynamics = seen[:, : functions.action]
        self._action = seen[:, functions.action : functions.chance]
        self._chance = seen[:, functions.chance :]
        self.columns = functions.columns
        self._carry = functions.blank(count)
        self._begun = np.zeros(count, bool)
        self._closed = False

    @property
    def body(self) -> BodyBatch | None:
        """The simulations; `None` for a world. **Raises** `gymnasium.error.ClosedEnvironmentError` after `close`."""
        if self._closed:
            raise ClosedEnvironmentError("this environment is closed: make another one")
        return self._body

    def reset(self, mask: np.ndarray, anew: bool = False) -> np.ndarray:
        """Start new episodes in the rows of `mask`, and return the observations there. `anew` discards what the task's
        memory keeps from one episode to the next."""
        functions = self._functions
        body = self.body
        self._draw(functions.begins, mask)
        if body is not None:
            assert isinstance(self.task, BodyTask)
            body.reset(mask, **self.task.begin(self._chance[mask, : self.task.init_uniforms]))
            self.activation = np.where(mask[:, None], 0.0, self.activation)
            self._dynamics[...] = body.packed
        begin = functions.again if self._begun[mask].all() and not anew else functions.begin
        self._carry, observation = begin(self._carry, self._seen, mask)
        self._begun |= mask
        self.decisions[mask] = 0
        return np.array(observation, np.float32)[mask]  # also waits until what was seen has been read

    def step(self, action: np.ndarray, live: np.ndarray | None = None) -> Float[np.ndarray, "rows columns"]:
        """The outcomes of one decision in the rows of `live`, not to be written to. The others are ignored and must be
        reset; behind their observations are zeros. A diverged row is back at its start: it is truncated, its reward is
        0, and none of its metrics occurred."""
        body = self.body
        functions = self._functions
        self._action[...] = action.reshape(self._action.shape)
        if body is not None:
            control = functions.control
            self.activation = action if control is None else np.asarray(control(self._carry, self._seen))
            body.step(self.activation)
            self._dynamics[...] = body.packed
        if functions.decides:
            self._draw(functions.decides, self._every if live is None else live)
        self._carry, found = functions.decide(self._carry, self._seen)
        outcome = np.asarray(found)  # waits until what was seen has been read
        if live is None:
            self.decisions += 1
        else:
            self.decisions += live
            outcome = outcome.copy()
            outcome[~live, self.columns.reward :] = 0.0
        return outcome

    def close(self) -> None:
        """Release the simulations and their threads."""
        self._body = None
        self._carry = {}
        self._closed = True

    def _draw(self, size: int, mask: np.ndarray) -> None:
        """Draw numbers from U[0, 1) for the rows of `mask`; the others draw nothing."""
        if not size:
            return
        self._chance.fill(0.0)
        for row in np.flatnonzero(mask):
            self._chance[row, :size] = self.generators[row].random(size, np.float32)


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
    body = task.batch([0], threads=1) if isinstance(task, BodyTask) else None
    unpack = body.unpack if body else None
    reset, step = (world.reset_uniforms, world.uniforms) if world else (0, 0)
    begins = reset + task.init_uniforms + task.uniforms
    decides = step + task.uniforms
    discrete = task.actions == "discrete"
    first = body.packed.shape[1] if body else 0  # of the action
    last = first + (1 if discrete else task.action_size)

    def start(memory: Callable[[Array], PyTree], row: Array) -> tuple[Carry, Array]:
        fresh, init, sensing = jnp.split(row[last : last + begins], (reset, reset + task.init_uniforms))
        state = world.reset(fresh) if world else ()
        after, observation = task.sense(memory(init), unpack(row[:first]) if unpack else state, sensing)
        return (after, state, jnp.int32(0)), observation

    example = jax.eval_shape(lambda row: start(task.init, row)[0], jnp.zeros(last + begins, jnp.float32))
    packing = Packing(example, 1)

    def starting(memory: Callable[[Packed], Callable[[Array], PyTree]]) -> Any:
        def start_where(carry: Packed, row: Array, new: Array) -> tuple[Packed, Array]:
            after, observation = start(memory(carry), row)
            after = jax.tree.map(lambda fresh, old: jnp.where(new, fresh, old), packing.pack(after), carry)
            return after, observation

        return jax.jit(jax.vmap(start_where), donate_argnums=0)

    def action_of(row: Array) -> Array:
        return row[first].astype(jnp.int32) if discrete else row[first:last]

    def decide(carry: Packed, row: Array) -> tuple[Packed, Array]:
        memory, state, decisions = packing.unpack(carry)
        action = action_of(row)
        chance, sensing = jnp.split(row[last : last + decides], (step,))
        state = world.step(state, action, chance) if world else ()
        seen = unpack(row[:first]) if unpack else state
        memory, reward, terminated = task.reward(memory, seen, action)
        memory, observation = task.sense(memory, seen, sensing)
        metrics = task.metrics(memory, seen)
        diverged = row[first - 1] > 0 if body else jnp.array(False)
        good = ~diverged
        terminated = terminated & good
        decisions = decisions + 1
        cut = task.truncated(memory, seen)
        if task.episode_limit is not None:
            cut = cut | (decisions >= task.episode_limit)
        truncated = diverged | (cut & ~terminated)
        outcome = [jnp.where(good, reward, 0.0), terminated, truncated, diverged]
        for name in task.metric_names:
            value, occurred = metrics[name]
            outcome += [value, occurred & good]
        numbers = jnp.stack([jnp.asarray(part, float) for part in outcome])
        return packing.pack((memory, state, decisions)), jnp.concatenate([observation, numbers])

    own = False  # whether a body is moved by something else than the action itself

    def control(carry: Packed, row: Array) -> AnyArray:
        nonlocal own
        assert isinstance(task, BodyTask)
        action = action_of(row)
        found = task.control(action, packing.unpack(carry)[0])
        own = found is not action
        return found

    packed = jax.eval_shape(packing.pack, example)
    size = task.observation_code.size
    metrics = dict(zip(task.metric_names, itertools.count(size + 4, 2), strict=False))
    columns = Columns(size, size + 1, size + 2, size + 3, metrics)
    if body:
        jax.eval_shape(control, packed, jnp.zeros(last + begins, jnp.float32))
    return Functions(
        blank=lambda count: {name: jnp.zeros((count, *part.shape), part.dtype) for name, part in packed.items()},
        begin=starting(lambda carry: task.init),
        again=starting(lambda carry: functools.partial(task.renew, packing.unpack(carry)[0])),
        decide=in_one_piece(jax.vmap(decide)),
        control=jax.jit(jax.vmap(control)) if own else None,
        action=first,
        chance=last,
        begins=begins,
        decides=decides,
        columns=columns,
    )


_once = functools.lru_cache(maxsize=32)(_compile)
