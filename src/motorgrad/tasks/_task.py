"""What every task is: what is observed, what is rewarded, when an episode ends; pure functions over dynamics."""

import abc
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from jaxtyping import Array, Bool, Float

from motorgrad.bodies import Body
from motorgrad.tasks._mirror import Mirror
from motorgrad.worlds import World

Actions = Literal["binary", "discrete", "graded"]
Reading = tuple[Float[Array, ""], Bool[Array, ""] | bool]
"""A quantity that a task reports, and whether it occurred at this decision."""


class Task(abc.ABC):
    """A task over a world (JAX) or a body (MuJoCo). Subclasses are frozen dataclasses of the task's numbers.

    What a task must remember between decisions (a flight's apex, a delay line) is its `memory`, a pytree handed back
    and forth explicitly; the functions below are pure, act on one seed, and run inside compiled code.
    """

    name: ClassVar[str]
    """The name in the registry."""
    learner: ClassVar[Mapping[str, Any]] = {}
    """Settings of the learner that go with the task, as in `motorgrad.training.AgentSettings`."""
    uniforms: ClassVar[int] = 0
    """Numbers from U[0, 1) that `observe` consumes."""
    init_uniforms: ClassVar[int] = 0
    """Numbers from U[0, 1) that `init` consumes."""
    actions: ClassVar[Actions] = "binary"
    """`"binary"`: a vector of `action_size` zeros and ones; `"discrete"`: one of `action_size` integers; `"graded"`: a
    vector of `action_size` real numbers."""
    reports: ClassVar[tuple[str, ...]] = ()
    """The names of the quantities in `readings`."""
    episodic: ClassVar[bool] = False
    """Whether `reward` or `truncated` can report the end of an episode."""

    @property
    @abc.abstractmethod
    def dynamics(self) -> World | Body | Any:
        """What moves."""

    @property
    @abc.abstractmethod
    def observation_size(self) -> int:
        """Length of the observation vector."""

    @property
    @abc.abstractmethod
    def action_size(self) -> int:
        """Number of binary or graded actions, or of alternatives."""

    @property
    def takes(self) -> tuple[str, ...]:
        """The kinds of actions that will do, as `Policy.actions` has them: by default those of `actions` alone."""
        return (self.actions,)

    @property
    def period(self) -> float:
        """Simulated time from one decision to the next, in seconds; 1 where the dynamics know no time."""
        return 1.0

    @property
    def episode_limit(self) -> int | None:
        """After how many decisions an episode is cut (truncated, not terminated); `None` for never."""
        return None

    @property
    def has_episodes(self) -> bool:
        """Whether an episode ever ends, by the task or by its limit."""
        return self.episodic or self.episode_limit is not None

    @property
    def observation_names(self) -> tuple[str, ...]:
        """What each observed number is, for people to read: by default its number."""
        return tuple(f"input {index}" for index in range(self.observation_size))

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...] | None:
        """Between which values each observed number lies as a rule, for those who spread units over them; `None` where
        that is not known."""
        return None

    @property
    def action_range(self) -> tuple[tuple[float, float], ...]:
        """Of graded actions: what the ends of an environment's space, −1 and 1, stand for. A policy may go beyond."""
        return ((-1.0, 1.0),) * self.action_size

    @property
    def mirror(self) -> Mirror | None:
        """Which inputs and actions are each other's mirror image, on the two sides of a symmetric body; `None` where
        there are no sides."""
        return None

    def init(self, uniforms: Float[Array, " init_uniforms"]) -> Any:
        """The memory at the start of an episode."""
        del uniforms
        return ()

    def renew(self, memory: Any, uniforms: Float[Array, " init_uniforms"]) -> Any:
        """The memory at the start of a further episode, `memory` being what the last one left: by default a new one.

        Here a task keeps what outlives an episode, such as running statistics of its senses.
        """
        del memory
        return self.init(uniforms)

    def freeze(self, memory: Any) -> Any:
        """The memory with which an evaluation goes on, in which the task itself must learn nothing more."""
        return memory

    @abc.abstractmethod
    def observe(
        self, memory: Any, state: Any, uniforms: Float[Array, " uniforms"]
    ) -> tuple[Any, Float[Array, " observation_size"]]:
        """What the policy sees of `state`, and the memory afterwards."""

    @abc.abstractmethod
    def reward(self, memory: Any, state: Any, action: Array) -> tuple[Any, Float[Array, ""], Bool[Array, ""] | bool]:
        """What the step that led to `state` by `action` pays: the memory afterwards, the reward, and `terminated`."""

    def truncated(self, memory: Any, state: Any) -> Bool[Array, ""] | bool:
        """Whether the dynamics themselves cut the episode at `state`, by a time limit of their own; after `reward`."""
        del memory, state
        return False

    def readings(self, memory: Any, state: Any) -> dict[str, Reading]:
        """The quantities named in `reports`, after `reward`: each with whether it occurred at this decision."""
        del memory, state
        return {}

    def measures(self, recorded: Any) -> dict[str, np.ndarray]:
        """What a recorded motion says of each seed, beside the readings: numbers or words by name, `(seeds,)`.

        `recorded` is a `BodyState` of NumPy arrays (seeds, decisions, …); what is too short to measure gives nothing.
        """
        del recorded
        return {}
