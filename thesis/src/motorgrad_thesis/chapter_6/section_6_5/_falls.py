"""Falls of a particle under frozen policies that are sampled at any period, and what they do on the way."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from motorgrad._errors import check
from motorgrad.policies import Policy
from motorgrad.tasks import FallingParticle

LONGEST = 20_000  # time steps after which a fall that has not ended is an error


class Falls(NamedTuple):
    """Falls from the start to the floor, policies leading and falls along the second axis.

    - `fired`: whether each unit acted at least once, `(policies, falls, units)`.
    - `pushes`: the time for which each unit pushed, in s.
    - `silent`: the product of $1 - p$ over the decisions of each fall, for each unit.
    - `peak`: the greatest probability of each unit at a decision.
    - `time`: the length of each fall in s, `(policies, falls)`.
    - `reward`: the mean over the time steps of each fall, `(policies, falls)`, whatever the period of decisions.
    """

    fired: Bool[np.ndarray, "policies falls units"]
    pushes: Float[np.ndarray, "policies falls units"]
    silent: Float[np.ndarray, "policies falls units"]
    peak: Float[np.ndarray, "policies falls units"]
    time: Float[np.ndarray, "policies falls"]
    reward: Float[np.ndarray, "policies falls"]


def falls(task: FallingParticle, policies: Policy, hold: int, count: int, seed: int = 0) -> Falls:
    """Falls under each of several policies of binary units, which do not learn.

    **Arguments:** `task`, whose decisions take one time step each; `policies`, seeds leading; `hold`, the number of
    time steps for which a sampled action is held; `count` of falls of each policy; `seed` of the random numbers.
    """
    check(task.physics.substeps == 1, "substeps", task.physics.substeps, "1: `hold` says how long actions are held")
    found = _compiled(task, count)(policies, jnp.int32(hold), seed)
    check(not np.any(found[-1]), "falls", count, f"at the floor within {LONGEST:,} time steps")
    return Falls(*(np.asarray(each) for each in found[:-1]))


@functools.lru_cache(maxsize=16)
def _compiled(task: FallingParticle, count: int) -> Any:
    """The compiled falls of a task. The time for which actions are held is an argument, so that one program serves all
    periods."""
    world = task.dynamics

    def fall(policy: Policy, hold: Array, key: Array) -> tuple[Array, ...]:
        start, moves = jax.random.split(key)
        units = policy.outputs

        def step(carry: tuple[Any, ...]) -> tuple[Any, ...]:
            time, state, action, fired, pushes, silent, peak, reward, _ = carry
            decides = time % hold == 0
            seen = state.position
            prob = jnp.where(decides, policy.prob(seen), 0)
            drawn = policy.sample(seen, jax.random.uniform(jax.random.fold_in(moves, time), (policy.uniforms,)))
            action = jnp.where(decides, drawn, action)
            state = world.step(state, action, jnp.zeros(0))
            _, paid, ended = task.reward(None, state, action)
            return (
                time + 1,
                state,
                action,
                fired | (action > 0),
                pushes + world.physics.timestep * action,
                silent + jnp.log1p(-prob),
                jnp.maximum(peak, prob),
                reward + paid,
                ~ended,
            )

        nothing = jnp.zeros(units)
        state = world.reset(jax.random.uniform(start, (world.reset_uniforms,)))
        first = (
            jnp.int32(0),
            state,
            nothing,
            nothing > 0,
            nothing,
            nothing,
            nothing,
            jnp.zeros(()),
            jnp.ones((), bool),
        )
        last = jax.lax.while_loop(lambda carry: carry[-1] & (carry[0] < LONGEST), step, first)
        time, _, _, fired, pushes, silent, peak, reward, falling = last
        return fired, pushes, jnp.exp(silent), peak, time * world.physics.timestep, reward / time, falling

    def all_falls(policies: Policy, hold: Array, seed: int) -> tuple[Array, ...]:
        leaves = jax.tree.leaves(policies)
        keys = jax.random.split(jax.random.key(seed), (leaves[0].shape[0], count))
        each = jax.vmap(fall, in_axes=(None, None, 0))
        return jax.vmap(each, in_axes=(0, None, 0))(policies, hold, keys)

    return jax.jit(all_falls)
