r"""The learner: act, reinforce, improve.

    observation ──▶ act ──▶ action ──▶ (the task) ──▶ reward ──▶ reinforce ──▶ gradient sample ──▶ improve
                     └──────── score ──▶ trace ─────────────────▲

Three pure functions of one state, so that an online learner calls all three at every decision and a batch learner the
third once in a while (section 3.2.2 of the thesis). Nothing here knows the task.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float, PyTree

from motorgrad._errors import check
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._ascent import adam, sgd
from motorgrad.learning._estimator import Estimator, Olgarb
from motorgrad.policies import Policy, split, trainable


class AgentState(NamedTuple):
    r"""Everything a learner carries from one decision to the next, for one seed.

    `policy` holds the parameters; `trace` and `baseline` their filter's and baseline's state; `gradient` the running
    mean of the samples $g = \delta z$ since the last step, or for an online learner the sample between `reinforce` and
    `improve`, which spends it, and `None` otherwise; `ascent` the state of the ascent rule; `weight` the discount
    $\gamma^t$ within the episode, `None` without discounting.
    """

    policy: Policy
    trace: PyTree[Array]
    baseline: Any
    gradient: PyTree[Array] | RunningMean | None
    ascent: Any
    weight: Float[Array, ""] | None


Flag = Bool[Array, ""] | bool


@dataclasses.dataclass(frozen=True, eq=False)
class Agent:
    """What acts, how credit is assigned, and how parameters move.

    **Arguments:**

    - `policy`: the initial policy, or a function from a key to one, so that every seed starts from its own.
    - `estimator`: traces, baseline and batch (see `Estimator`, `Olgarb`).
    - `ascent`: an optax transformation (see `sgd`); it receives minus the gradient.
    """

    policy: Policy | Callable[[jax.Array], Policy]
    estimator: Estimator = dataclasses.field(default_factory=Olgarb)
    ascent: optax.GradientTransformation | sgd | adam = dataclasses.field(default_factory=lambda: sgd(1e-3))

    def __post_init__(self) -> None:
        made = isinstance(self.policy, Policy) or callable(self.policy)
        check(made, "policy", self.policy, "a policy or a function from a key to one")
        check(isinstance(self.estimator, Estimator), "estimator", self.estimator, "an Estimator, such as Olgarb()")
        rule = hasattr(self.ascent, "init") and hasattr(self.ascent, "update")
        check(rule, "ascent", self.ascent, "an optax transformation, such as motorgrad.learning.sgd(1e-3)")

    def init(self, key: jax.Array) -> AgentState:
        """The state before the first decision; `key` matters where the initial policy is random."""
        policy = self.policy if isinstance(self.policy, Policy) else self.policy(key)
        parameters = trainable(policy)
        leaves = jax.tree.leaves(parameters)
        check(len(leaves) > 0, "policy", type(policy).__name__, "a policy with trainable parameters")
        dtype = leaves[0].dtype
        zeros = jax.tree.map(jnp.zeros_like, parameters)
        return AgentState(
            policy=policy,
            trace=self.estimator.trace.init(parameters),
            baseline=self.estimator.baseline.init(dtype),
            gradient=None if self.estimator.online else running_mean(zeros),
            ascent=self.ascent.init(parameters),  # type: ignore[arg-type]
            weight=None if self.estimator.discount is None else jnp.ones((), dtype),
        )

    def act(
        self, state: AgentState, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> tuple[AgentState, Array]:
        r"""Sample an action from `uniforms` and take its score into the trace: $z \leftarrow f(z, \nabla\log\pi)$."""
        action = state.policy.sample(observation, uniforms)
        score = state.policy.score(observation, action)
        return state._replace(trace=self.estimator.trace.update(state.trace, score)), action

    def reinforce(
        self,
        state: AgentState,
        reward: Float[Array, ""],
        next_observation: Float[Array, " inputs"],
        terminated: Flag = False,
        truncated: Flag = False,
        diverged: Flag = False,
    ) -> AgentState:
        r"""Turn a reward into a gradient sample: $\delta \leftarrow r - b$, $g \leftarrow \delta z$, then update $b$.

        `next_observation` is what the world showed *before* any reset. `terminated` says that the episode is over,
        `truncated` that a time limit cut it; either restarts the trace. `diverged` says that the simulation broke: its
        sample is dropped (gradient and baseline stay as they were) and the trace restarts.
        """
        del next_observation  # for critics, which bootstrap from it
        estimator = self.estimator
        delta = reward - estimator.baseline.value(state.baseline)
        if state.weight is not None:
            delta = state.weight * delta
        sample = jax.tree.map(lambda z: delta * z, estimator.trace.value(state.trace))
        after = state._replace(
            baseline=estimator.baseline.update(state.baseline, reward),
            gradient=sample if estimator.online else add_sample(_running(state), sample),
            weight=None if state.weight is None else state.weight * (estimator.discount or 1.0),
        )
        if diverged is not False:
            dropped = jax.tree.map(jnp.zeros_like, sample) if estimator.online else state.gradient
            without = after._replace(baseline=state.baseline, gradient=dropped)
            after = _where(diverged, without, after)
        ended = _any(terminated, truncated, diverged)
        return after if ended is False else self.restart(after, ended)

    def restart(self, state: AgentState, ended: Flag = True) -> AgentState:
        """Where `ended`, begin a new episode: the trace is empty and the discount starts again from 1."""
        fresh = state._replace(
            trace=self.estimator.trace.init(trainable(state.policy)),
            weight=None if state.weight is None else jnp.ones_like(state.weight),
        )
        return _where(ended, fresh, state)

    def improve(self, state: AgentState, ended: Flag = False, diverged: Flag = False) -> AgentState:
        r"""Move the parameters, $\theta \leftarrow \theta + \alpha g$, if the estimator says that it is time.

        `ended` says whether an episode has just ended, for estimators that improve once an episode; `diverged`, as in
        `reinforce`, that there is no sample: an online learner then stays where it is, its rule's momentum too.
        """
        estimator = self.estimator
        if estimator.improve == "never":
            return state
        if estimator.online:
            moved = self._step(state, state.gradient)._replace(gradient=None)
            return moved if diverged is False else _where(diverged, state._replace(gradient=None), moved)
        running = _running(state)
        full = ended if estimator.improve == "episode" else running.count >= estimator.improve
        if full is False:
            return state
        due = jnp.logical_and(full, running.count > 0)
        size = running.count.astype(jnp.result_type(float)) if estimator.batch == "sum" else 1.0
        moved = self._step(state, jax.tree.map(lambda mean: (size * mean).astype(mean.dtype), running.mean))
        return _where(due, moved._replace(gradient=running_mean(running.mean)), state)

    def _step(self, state: AgentState, gradient: PyTree[Array]) -> AgentState:
        parameters, settings = split(state.policy)
        descent = jax.tree.map(jnp.negative, gradient)
        updates, ascent = self.ascent.update(descent, state.ascent, parameters)  # type: ignore[arg-type]
        moved = eqx.apply_updates(parameters, updates)
        return state._replace(policy=eqx.combine(moved, settings), ascent=ascent)


def _running(state: AgentState) -> RunningMean:
    assert isinstance(state.gradient, RunningMean)
    return state.gradient


def _any(*flags: Flag) -> Flag:
    """Whether any flag is up; plainly `False` where that is known while tracing, so that no select is compiled."""
    known = [flag for flag in flags if flag is not False]
    if not known:
        return False
    result = known[0]
    for flag in known[1:]:
        result = jnp.logical_or(result, flag)
    return result


def _where(condition: Flag, yes: AgentState, no: AgentState) -> AgentState:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), yes, no)
