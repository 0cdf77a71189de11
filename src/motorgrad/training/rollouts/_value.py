"""What the learner of a run holds of the situations of a rollout: the value of its critic, or its baseline."""

import copy
import operator
import warnings
from typing import Self

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from motorgrad.learning import Critic, InputBaseline
from motorgrad.policies import Policy, abilities
from motorgrad.schema import numbers_of
from motorgrad.training._run import Run, saved_agent
from motorgrad.training.store import RunDirectoryError, RunWarning, fill_tree


class Values:
    """The value of what some policies see, by the `state` of their learner's `baseline` at the end of a run; all lanes
    lead. `of_future` says whether it is of all that follows, as a critic's, rather than of the next reward."""

    def __init__(self, baseline: Critic | InputBaseline, state: PyTree, policies: Policy):
        self._baseline, self._state, self._policies = baseline, state, policies
        self.of_future = isinstance(baseline, Critic)
        self._all = jax.jit(jax.vmap(self._one, (None, None, 0, 0)))

    def of_rows(self, rows: np.ndarray) -> Self:
        """Those of some lanes."""
        made = copy.copy(self)
        made._state, made._policies = jax.tree.map(lambda leaf: leaf[rows], (self._state, self._policies))
        return made

    def _one(self, state: PyTree, policy: Policy, seen: Array, before: Array) -> Array:
        shown = abilities.critic_observation(policy, seen)
        baseline = self._baseline
        if not isinstance(baseline, Critic):
            return baseline.value_at(state, shown)
        previous = before if before.ndim else jax.nn.one_hot(before, policy.outputs)
        return baseline.value_at(state, shown, jnp.asarray(previous, jnp.result_type(float)))

    def of(self, lane: int, seen: np.ndarray, before: np.ndarray) -> Float[np.ndarray, " moments"]:
        """The values of what one lane has `seen` `(moments, inputs)`, after the actions `before` `(moments, …)`: at the
        start of an episode zeros, or the alternative −1."""
        state, policy = jax.tree.map(lambda leaf: leaf[lane], (self._state, self._policies))
        return np.asarray(self._all(state, policy, seen, before))


def values_of(run: Run) -> Values | None:
    """The values that the learner of a run knows, of all its lanes; `None` where it has no critic of situations, and,
    with a warning, where it cannot be rebuilt, as parts of it were made in Python."""
    if not run.critic:
        return None
    try:
        agent = saved_agent(run.task, run.config["agent"], "agent")
    except RunDirectoryError as error:
        warnings.warn(f"no column `value`: {error}", RunWarning, stacklevel=4)
        return None
    if agent.critic is None:
        return None
    where = operator.attrgetter(agent.critic)
    baseline = where(agent)
    if not isinstance(baseline, Critic | InputBaseline):
        return None
    one = where(jax.eval_shape(agent.init, jax.random.key(0)))
    # of several environments that fed a learner, the first stands for those parts that each has for itself
    sizes = {name: leaf.ndim + 1 for name, leaf in numbers_of(one).items()}
    stored = {name: each[:, 0] if each.ndim > sizes.get(name, 0) else each for name, each in run.critic.items()}
    template = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct((run.lanes, *leaf.shape), leaf.dtype), one)
    return Values(baseline, fill_tree(template, stored), run.policies)
