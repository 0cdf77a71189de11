"""Policies with a memory: they see more than the task shows."""

from typing import Any, Protocol, runtime_checkable

from jaxtyping import Array, Float


@runtime_checkable
class Memory(Protocol):
    """A policy that remembers something from decision to decision.

    Its `inputs` are the length of the observation with what is remembered, its `observation_size` that of what the
    task shows. All its other methods take the observation with the memory.
    """

    def initial_memory(self) -> Float[Array, " memory"]:
        """The memory at the start of an episode."""
        ...

    def observation_with_memory(
        self, memory: Float[Array, " memory"] | None, observation: Float[Array, " observation"]
    ) -> Float[Array, " inputs"]:
        """What the units see: an observation of the task, with what is remembered."""
        ...

    def remember(self, seen: Float[Array, " inputs"], action: Array) -> Float[Array, " memory"]:
        """The memory after an action, given what the units saw."""
        ...


@runtime_checkable
class ParameterMemory(Protocol):
    """A policy whose memory may depend on its parameters."""

    @property
    def remembers_parameters(self) -> bool:
        """Whether the memory after given observations and actions depends on the parameters, so that it is out of date
        once they move."""
        ...

    @property
    def has_exact_score(self) -> bool:
        """Whether `score` is the whole derivative of the log-probability. It is not where the memory depends on the
        parameters and the score takes it as given."""
        ...


@runtime_checkable
class LastingNoise(Protocol):
    """A policy whose memory only makes its noise last for several decisions."""

    @property
    def marginal(self) -> Any:
        """The policy without a memory that acts alike on average."""
        ...


@runtime_checkable
class CriticObservation(Protocol):
    """A policy whose units see more than baselines and critics should."""

    def critic_observation(self, seen: Float[Array, " inputs"]) -> Float[Array, " critic_observation"]:
        """The part of what the units see that baselines and critics get."""
        ...


def has_memory(policy: object) -> bool:
    """Whether the policy remembers anything from decision to decision."""
    return isinstance(policy, Memory)


def initial_memory(policy: object) -> Float[Array, " memory"] | None:
    """The memory at the start of an episode; `None` without one."""
    return policy.initial_memory() if isinstance(policy, Memory) else None


def observation_with_memory(
    policy: object, memory: Float[Array, " memory"] | None, observation: Float[Array, " observation"]
) -> Float[Array, " inputs"]:
    """What the units see: an observation of the task, with what is remembered."""
    return policy.observation_with_memory(memory, observation) if isinstance(policy, Memory) else observation


def remember(policy: object, seen: Float[Array, " inputs"], action: Array) -> Float[Array, " memory"] | None:
    """The memory after an action, given what the units saw; `None` without one."""
    return policy.remember(seen, action) if isinstance(policy, Memory) else None


def remembers_parameters(policy: object) -> bool:
    """Whether the memory depends on the parameters, so that it is out of date once they move."""
    return isinstance(policy, ParameterMemory) and policy.remembers_parameters


def has_exact_score(policy: object) -> bool:
    """Whether `score` is the whole derivative of the log-probability."""
    return not isinstance(policy, ParameterMemory) or policy.has_exact_score


def marginal(policy: Any) -> Any:
    """The policy without a memory that acts alike on average, for one whose memory only makes its noise last; the
    policy itself, for others."""
    return policy.marginal if isinstance(policy, LastingNoise) else policy


def critic_observation(policy: object, seen: Float[Array, " inputs"]) -> Float[Array, " critic_observation"]:
    """The part of what the units see that baselines and critics get; all of it, unless the policy says otherwise."""
    return policy.critic_observation(seen) if isinstance(policy, CriticObservation) else seen
