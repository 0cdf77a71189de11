"""The task interface: observations, rewards and ends of episodes, as pure functions over dynamics."""

import abc
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._errors import check
from motorgrad._goal import Goal
from motorgrad._interface import ActionCode, Interface, ObservationCode, Statistics
from motorgrad.bodies import Body, BodyState
from motorgrad.schema import Settings
from motorgrad.worlds import World

Actions = Literal["binary", "discrete", "continuous"] | tuple[Literal["binary", "continuous"], ...]
Scalar = Float[Array, ""]
Flag = Bool[Array, ""] | bool
Metric = tuple[Scalar, Flag]
"""A reported quantity, and whether it occurred at this decision."""


class Mirror(NamedTuple):
    """The mirror image of a task whose body has a left and a right side.

    In the mirror, observed number `j` is `signs[j]` × number `inputs[j]`, and action `i` is action `outputs[i]`.
    Mirroring twice gives the original task. An action on the middle of the body is its own image.

    - `inputs` (observation_size): for each observed number, the index of its mirror image.
    - `signs` (observation_size): 1, or -1 for numbers that change their sign, such as a turn to the left.
    - `outputs` (action_size): for each action, the index of its mirror image.
    """

    inputs: tuple[int, ...]
    signs: tuple[int, ...]
    outputs: tuple[int, ...]


class Task(Settings, abc.ABC):
    """A task over a world (JAX) or a body (MuJoCo). Subclasses are frozen dataclasses of the task's settings.

    State that a task keeps between decisions (a flight's apex, a delay line) is its `memory`, a pytree passed
    explicitly. The functions below are pure, act on one seed, and run inside compiled code.
    """

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]  # of every subclass
    name: ClassVar[str]
    """The name in the registry."""
    learner: ClassVar[Any] = None
    """Learner settings suited to the task, a table as in `motorgrad.training.agent_for`; `None` for the preset that is
    chosen by what the task is (`motorgrad.presets.choose`)."""
    uniforms: ClassVar[int] = 0
    """Numbers from U[0, 1) that `observe` consumes."""
    init_uniforms: ClassVar[int] = 0
    """Numbers from U[0, 1) that `init` consumes."""
    actions: ClassVar[Actions] = "binary"
    """`"binary"`: a vector of `action_size` zeros and ones; `"discrete"`: one of `action_size` integers;
    `"continuous"`: a vector of `action_size` real numbers. A tuple with `"binary"` or `"continuous"` for each action: a
    vector of both."""
    clips_actions: ClassVar[bool] = False
    """Whether continuous actions beyond `action_range` act like its ends."""
    metric_names: ClassVar[tuple[str, ...]] = ()
    """The names of the quantities in `metrics`."""
    metric_units: ClassVar[Mapping[str, str]] = {}
    """The units of these quantities by name: `1` of a pure number. One that is left out is unknown."""
    reward_names: ClassVar[tuple[str, ...]] = ()
    """The names of the terms in `reward_terms`, of a reward that is a sum."""
    reward_units: ClassVar[Mapping[str, str]] = {}
    """The units of these terms by name, as those of metrics."""
    episodic: ClassVar[bool] = False
    """Whether `reward` or `truncated` can end an episode."""

    @property
    @abc.abstractmethod
    def dynamics(self) -> World | Body | str:
        """The world or body; the name of dynamics that are neither."""

    @property
    @abc.abstractmethod
    def observation_size(self) -> int:
        """Length of the observation vector."""

    @property
    @abc.abstractmethod
    def action_size(self) -> int:
        """Number of binary or continuous actions, or of alternatives."""

    def learner_for(self, steps: int) -> Mapping[str, Any] | None:
        """Learner settings suited to the task and to a training of this number of decisions; by default `learner`."""
        del steps
        return self.learner

    @classmethod
    def imports(cls, settings: Mapping[str, Any]) -> list[str]:
        """The names of code that making this task with these settings would import, and that the user has not named;
        by default none."""
        del settings
        return []

    @classmethod
    def in_folder(cls, settings: Mapping[str, Any], folder: Path) -> dict[str, Any]:
        """Settings as a file in a folder has them, whose paths are meant from there: with absolute ones. By default a
        task has no paths."""
        del folder
        return dict(settings)

    @property
    def accepted_actions(self) -> tuple[str | tuple[str, ...], ...]:
        """The kinds of actions that the task accepts, as in `Policy.actions`; by default only `actions`."""
        return (self.actions,)

    @property
    def period(self) -> float:
        """Simulated time between two decisions, in seconds; 1 if the dynamics have no time."""
        return 1.0

    @property
    def episode_limit(self) -> int | None:
        """Number of decisions after which an episode is cut (truncated, not terminated); `None` for never."""
        return None

    @property
    def longest_episode(self) -> int | None:
        """Number of decisions after which an episode ends at the latest, whoever ends it; `None` if that is unknown."""
        return self.episode_limit

    @property
    def has_episodes(self) -> bool:
        """Whether episodes end, by the task or by its limit."""
        return self.episodic or self.episode_limit is not None

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the observed numbers, for display; by default their indices."""
        return tuple(f"input {index}" for index in range(self.observation_size))

    @property
    def observation_units(self) -> tuple[str, ...]:
        """Units of the numbers that `sense` gives: `1` of a pure number, empty for one that is unknown, and by
        default."""
        return ("",) * len(self.observation_code.names)

    @property
    def input_units(self) -> tuple[str, ...]:
        """Units of the numbers that `observe` gives: those of `sense`, and unknown where it scales them."""
        known = () if self.observation_code.scales else self.observation_units
        return known if len(known) == self.observation_size else ("",) * self.observation_size

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...] | None:
        """The usual range of each observed number, over which units can be spread; `None` if unknown."""
        return None

    @property
    def action_range(self) -> tuple[tuple[float, float], ...]:
        """For continuous actions: the least and the greatest value of each, within which bounded units act: the action
        space of an environment. An unbounded policy may exceed them."""
        return ((-1.0, 1.0),) * self.action_size

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the actions; by default none."""
        return ()

    @property
    def observation_code(self) -> ObservationCode:
        """How `observe` scales what `sense` gives; by default not at all."""
        return ObservationCode.plain(self.observation_names)

    def interface(self, actions: Actions | None = None) -> Interface:
        """What observations and actions of a policy mean in the task's own units; see `Interface`.

        **Arguments:** `actions`: the kind of the policy's actions; by default the task's.

        **Raises:** `ValueError` for a task that scales observations by what it remembers, and does not say how: one
        that defines `freeze`, but neither `sense` nor `observation_code`.
        """
        own = type(self).freeze is Task.freeze or type(self).sense is not Task.sense
        wanted = "with `sense` and `observation_code`, since what `freeze` keeps cannot be carried with a policy"
        check(own, f"task {self.name!r}", "freeze", wanted)
        kind = self.actions if actions is None else actions
        size = self.action_size
        shape = () if kind == "discrete" else (size,)
        dtype = "int32" if kind == "discrete" else "float32"
        names = self.action_names
        if not self.clips_actions or (kind != "continuous" and not isinstance(kind, tuple)):
            return Interface(self.observation_code, ActionCode(kind, size, "same", names, shape, dtype), self.period)
        low, high = np.asarray(self.action_range, np.float32).T
        code = ActionCode(kind, size, "clip", names, shape, dtype, low, high)
        return Interface(self.observation_code, code, self.period)

    @property
    def mirror(self) -> Mirror | None:
        """Which inputs and actions are mirror images of each other on a symmetric body; `None` without symmetry."""
        return None

    @property
    def goal(self) -> Goal | None:
        """What the task aims at, in terms of the observation that `sense` gives, for learners that use experience for
        other targets; `None` for a task without a target, and by default."""
        return None

    def init(self, uniforms: Float[Array, " init_uniforms"]) -> PyTree:
        """The memory at the start of the first episode."""
        del uniforms
        return ()

    def renew(self, memory: PyTree, uniforms: Float[Array, " init_uniforms"]) -> PyTree:
        """The memory at the start of a further episode, given the `memory` at the end of the last one; by default a new
        one.

        Override it to keep what outlives an episode, such as running statistics of observations.
        """
        del memory
        return self.init(uniforms)

    def freeze(self, memory: PyTree) -> PyTree:
        """The memory for an evaluation, during which the task itself must not learn."""
        return memory

    @abc.abstractmethod
    def observe(
        self, memory: PyTree, state: PyTree, uniforms: Float[Array, " uniforms"]
    ) -> tuple[PyTree, Float[Array, " observation_size"]]:
        """The policy's observation of `state`, and the new memory."""

    def sense(
        self, memory: PyTree, state: PyTree, uniforms: Float[Array, " uniforms"]
    ) -> tuple[PyTree, Float[Array, " size"]]:
        """The raw observation of `state`, in the task's own units, and the new memory; by default what `observe` gives.

        Override it, and `observation_code`, where `observe` scales: what is observed is then the code of this.
        """
        return self.observe(memory, state, uniforms)

    def statistics(self, memory: PyTree) -> Statistics | None:
        """The running statistics of raw observations in a memory, with any leading axes; `None` without any."""
        return Statistics(memory.mean, memory.variance) if self.observation_code.running.any() else None

    def with_statistics(self, memory: PyTree, statistics: Statistics | None) -> PyTree:
        """The memory with running statistics of raw observations, from which they continue."""
        return memory if statistics is None else memory._replace(**statistics._asdict())

    @abc.abstractmethod
    def reward(self, memory: PyTree, state: PyTree, action: Array) -> tuple[PyTree, Scalar, Flag]:
        """The new memory, the reward for the step that led to `state` by `action`, and `terminated`."""

    def truncated(self, memory: PyTree, state: PyTree) -> Flag:
        """Whether the dynamics themselves cut the episode at `state`, by their own time limit. Called after
        `reward`."""
        del memory, state
        return False

    def reward_terms(self, memory: PyTree, state: PyTree) -> dict[str, Scalar]:
        """The terms of the last reward named in `reward_names`, each as it enters the sum. Called after `reward`."""
        del memory, state
        return {}

    def metrics(self, memory: PyTree, state: PyTree) -> dict[str, Metric]:
        """The quantities named in `metric_names`, each with whether it occurred at this decision.

        Called after `reward`."""
        del memory, state
        return {}

    def marks(self, memory: PyTree, state: PyTree) -> Float[Array, "marks 4"]:
        """Places that pictures mark with translucent balls, such as targets: x, y, z and radius of each, in m. Their
        number is fixed; by default there are none."""
        del memory, state
        return jnp.zeros((0, 4))

    def motion_metrics(self, motion: BodyState) -> dict[str, np.ndarray]:
        """Metrics of a whole motion for each seed, in addition to those of decisions: numbers or words by name,
        `(seeds,)`.

        `motion` is a `BodyState` of NumPy arrays (seeds, decisions, …). Of one that is too short there are none.
        """
        del motion
        return {}


def observe(
    task: Task, memory: PyTree, state: PyTree, uniforms: Float[Array, " uniforms"]
) -> tuple[PyTree, Float[Array, " observation_size"]]:
    """Call `task.observe`, and check that it returns a memory and an observation of the declared size."""
    found = task.observe(memory, state, uniforms)
    if not (isinstance(found, tuple) and len(found) == 2):
        raise TypeError(f"task {task.name!r}: observe must return (memory, observation), not {type(found).__name__}")
    shape = jnp.shape(found[1])
    wanted = (task.observation_size,)
    if shape != wanted:
        raise ValueError(f"task {task.name!r}: observe returns an observation of shape {shape}, not {wanted}")
    return found


class Outcome(NamedTuple):
    """The result of a step of the dynamics: the task's `memory`; the `observation`, before any reset; the `reward`;
    whether the episode `terminated` or was `truncated` (the Python value `False` if it never is); and the number of
    decisions `elapsed` in it, `None` without a limit."""

    memory: PyTree
    observation: Float[Array, " inputs"]
    reward: Scalar
    terminated: Flag
    truncated: Flag
    elapsed: Int[Array, ""] | None


def outcome(
    task: Task, memory: PyTree, state: PyTree, action: Array, uniforms: Float[Array, " uniforms"], elapsed: Array | None
) -> Outcome:
    """Evaluate a task after a step of the dynamics. This function defines the order in which a task's functions are
    called.

    **Arguments:** the task and its memory; the state and the action that led to it; `uniforms`, the U[0, 1) numbers for
    the observation; `elapsed`, the decisions made in the episode before this one, `None` without a limit.

    **Raises:** `TypeError` if a task ends an episode without being `episodic`, or if `reward` or `observe` does not
    return what it should.
    """
    found = task.reward(memory, state, action)
    if not (isinstance(found, tuple) and len(found) == 3):
        raise TypeError(f"task {task.name!r}: reward must return (memory, reward, terminated)")
    memory, reward, terminated = found
    truncated: Any = task.truncated(memory, state)
    for flag, name in ((terminated, "terminated"), (truncated, "truncated")):
        if flag is not False and not task.episodic:
            raise TypeError(f"task {task.name!r} reports `{name}`, so its class must say `episodic = True`")
    memory, observation = observe(task, memory, state, uniforms)
    if elapsed is not None:
        elapsed = elapsed + 1
        over = elapsed >= (task.episode_limit or 0)
        truncated = over if truncated is False else truncated | over
    if terminated is not False and truncated is not False:
        truncated = truncated & ~terminated
    return Outcome(memory, observation, reward, terminated, truncated, elapsed)
