"""What every engine of training is: something that can be advanced, saved and restored."""

import abc
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, PyTree

from motorgrad._errors import check
from motorgrad._random import key_of
from motorgrad.learning import Agent, AgentState, Episodic, Estimator, LinearCritic
from motorgrad.policies import Policy, trainable
from motorgrad.tasks import Task
from motorgrad.training._cycle import Cycle, CycleState, Mode

Look = Callable[[CycleState, Any], PyTree[Array]]
Record = dict[str, np.ndarray]
"""What happened since the last record, by name; every array has a leading axis of seeds."""


class Stepper(abc.ABC):
    """Many seeds of one agent on one task, in step.

    **Arguments:** the task; the agent; the seeds, distinct integers from 0 to 2³¹ − 1; `mode`, whether to learn, or to
    act by the frozen policies that `restore` or `use` brought in.

    Engines also take `initial`, the policies that the seeds begin from, along a leading axis; by default the agent's.
    """

    def __init__(self, task: Task, agent: Agent, seeds: Sequence[int], mode: Mode = "learn", diverges: bool = False):
        self.task = task
        self.seeds = np.asarray(seeds, np.int32)
        self.decision = 0
        self.cycle = Cycle(task, agent, mode, diverges)
        self.policy = jax.eval_shape(agent.init, jax.random.key(0)).policy
        """The shapes of one seed's policy."""
        validate(task, self.policy)
        if mode == "learn":
            validate_episodes(task, agent.estimator)

    def _fresh(self, seed: Array, own: Policy | None) -> AgentState:
        """One seed's learner before its first decision, which begins from its `own` policy where there is one."""
        agent = self.cycle.agent if own is None else dataclasses.replace(self.cycle.agent, policy=own)
        return agent.init(key_of(seed, "initial"))

    @abc.abstractmethod
    def advance(self, decisions: int) -> None:
        """Make so many decisions per seed."""

    @property
    @abc.abstractmethod
    def state(self) -> PyTree[np.ndarray]:
        """A copy of everything that the future depends on: `decision`, the number made, and arrays whose seeds lead."""

    @abc.abstractmethod
    def restore(self, state: PyTree[np.ndarray]) -> None:
        """Put back a `state`: what follows is then bit for bit what followed it."""

    @abc.abstractmethod
    def harvest(self) -> Record:
        """Take the tallies since the last harvest, and look at the learners."""

    @abc.abstractmethod
    def policies(self) -> Policy:
        """The present policies of all seeds, stacked along a leading axis."""

    @abc.abstractmethod
    def use(self, policies: Policy, memory: Any = None) -> None:
        """Put policies in place, stacked along a leading axis of seeds; and, before the first decision, the memory that
        the task had when they had been learnt, with which it goes on frozen."""

    @abc.abstractmethod
    def watch(self, look: Look) -> Callable[[], PyTree[np.ndarray]]:
        """A function that says what `look(cycle, state)` makes of every seed as it is now, copied, seeds leading.

        `look` is pure and compiled: it sees one seed's `CycleState` and the state of the dynamics that the task's
        functions see. Nothing is changed by it.
        """

    def _start_numbers(self, seed: Array) -> tuple[Array, Array]:
        """One seed's random numbers for the memory and the observation before its first decision."""
        sizes = (("start-memory", self.task.init_uniforms), ("start-look", self.task.uniforms))
        memory, look = (jax.random.uniform(key_of(seed, name), (size,)) for name, size in sizes)
        return memory, look

    def _look(self, state: CycleState) -> tuple[CycleState, dict[str, Array]]:
        """One seed's tallies and the learner's visible state; the tallies begin anew."""
        agent, tally = state.agent, state.tally
        look = self.cycle.read(tally)
        look["baseline"] = self.cycle.agent.estimator.baseline.value(agent.baseline)
        if agent.growth is not None:
            look["units"] = jnp.sum(agent.policy.active)  # type: ignore[attr-defined]
        look["parameters"] = ravel_pytree(trainable(agent.policy))[0]
        return state._replace(tally=jax.tree.map(jnp.zeros_like, tally)), look


def validate(task: Task, policy: Policy) -> None:
    """Refuse a policy that does not fit the task, before any work."""
    for name, has, wants in (
        ("inputs", policy.inputs, task.observation_size),
        ("outputs", policy.outputs, task.action_size),
    ):
        if has != wants:
            raise ValueError(
                f"policy {type(policy).__name__}: {name} = {has}, but the task {task.name!r} has "
                f"{wants} {'observed numbers' if name == 'inputs' else 'actions'}"
            )
    if policy.actions not in task.accepted_actions:
        takes = " or ".join(task.accepted_actions)
        raise ValueError(
            f"policy {type(policy).__name__}: {policy.actions} actions, but the task {task.name!r} takes {takes}"
        )


def validate_episodes(task: Task, estimator: Estimator) -> None:
    """Refuse an estimator that waits for the ends of episodes on a task that has none."""
    critic = estimator.baseline
    whole = isinstance(critic, LinearCritic) and (critic.discount == 1 or critic.ahead * critic.decay == 1)
    needs = {
        "trace = Episodic()": isinstance(estimator.trace, Episodic),
        "improve = 'episode'": estimator.improve == "episode",
        f"discount = {estimator.discount}": estimator.discount is not None,
        "critic: discount = 1, or decay = 1 for the average reward": whole,
    }
    for setting, needed in needs.items():
        if needed and not task.has_episodes:
            raise ValueError(f"{setting}: needs episodes, but the task {task.name!r} has none; give it a time limit")


def fits(state: PyTree[np.ndarray], template: PyTree[np.ndarray]) -> None:
    """Refuse a state of another structure, or of other shapes, than `template`'s."""
    places = [jax.tree_util.tree_leaves_with_path(tree) for tree in (state, template)]
    names = [[jax.tree_util.keystr(place) for place, _ in leaves] for leaves in places]
    check(names[0] == names[1], "state", sorted(set(names[0]) ^ set(names[1])), "of the same learner and task")
    for name, (_, leaf), (_, own) in zip(names[0], *places, strict=True):
        check(np.shape(leaf) == np.shape(own), f"state{name}.shape", np.shape(leaf), f"{np.shape(own)}")


def seeds_first(tree: Any, axes: Any = -1) -> Any:
    """Move the axis of seeds to the front, as copies in NumPy; `axes`, where it is, of all or by part."""

    def move(axis: int, part: Any) -> Any:
        return jax.tree.map(lambda x: np.array(np.moveaxis(np.asarray(x), axis, 0), order="C"), part)

    return jax.tree.map(move, axes, tree)


def seeds_last(tree: Any, axes: Any = -1) -> Any:
    """The inverse of `seeds_first`, as JAX arrays."""

    def move(axis: int, part: Any) -> Any:
        return jax.tree.map(lambda x: jnp.asarray(np.moveaxis(np.asarray(x), 0, axis).copy()), part)

    return jax.tree.map(move, axes, tree)
