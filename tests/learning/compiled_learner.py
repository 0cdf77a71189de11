"""A decision of a learner, as it is and compiled: one by one, its operations take far longer to compile than to run."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.learning import Transition


class Decided(NamedTuple):
    """A learner after `act` and the action, after `observe`, and after `update`."""

    acted: Any
    action: Any
    observed: Any
    state: Any


def decision(agent, state, look, uniforms, reward, after=None, **flags):
    """One decision of a learner, to be compiled with what is about it.

    The reward is a number, or a function of the action. Without an observation `after` it, the world shows the same
    again.
    """
    acted, action = agent.act(state, look, uniforms)
    reward = reward(action) if callable(reward) else reward
    observed = agent.observe(acted, Transition(look, action, reward, look if after is None else after, **flags))
    return Decided(acted, action, observed, agent.update(observed))


class _Moving(NamedTuple):
    policy: Any
    chain: Any
    steps: Any


def updates_of(chain, gradient, states, policy, steps=None):
    """What the parameters would move by up a gradient, before limits, and the states of the chain after it."""
    found = []

    def take(updates):
        found.append(updates)
        return updates

    after = chain.step(_Moving(policy, states, steps), gradient, scale=take)
    return found[0], after.chain


@eqx.filter_jit
def _started(agent, key):
    return agent.init(key)


def started(agent, seed=0):
    """The state of a learner before its first decision."""
    return _started(agent, jax.random.key(seed))


def refreshed(agent, state):
    """The state of one seed of a sparse learner with its table made."""
    lead = jax.tree.map(lambda leaf: jnp.array(leaf)[None], (state.index, state.policy))
    return state._replace(index=jax.tree.map(lambda leaf: leaf[0], agent.refresh(*lead)))


@eqx.filter_jit
def _decided(agent, state, look, uniforms, reward, after, flags):
    return decision(agent, state, look, uniforms, reward, after, **flags)


@eqx.filter_jit
def _told(agent, state, look, uniforms, reward, after, flags):
    return decision(agent, state, look, uniforms, reward, after, **flags)[:3]


def _arrays(look, uniforms, reward, after, terminated=False, truncated=False, diverged=False):
    flags = {"terminated": terminated, "truncated": truncated, "diverged": diverged}
    given = map(np.asarray, (look, uniforms, reward, look if after is None else after))
    return *given, {name: np.bool_(flag) for name, flag in flags.items()}


def told(agent, state, look, uniforms, reward, after=None, **flags):
    """One decision of a learner up to its reward, compiled: the learner after `act`, the action, and it after
    `observe`."""
    return _told(agent, state, *_arrays(look, uniforms, reward, after, **flags))


def decided(agent, state, look, uniforms, reward, after=None, **flags):
    """One whole decision of a learner, compiled."""
    return _decided(agent, state, *_arrays(look, uniforms, reward, after, **flags))
