"""A learner that decides by one compiled program: one by one, its operations take far longer to compile than to run."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np


class Decided(NamedTuple):
    """A learner after `act` and the action, after `reinforce`, and after `update_every`."""

    acted: Any
    action: Any
    told: Any
    state: Any


@eqx.filter_jit
def _started(agent, key):
    return agent.init(key)


def started(agent, seed=0):
    """The state of a learner before its first decision."""
    return _started(agent, jax.random.key(seed))


@eqx.filter_jit
def _told(agent, state, look, uniforms, reward, after, flags):
    acted, action = agent.act(state, look, uniforms)
    names = ("terminated", "truncated", "diverged")
    return acted, action, agent.reinforce(acted, reward, after, **dict(zip(names, flags, strict=True)))


@eqx.filter_jit
def _decided(agent, state, look, uniforms, reward, after, flags):
    acted, action, told = _told(agent, state, look, uniforms, reward, after, flags)
    return Decided(acted, action, told, agent.improve(told, flags[0] | flags[1] | flags[2], flags[2]))


def told(agent, state, look, uniforms, reward, after=None, terminated=False, truncated=False, diverged=False):
    """One decision of a learner up to its reward: the learner after `act`, the action, and it after `reinforce`.

    Without an observation `after` it, the world shows the same again.
    """
    after = look if after is None else after
    given = map(np.asarray, (look, uniforms, reward, after))
    return _told(agent, state, *given, tuple(map(np.bool_, (terminated, truncated, diverged))))


def decided(agent, state, look, uniforms, reward, after=None, terminated=False, truncated=False, diverged=False):
    """One whole decision of a learner, with the arguments of `told`."""
    after = look if after is None else after
    given = map(np.asarray, (look, uniforms, reward, after))
    return _decided(agent, state, *given, tuple(map(np.bool_, (terminated, truncated, diverged))))
