"""A stranger's learner, of the five functions alone, for tests of what every learner may do."""

import contextlib
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree

from motorgrad import learning, policies
from motorgrad.schema import PART_CLASSES


class TriedState(NamedTuple):
    policy: Any
    best: Any
    record: Any
    total: Any
    made: Any
    key: Any


class Neighbours(learning.Learner):
    """Tries neighbours of the best parameters so far: a search without a gradient."""

    trial: int = learning.count(5, 1, 1000, unit="decisions", help="length of a trial")
    spread: float = learning.number(0.3, 0, help="deviation of the parameters that are tried")

    def init(self, key):
        policy = self.first_policy(key)
        zero = jnp.zeros(())
        words = jax.random.key_data(key)
        return TriedState(policy, policies.trainable(policy), zero - jnp.inf, zero, jnp.zeros((), jnp.int32), words)

    def act(self, state, observation, uniforms):
        return state, state.policy.sample(observation, uniforms)

    def observe(self, state, transition):
        lost = jnp.asarray(transition.diverged)
        reward = jnp.where(lost, 0, transition.reward)
        return state._replace(total=state.total + reward, made=state.made + jnp.where(lost, 0, 1))

    def update(self, state):
        tried, fixed = policies.split(state.policy)
        better = state.total > state.record
        best = jax.tree.map(lambda new, old: jnp.where(better, new, old), tried, state.best)
        key = jax.random.fold_in(jax.random.wrap_key_data(state.key), 1)
        numbers, unravel = ravel_pytree(best)
        tried = unravel(numbers + self.spread * jax.random.normal(key, numbers.shape))
        record = jnp.maximum(state.total, state.record)
        words = jax.random.key_data(key)
        after = TriedState(eqx.combine(tried, fixed), best, record, jnp.zeros(()), jnp.zeros_like(state.made), words)
        return jax.tree.map(lambda new, old: jnp.where(state.made >= self.trial, new, old), after, state)

    def decisions_until_due(self, state):
        return self.trial - 1 - state.made


@contextlib.contextmanager
def registered():
    """Within this, it is known by its name, "neighbours"."""
    learning.register(learning.Learner, "neighbours", Neighbours)
    yield
    del PART_CLASSES[learning.Learner]["neighbours"]
