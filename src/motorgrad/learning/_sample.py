"""What a reward says of the gradient: what it is compared with, and the eligibility that this multiplies."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad.learning._agent_state import AgentState, last_of
from motorgrad.learning._choose import Flag
from motorgrad.learning._critic import LinearCritic
from motorgrad.learning._entropy import entropy_gradient
from motorgrad.learning._estimator import Estimator
from motorgrad.learning._input_baselines import InputBaseline
from motorgrad.learning._scale import ScaleState
from motorgrad.learning._schedule import at
from motorgrad.policies import Policy, trainable

Credit = Callable[[PyTree[Array], Float[Array, ""]], PyTree[Array]]


def started(baseline: Any, policy: Policy, dtype: Any) -> Any:
    """The state of a baseline before any reward."""
    if isinstance(baseline, LinearCritic):
        return baseline.init(dtype, policy)
    return baseline.init(dtype, policy.inputs) if isinstance(baseline, InputBaseline) else baseline.init(dtype)


def gradient_sample(
    estimator: Estimator,
    state: AgentState,
    reward: Float[Array, ""],
    next_observation: Float[Array, " inputs"],
    terminated: Flag,
    diverged: Flag,
) -> tuple[PyTree[Array], Any, ScaleState | None]:
    """The gradient sample of a reward, the bonus for entropy in it, and the baseline and the scale afterwards."""
    sample, baseline, scale = _compared(estimator, state, reward, next_observation, terminated, diverged)
    if estimator.entropy != 0:
        bonus = at(estimator.entropy, state.steps)
        slope = entropy_gradient(state.policy, last_of(state).observation)
        sample = jax.tree.map(lambda g, h: (g + bonus * h).astype(g.dtype), sample, slope)
    return sample, baseline, scale


def _compared(
    estimator: Estimator, state: AgentState, reward: Float[Array, ""], *after: Any
) -> tuple[PyTree[Array], Any, ScaleState | None]:
    """The gradient sample without a bonus, and the baseline and the scale afterwards."""
    trace, baseline = estimator.trace, estimator.baseline
    if isinstance(baseline, LinearCritic):
        error, critic = baseline.follow(state.baseline, state.policy, last_of(state).action, reward, *after)
        scale, credit = _credit(estimator, state, error)
        return credit(trace.value(state.trace), error), critic, scale
    level = baseline.value(state.baseline)
    if not isinstance(baseline, InputBaseline):
        scale, credit = _credit(estimator, state, reward - level)
        return credit(trace.value(state.trace), reward - level), baseline.update(state.baseline, reward), scale
    observation, action = last_of(state)
    expected = baseline.value_at(state.baseline, observation)
    scale, credit = _credit(estimator, state, reward - expected)
    score = state.policy.score(observation, action)
    newest = trace.value(trace.update(trace.init(trainable(state.policy)), score))
    sample = jax.tree.map(jnp.add, credit(trace.value(state.trace), reward - level), credit(newest, level - expected))
    return sample, baseline.update(state.baseline, observation, reward), scale


def _credit(estimator: Estimator, state: AgentState, advantage: Float[Array, ""]) -> tuple[ScaleState | None, Credit]:
    """The scale, once it knows this advantage, and what then multiplies an eligibility by its worth."""
    normal, scale, factors = estimator.scale, state.scale, []
    if normal is not None and scale is not None:
        scale = normal.update(scale, advantage)
        factors.append(normal.factor(scale))
    if state.weight is not None:
        factors.append(state.weight)

    def credit(eligibility: PyTree[Array], worth: Float[Array, ""]) -> PyTree[Array]:
        for factor in factors:
            worth = factor * worth
        return jax.tree.map(lambda z: worth * z, eligibility)

    return scale, credit
