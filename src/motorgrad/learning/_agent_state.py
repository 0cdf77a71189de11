"""What a learner knows at a decision."""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._running import RunningMean
from motorgrad.learning._growth import GrowthState
from motorgrad.learning._natural import FisherState
from motorgrad.learning._scale import ScaleState
from motorgrad.policies import Policy


class Decision(NamedTuple):
    """What an action was taken on, and the action."""

    observation: Float[Array, " inputs"]
    action: Array


class AgentState(NamedTuple):
    r"""Everything a learner carries from one decision to the next, for one seed.

    `policy` holds the parameters; `trace` and `baseline` their filter's and baseline's state; `gradient` the running
    mean of the samples $g = \delta z$ since the last step, or for an online learner the sample between `reinforce` and
    `improve`, which spends it, and `None` otherwise; `ascent` the state of the ascent rule; `weight` the discount
    $\gamma^t$ within the episode, `None` without discounting; `metric` the metric's state, `None` without one; `last`
    the decision whose reward is awaited, `None` where nothing asks for it; `scale` that of the advantages, `None` where
    they are not normalised; `growth` that of a growing learner, else `None`; `index` what an `IndexedAgent` knows of
    its units, else `None`; `steps`, how often the parameters have moved, and the `average` of what they were, `None`
    where nothing asks for them.
    """

    policy: Policy
    trace: PyTree[Array]
    baseline: Any
    gradient: PyTree[Array] | RunningMean | None
    ascent: Any
    weight: Float[Array, ""] | None
    metric: FisherState | None = None
    last: Decision | None = None
    scale: ScaleState | None = None
    growth: GrowthState | None = None
    index: Any = None  # an IndexState
    steps: Int[Array, ""] | None = None
    average: RunningMean | None = None


def running_of(state: AgentState) -> RunningMean:
    assert isinstance(state.gradient, RunningMean)
    return state.gradient


def last_of(state: AgentState) -> Decision:
    assert state.last is not None
    return state.last


def no_decision(policy: Policy, dtype: Any) -> Decision:
    observation = jnp.zeros(policy.inputs, dtype)
    return Decision(observation, jnp.zeros_like(policy.mode(observation)))
