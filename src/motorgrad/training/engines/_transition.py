"""What one decision of one seed was, for those who record all of them: where it began, what it did, where it led."""

from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, PyTree

from motorgrad._arrays import AnyArray
from motorgrad._packing import Packed
from motorgrad.policies import abilities
from motorgrad.tasks import Outcome, Task, outcome
from motorgrad.training.engines._cycle import CycleState
from motorgrad.worlds import World

Transition = dict[str, Array]
Watcher = Callable[[dict[str, np.ndarray]], None]
"""Called with some decisions of all seeds, in the order in which they are made: `(decisions, seeds, …)` by name."""


def raw_names(task: Task) -> tuple[str, ...]:
    """The names of raw observations, where they differ from what the policy sees and are known at any moment; else
    none."""
    if type(task).sense is Task.sense or task.uniforms:
        return ()
    code = task.interface().observations
    return code.names if code.scales else ()


def transition(task: Task, cycle: CycleState, before: PyTree, after: PyTree, led: Outcome) -> Transition:
    """A decision by name: the `cycle` with the action chosen, the dynamics `before` and `after` it, and what it `led`
    to. Names that begin with "end" are of the moment after it, before any new episode."""
    agent = cycle.agent
    policy = agent.policy
    metrics = task.metrics(led.memory, after)
    terms = task.reward_terms(led.memory, after)
    reported = [metrics[name] for name in task.metric_names]
    nothing = jnp.full((), jnp.nan)
    found = {
        "input": cycle.observation,
        "end input": led.observation,
        "action": cycle.action,
        "reward": jnp.asarray(led.reward, jnp.result_type(float)),
        "terms": _row([terms[name] for name in task.reward_names]),
        "metrics": _row([jnp.where(happened, value, nothing) for value, happened in reported]),
        "terminated": jnp.asarray(led.terminated, bool),
        "truncated": jnp.asarray(led.truncated, bool),
        "marks": jnp.ravel(task.marks(cycle.memory, before).T[:3].T),
        "end marks": jnp.ravel(task.marks(led.memory, after).T[:3].T),
    }
    if raw_names(task):
        nobody = jnp.zeros(0)
        found["observation"] = task.sense(cycle.memory, before, nobody)[1]
        found["end observation"] = task.sense(led.memory, after, nobody)[1]
    if abilities.has_memory(policy):  # what the units see also holds what the policy remembers
        found["seen"] = agent.decision.observation
        found["end seen"] = abilities.observation_with_memory(policy, agent.memory, led.observation)
    if isinstance(task.dynamics, World):
        found["state"], found["end state"] = (_numbers(state) for state in (before, after))
    return found


def transition_of_rows(
    task: Task, unpack: Callable[[Packed], CycleState], unpack_row: Callable[[Array], PyTree], sizes: Mapping[str, int]
) -> Callable[[Packed, AnyArray, AnyArray], Transition]:
    """The function from all cycles, packed, the rows of the dynamics before a decision, and those after it with random
    numbers of these `sizes` behind, to what the decisions were."""

    def one(packed: Packed, before: Array, row: Array) -> Transition:
        width = len(before)
        cycle = unpack(packed)
        uniforms = dict(zip(sizes, jnp.split(row[width:], np.cumsum([*sizes.values()])), strict=False))
        after = unpack_row(row[:width])
        led = outcome(task, cycle.memory, after, cycle.action, uniforms["observe"], cycle.elapsed)
        return transition(task, cycle, unpack_row(before), after, led) | {"diverged": row[width - 1] > 0}

    return jax.jit(jax.vmap(one))


def state_names(task: Task) -> list[str]:
    """The names of the numbers of a world's state, in the order of `transition`; none for other dynamics."""
    world = task.dynamics
    if not isinstance(world, World):
        return []
    state = jax.eval_shape(world.reset, jax.ShapeDtypeStruct((world.reset_uniforms,), jnp.float32))
    names: list[str] = []
    for path, leaf in jax.tree_util.tree_leaves_with_path(state):
        name = jax.tree_util.keystr(path, simple=True, separator=" ") or "number"
        names += [name] if leaf.size == 1 else [f"{name} {k + 1}" for k in range(leaf.size)]
    return names


def _row(values: list[Array]) -> Array:
    return jnp.stack(values) if values else jnp.zeros(0)


def _numbers(state: PyTree) -> Array:
    return jnp.asarray(ravel_pytree(state)[0], jnp.result_type(float))
