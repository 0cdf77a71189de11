"""The interface of every engine of training: it can be advanced, saved and restored."""

import abc
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check, unknown
from motorgrad._interface import Statistics
from motorgrad._random import key_of
from motorgrad.learning import Learner, check_scores
from motorgrad.policies import Policy, trainable
from motorgrad.schema import check_rounded, declared_at, with_number
from motorgrad.tasks import Task
from motorgrad.training.engines._cycle import Cycle, CycleState, Mode

View = Callable[[CycleState, Any], PyTree[Array]]
Record = dict[str, np.ndarray]
"""What happened since the last record, by name; every array has a leading axis of seeds."""


def mean_reward(record: Record, decisions: int) -> Float[np.ndarray, " seeds"]:
    """The mean reward of a record's `decisions`, without diverged ones; NaN where all did."""
    kept = decisions - np.asarray(record.get("diverged", 0), np.int64)
    return np.where(kept > 0, record["reward"] / np.maximum(kept, 1), np.nan)


def without_broken(record: Record) -> Record:
    """A record in which reward and metrics of policies that are not finite are NaN: what such a policy does is an
    accident of the compiler, and often looks good."""
    broken = ~np.isfinite(record["parameters"]).all(axis=1)
    earned = [name for name in record if name == "reward" or f"{name}_count" in record]
    return record | {name: np.where(broken, np.nan, record[name]) for name in earned} if broken.any() else record


class Program:
    """The compiled functions of an engine. It has no state, so engines of the same structure share one. Of the agent
    only the structure matters; `diverges` says whether the dynamics can."""

    def __init__(
        self, task: Task, agent: Learner, mode: Mode = "learn", diverges: bool = False, first_episode: bool = False
    ):
        self.task = task
        self.cycle = Cycle(task, agent, mode, diverges, first_episode)
        self.policy = jax.eval_shape(agent.init, jax.random.key(0)).policy
        """The shapes of one seed's policy."""

    def fresh(self, seed: Array, numbers: Array, initial: Policy | None) -> Any:
        """One seed's learner before its first decision, from its `initial` policy where there is one."""
        agent = self.cycle.agent.with_numbers(self.cycle.numbers, numbers)
        agent = agent if initial is None else agent.with_policy(initial)
        state = self.cycle.acting(agent).init(key_of(seed, "initial"))
        # The loop returns strong types. After weak ones, as of `jnp.full(3, 0.5)`, it would be compiled a second time.
        return jax.tree.map(lambda leaf: jnp.asarray(leaf, leaf.dtype), state)

    def start_numbers(self, seed: Array, environment: int = 0) -> tuple[Array, Array]:
        """One seed's random numbers for the memory and the observation before its first decision, by `environment`
        where it has several."""
        name = f"start-look-{environment}" if environment else "start-look"
        return self.start_memory(seed, environment), jax.random.uniform(key_of(seed, name), (self.task.uniforms,))

    def start_memory(self, seed: Array, environment: int = 0) -> Array:
        """One seed's random numbers for the start of its first episode, by `environment` where it has several."""
        name = f"start-memory-{environment}" if environment else "start-memory"
        return jax.random.uniform(key_of(seed, name), (self.task.init_uniforms,))

    def summarize(self, state: CycleState) -> tuple[CycleState, dict[str, Array]]:
        """One seed's tallies and the visible state of its learner; the tallies begin anew."""
        agent, tally = state.agent, state.tally
        found = self.cycle.read_tally(tally)
        found |= self.cycle.learner(state).readings(agent)
        found["parameters"] = ravel_pytree(trainable(agent.policy))[0]
        return state._replace(tally=jax.tree.map(jnp.zeros_like, tally)), found


class Stepper(abc.ABC):
    """Many seeds of one learner on one task, in step.

    **Arguments:** `task` and `agent`; the `seeds`, integers from 0 to 2³¹ − 1, which may occur more than once, with
    other numbers; the `mode`: to learn, to act by the frozen policies that `set_policies` brings in, or to take the
    actions of `set_actions`; the `initial` policies, and the `numbers`, the hyperparameters by path, of every seed,
    along a leading axis, by default the agent's.
    """

    def __init__(
        self,
        task: Task,
        agent: Learner,
        seeds: Sequence[int],
        mode: Mode = "learn",
        initial: Policy | None = None,
        numbers: Mapping[str, Any] | None = None,
    ):
        self.task, self.agent = task, agent
        self.seeds = np.asarray(seeds, np.int32)
        self.decision = 0
        self.mode: Mode = mode
        self.policy = jax.eval_shape(agent.init, jax.random.key(0)).policy
        """The shapes of one seed's policy."""
        validate(task, self.policy)
        if mode == "learn":
            validate_needs(task, agent)
            check_scores(agent, self.policy)
        if initial is None and isinstance(agent.policy, Policy):
            initial = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (len(self.seeds), *leaf.shape)), agent.policy)
        if initial is not None:
            check_carries(task, initial)
        self._initial = initial
        self._start_vector = self._vectors(numbers or {})

    @property
    def start_statistics(self) -> Statistics | None:
        """The running statistics of observations with which the seeds begin, seeds leading; `None` without any."""
        return statistics_of(self._initial)

    def _vectors(self, numbers: Mapping[str, Any]) -> Float[np.ndarray, "seeds numbers"]:
        """The hyperparameters of all seeds, one row each, with those given by path in place of the agent's."""
        order = Cycle(self.task, self.agent).numbers
        rows = np.tile(order.vector(self.agent.hyperparameters, self.agent.precision), (len(self.seeds), 1))
        for path, values in numbers.items():
            if path not in order.paths:
                raise unknown("number", path, order.paths)
            for value in np.unique(np.asarray(values)):
                changed = with_number(self.agent, path, float(value))
                validate_needs(self.task, check_rounded(changed, changed.precision))
            rows[:, order.places[path]] = values
        return rows

    @abc.abstractmethod
    def advance(self, decisions: int) -> None:
        """Make this number of decisions per seed, at most `MAX_TALLY_DECISIONS` from one harvest to the next."""

    @property
    @abc.abstractmethod
    def state(self) -> PyTree[np.ndarray]:
        """A copy of everything that the future depends on: `decision`, the number made, and arrays whose seeds lead."""

    @abc.abstractmethod
    def restore(self, state: PyTree[np.ndarray]) -> None:
        """Restore a `state`: what follows is then bit for bit what followed it."""

    @abc.abstractmethod
    def harvest(self) -> Record:
        """The tallies since the last harvest, and the visible state of the learners."""

    @abc.abstractmethod
    def policies(self) -> Policy:
        """The present policies of all seeds, stacked along a leading axis."""

    @abc.abstractmethod
    def set_policies(self, policies: Policy, memory: PyTree = None) -> None:
        """Put policies in place, stacked along a leading axis of seeds; and, before the first decision, the memory that
        the task had when they had been learned, with which it continues frozen."""

    @abc.abstractmethod
    def set_actions(self, actions: np.ndarray) -> None:
        """In the mode `"given"`: the actions of all seeds, `(seeds, …)`, until others are given."""

    @abc.abstractmethod
    def viewer(self, view: View) -> Callable[[], PyTree[np.ndarray]]:
        """A function that returns `view(cycle, state)` of every seed as it is now, copied, seeds leading. `view` is
        pure and compiled: it sees one seed's `CycleState` and the state of the dynamics that the task's functions see.
        It changes nothing."""

    def set_number(self, path: str, value: float) -> None:
        """Change a hyperparameter of all seeds from the next decision on. Nothing is compiled. **Raises** `ValueError`
        for an unknown path, a value out of range, or a number that is used only at the start."""
        places = Cycle(self.task, self.agent).numbers.places
        if path not in places:
            raise unknown("number", path, places)
        agent = with_number(self.agent, path, value)
        if not declared_at(self.agent, path).live:
            raise ValueError(f"{path} is used only at the start of a run; start a new run to change it")
        validate_needs(self.task, check_rounded(agent, agent.precision))
        self.agent = agent
        self._put_number(places[path], value)

    @abc.abstractmethod
    def _put_number(self, place: int, value: float) -> None:
        """Put a number in its place among the hyperparameters of all seeds."""


def check_carries(task: Task, policy: Policy, where: str = "policy") -> None:
    """Refuse a policy whose observations or actions, as far as it knows them, mean something else on the task."""
    if policy.interface is not None:
        kind = policy.interface.actions.kind
        own = task.interface(kind if kind in task.accepted_actions else None)  # type: ignore[arg-type]
        own.check_carries(policy.interface, f"{where}, on the task {task.name!r}")


def statistics_of(policy: Policy | None) -> Statistics | None:
    """The running statistics of observations that a policy carries; `None` without any."""
    return None if policy is None or policy.interface is None else policy.interface.statistics


def validate(task: Task, policy: Policy) -> None:
    """Refuse a policy that does not fit the task."""
    inputs = ("inputs", policy.observation_size, task.observation_size, "observed numbers")
    outputs = ("outputs", policy.outputs, task.action_size, "actions")
    kind = f"policy {type(policy).__name__}"
    for name, has, wants, what in (inputs, outputs):
        if has != wants:
            raise ValueError(f"{kind}: {name} = {has}, but the task {task.name!r} has {wants} {what}")
    if policy.actions not in task.accepted_actions:
        takes = " or ".join(map(_actions_in_words, task.accepted_actions))
        has = _actions_in_words(policy.actions)
        raise ValueError(f"{kind}: {has} actions, but the task {task.name!r} takes {takes}")


def _actions_in_words(actions: str | tuple[str, ...]) -> str:
    """A kind of actions in words, such as "binary" or "2 binary, 3 continuous"."""
    if isinstance(actions, str):
        return actions
    return ", ".join(f"{len(list(run))} {kind}" for kind, run in itertools.groupby(actions))


def validate_needs(task: Task, agent: Learner) -> None:
    """Refuse a learner that needs episodes, or a goal, on a task that has none."""
    needs = agent.needs
    for setting in () if task.has_episodes else needs.episodes:
        raise ValueError(f"{setting}: needs episodes, but the task {task.name!r} has none; give it a time limit")
    if needs.goal is not None and task.goal is None:
        has = "a composed task has one with one target that stays, its error observed, and a reward of its distance"
        raise ValueError(f"{needs.goal}: needs a goal, but the task {task.name!r} has none; {has}")


def fits(state: PyTree[np.ndarray], template: PyTree[np.ndarray]) -> None:
    """Refuse a state of another structure, or of other shapes, than `template`'s."""
    places = [jax.tree_util.tree_leaves_with_path(tree) for tree in (state, template)]
    names = [[jax.tree_util.keystr(place) for place, _ in leaves] for leaves in places]
    check(names[0] == names[1], "state", sorted(set(names[0]) ^ set(names[1])), "of the same learner and task")
    for name, (_, leaf), (_, own) in zip(names[0], *places, strict=True):
        check(np.shape(leaf) == np.shape(own), f"state{name}.shape", np.shape(leaf), f"{np.shape(own)}")


def seeds_first(tree: PyTree, axes: PyTree = -1) -> Any:
    """Move the axis of seeds to the front, as copies in NumPy; `axes`, where it is, of all or by part."""

    def move(axis: int, part: PyTree) -> Any:
        return jax.tree.map(lambda x: np.array(np.moveaxis(np.asarray(x), axis, 0), order="C"), part)

    return jax.tree.map(move, axes, tree)


def seeds_last(tree: PyTree, axes: PyTree = -1) -> Any:
    """The inverse of `seeds_first`, as JAX arrays."""

    def move(axis: int, part: PyTree) -> Any:
        return jax.tree.map(lambda x: jnp.asarray(np.moveaxis(np.asarray(x), 0, axis).copy()), part)

    return jax.tree.map(move, axes, tree)
