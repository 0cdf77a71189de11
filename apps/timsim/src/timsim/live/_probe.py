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
from motorgrad.learning import SGD, RunningMean
from motorgrad.policies import abilities, split, trainable
from motorgrad.training import HostStepper, Stepper
from motorgrad.training.engines import CycleState

Probed = dict[str, np.ndarray]


def probe(stepper: Stepper, feet: list[str]) -> Callable[[], Probed]:
    """Make a function that samples a stepper.

    `reward_sum` (seeds, 2) is the sum of rewards since the last harvest and its rounding error. `baseline` is the level
    of rewards that the learner has found, and `rates` are the learning rates of the parameters; both are NaN where the
    learner has none. `memory` is what the policy remembers for its next decision, and `fixed` its numbers that are not
    trained, such as the running statistics of observations.
    """

    engine: Any = stepper  # every engine with a viewer has a cycle

    def view(cycle: CycleState, state: PyTree) -> dict[str, Array]:
        agent, tally = cycle.agent, cycle.tally
        learner = engine.cycle.learner(cycle)
        parameters, settings = split(agent.policy)
        memory = getattr(agent, "memory", None)
        probability = _probability(cycle, isinstance(engine, HostStepper))
        flat = ravel_pytree(parameters)[0]
        position, velocity = _moved(state)
        touched = [jnp.asarray(state.sensors[name]) for name in feet]
        gradient = getattr(agent, "gradient", None)
        batch = gradient.mean if isinstance(gradient, RunningMean) else None
        return {
            "position": position,
            "velocity": velocity,
            "activation": _active(state),
            "contacts": jnp.stack(touched) if touched else jnp.zeros(0),
            "observation": cycle.observation,
            "memory": jnp.zeros(0) if memory is None else memory,
            "action": _wide(cycle.action, probability.shape[0]),
            "probability": probability,
            "reward_sum": jnp.stack([tally.sums[0], tally.carry[0]]),
            "baseline": learner.readings(agent).get("baseline", jnp.asarray(jnp.nan)),
            "parameters": flat,
            "fixed": ravel_pytree(eqx.filter(settings, eqx.is_array))[0],
            "rates": _learning_rates(learner, agent, flat),
            "marks": jnp.ravel(engine.task.marks(cycle.memory, state)),
            "batch": jnp.full_like(flat, jnp.nan) if batch is None else ravel_pytree(batch)[0],
        }

    return stepper.viewer(view)


def gradient_norm(before: Probed, after: Probed) -> np.ndarray:
    """The norm of the gradient that the last decision's step followed, NaN where it is unknown.

    Where a gradient is the mean of a batch, this is the norm of the mean so far; with a metric it is that of the
    natural gradient, and of several steps at once that of their sum.
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


def _probability(cycle: CycleState, acted: bool) -> Array:
    """The probability of each unit or alternative at the present observation. NaN where the learner does not say what a
    policy with a memory saw. `acted` says whether the action was chosen already, so that the memory has moved on."""
    policy = cycle.agent.policy
    memory = getattr(cycle.agent, "memory", None)
    decision = getattr(cycle.agent, "decision", None)
    if not abilities.has_memory(policy) or (memory is not None and not acted):
        return policy.prob(abilities.observation_with_memory(policy, memory, cycle.observation))
    if decision is not None:
        return policy.prob(decision.observation)
    return jnp.full(policy.outputs, jnp.nan)


def _learning_rates(learner: Any, state: Any, flat: Array) -> Array:
    optimizer = getattr(learner, "optimizer", None)
    if not isinstance(optimizer, SGD):
        return jnp.full_like(flat, jnp.nan)
    parameters = trainable(state.policy)
    rates = optimizer.learning_rates(parameters, getattr(state, "steps", None))
    return ravel_pytree(jax.tree.map(lambda p, rate: jnp.broadcast_to(rate, p.shape), parameters, rates))[0]
