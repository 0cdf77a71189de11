"""A probe of a learner: a compiled function that reads its body, observations, policy and gradient, for all seeds."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, PyTree

from motorgrad.bodies import BodyState
from motorgrad.learning import SGD, AgentState, Optimizer, RunningMean
from motorgrad.policies import abilities, split, trainable
from motorgrad.training import HostStepper, Stepper
from motorgrad.training.engines import CycleState

Probed = dict[str, np.ndarray]


def probe(stepper: Stepper, feet: list[str]) -> Callable[[], Probed]:
    """Make a function that samples a stepper.

    `reward_sum` (seeds, 2) is the sum of rewards since the last harvest and its rounding error; `rates` are the
    learning rates of the parameters, NaN where the optimizer has none. `memory` is what the policy remembers for its
    next decision, and `fixed` its numbers that are not trained, such as the running statistics of observations.
    """

    engine: Any = stepper  # every engine with a viewer has a cycle

    def view(cycle: CycleState, state: PyTree) -> dict[str, Array]:
        agent, tally = cycle.agent, cycle.tally
        learner = engine.cycle.learner(cycle)
        parameters, settings = split(agent.policy)
        # An engine on the host has acted already, and the memory has moved on: the decision has what the units saw.
        if agent.decision is not None and abilities.has_memory(agent.policy) and isinstance(engine, HostStepper):
            seen = agent.decision.observation
        else:
            seen = abilities.observation_with_memory(agent.policy, agent.memory, cycle.observation)
        probability = agent.policy.prob(seen)
        flat = ravel_pytree(parameters)[0]
        position, velocity = _moved(state)
        touched = [jnp.asarray(state.sensors[name]) for name in feet]
        batch = agent.gradient.mean if isinstance(agent.gradient, RunningMean) else None
        return {
            "position": position,
            "velocity": velocity,
            "activation": _active(state),
            "contacts": jnp.stack(touched) if touched else jnp.zeros(0),
            "observation": cycle.observation,
            "memory": jnp.zeros(0) if agent.memory is None else agent.memory,
            "action": _wide(cycle.action, probability.shape[0]),
            "probability": probability,
            "reward_sum": jnp.stack([tally.sums[0], tally.carry[0]]),
            "baseline": learner.estimator.level(agent.estimator),
            "parameters": flat,
            "fixed": ravel_pytree(eqx.filter(settings, eqx.is_array))[0],
            "rates": _learning_rates(learner.optimizer, agent, flat),
            "marks": jnp.ravel(engine.task.marks(cycle.memory, state)),
            "batch": jnp.full_like(flat, jnp.nan) if batch is None else ravel_pytree(batch)[0],
        }

    return stepper.viewer(view)


def gradient_norm(before: Probed, after: Probed) -> np.ndarray:
    """The norm of the gradient that the last decision's step followed, NaN where it is unknown.

    Where a gradient is the mean of a batch, this is the norm of the mean so far; with a metric it is that of the
    natural gradient.
    """
    if not np.isnan(after["batch"]).any():
        return np.linalg.norm(after["batch"], axis=-1)
    rates = np.where(after["rates"] > 0, after["rates"], np.nan)
    with np.errstate(invalid="ignore"):  # between parameters that are not finite there is no step
        steps = (after["parameters"].astype(float) - before["parameters"]) / rates
    known = np.isfinite(steps)
    norm = np.sqrt(np.sum(np.where(known, steps, 0.0) ** 2, axis=-1))
    return np.where(known.any(axis=-1), norm, np.nan)


def _active(state: PyTree) -> Array:
    """The activations of a body, where it has any."""
    found = state.activation if isinstance(state, BodyState) else None
    return jnp.zeros(0) if found is None else found


def _moved(state: PyTree) -> tuple[Array, Array]:
    """Position and velocity of a state that has them; otherwise all of its numbers, and none."""
    if hasattr(state, "position"):
        return jnp.ravel(state.position), jnp.ravel(getattr(state, "velocity", jnp.zeros(0)))
    return jnp.asarray(ravel_pytree(state)[0], jnp.result_type(float)), jnp.zeros(0)


def _wide(action: Array, size: int) -> Array:
    """An action as one number for each unit or alternative; NaN for a unit that was not asked."""
    if action.ndim == 0:
        return jax.nn.one_hot(action, size)
    numbers = jnp.asarray(action, jnp.result_type(float))[:size]
    return jnp.pad(numbers, (0, size - numbers.shape[0]), constant_values=jnp.nan)


def _learning_rates(optimizer: Optimizer, state: AgentState, flat: Array) -> Array:
    if not isinstance(optimizer, SGD):
        return jnp.full_like(flat, jnp.nan)
    parameters = trainable(state.policy)
    rates = optimizer.learning_rates(parameters, state.steps)
    return ravel_pytree(jax.tree.map(lambda p, rate: jnp.broadcast_to(rate, p.shape), parameters, rates))[0]
