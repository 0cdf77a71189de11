"""Policies with hidden units: they draw more than the task gets, or have layers between observation and action."""

from typing import Protocol, runtime_checkable

from jaxtyping import Array, Float

from motorgrad.policies.abilities._delegation import ActsByAnother


@runtime_checkable
class HiddenUnits(Protocol):
    """A policy that draws more than the task gets. What `sample` returns, and all other methods take, is the whole."""

    def task_action(self, action: Array) -> Array:
        """The task's part of an action."""
        ...


@runtime_checkable
class HiddenLayers(Protocol):
    """A policy with layers, stochastic or not, between the observation and its action."""

    def hidden_activations(self, observation: Float[Array, " inputs"]) -> tuple[Float[Array, " units"], ...]:
        """The output of each hidden layer, from the inputs on. Of stochastic units it is the firing probability or the
        mean activation."""
        ...


def has_hidden_units(policy: object) -> bool:
    """Whether the task gets only a part of an action."""
    if isinstance(policy, HiddenUnits):
        return True
    return isinstance(policy, ActsByAnother) and has_hidden_units(policy.inner)


def task_action(policy: object, action: Array) -> Array:
    """The part of an action that the task gets; all of it, without hidden units."""
    if isinstance(policy, HiddenUnits):
        return policy.task_action(action)
    return task_action(policy.inner, action) if isinstance(policy, ActsByAnother) else action


def hidden_activations(policy: object, observation: Float[Array, " inputs"]) -> tuple[Float[Array, " units"], ...]:
    """The output of each hidden layer, from the inputs on; an empty tuple without hidden layers."""
    return policy.hidden_activations(observation) if isinstance(policy, HiddenLayers) else ()
