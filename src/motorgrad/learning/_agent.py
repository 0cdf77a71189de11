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
from motorgrad.learning._ascent import adam, decayed, sgd
from motorgrad.learning._estimator import Estimator, Olgarb
from motorgrad.learning._growth import Growth, GrowthState
from motorgrad.learning._input_baselines import InputBaseline
from motorgrad.learning._natural import FisherMetric, FisherState
from motorgrad.learning._scale import ScaleState
from motorgrad.policies import Policy, split, trainable


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
    the decision whose reward is awaited, `None` where neither metric nor baseline asks for it; `scale` that of the
    advantages, `None` where they are not normalised; `growth` that of a growing learner, else `None`; `index` what an
    `IndexedAgent` knows of its units, else `None`.
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


Flag = Bool[Array, ""] | bool
Credit = Callable[[PyTree[Array], Float[Array, ""]], PyTree[Array]]


@dataclasses.dataclass(frozen=True, eq=False)
class Agent:
    """What acts, how credit is assigned, and how parameters move.

    **Arguments:**

    - `policy`: the initial policy, or a function from a key to one, so that every seed starts from its own.
    - `estimator`: traces, baseline and batch (see `Estimator`, `Olgarb`).
    - `ascent`: an optax transformation (see `sgd`); it receives minus the gradient.
    - `metric`: `None` for the plain gradient; a `FisherMetric` for the natural gradient of each unit, which the ascent
      rule then receives in its place.
    - `growth`: `None` for a policy of one size; a `Growth` to add the units of a `Masked` pool one by one.
    """

    policy: Policy | Callable[[jax.Array], Policy]
    estimator: Estimator = dataclasses.field(default_factory=Olgarb)
    ascent: optax.GradientTransformation | sgd | adam | decayed = dataclasses.field(default_factory=lambda: sgd(1e-3))
    metric: FisherMetric | None = None
    growth: Growth | None = None

    def __post_init__(self) -> None:
        made = isinstance(self.policy, Policy) or callable(self.policy)
        check(made, "policy", self.policy, "a policy or a function from a key to one")
        check(isinstance(self.estimator, Estimator), "estimator", self.estimator, "an Estimator, such as Olgarb()")
        rule = hasattr(self.ascent, "init") and hasattr(self.ascent, "update")
        check(rule, "ascent", self.ascent, "an optax transformation, such as motorgrad.learning.sgd(1e-3)")
        known = self.metric is None or isinstance(self.metric, FisherMetric)
        check(known, "metric", self.metric, "None or a FisherMetric, such as FisherMetric(rate=1e-3)")
        check(self.growth is None or isinstance(self.growth, Growth), "growth", self.growth, "None or a Growth")
        moves = self.growth is None or self.estimator.improve != "never"
        check(moves, "growth", self.growth, 'None where parameters never move, improve = "never"')

    def init(self, key: jax.Array) -> AgentState:
        """The state before the first decision; `key` matters where the initial policy is random."""
        policy = self.policy if isinstance(self.policy, Policy) else self.policy(key)
        parameters = trainable(policy)
        leaves = jax.tree.leaves(parameters)
        check(len(leaves) > 0, "policy", type(policy).__name__, "a policy with trainable parameters")
        growth = None
        if self.growth is not None:
            growth, policy = self.growth.init(policy, jax.random.fold_in(key, 1))
            parameters = trainable(policy)
        dtype = leaves[0].dtype
        zeros = jax.tree.map(jnp.zeros_like, parameters)
        baseline = self.estimator.baseline
        sees = isinstance(baseline, InputBaseline)
        return AgentState(
            policy=policy,
            trace=self.estimator.trace.init(parameters),
            baseline=baseline.init(dtype, policy.inputs) if sees else baseline.init(dtype),
            gradient=None if self.estimator.online else running_mean(zeros),
            ascent=self.ascent.init(parameters),  # type: ignore[arg-type]
            weight=None if self.estimator.discount is None else jnp.ones((), dtype),
            metric=None if self.metric is None else self.metric.init(policy),
            last=_no_decision(policy, dtype) if sees or self.metric is not None else None,
            scale=None if self.estimator.scale is None else self.estimator.scale.init(dtype),
            growth=growth,
        )

    def act(
        self, state: AgentState, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> tuple[AgentState, Array]:
        r"""Sample an action from `uniforms` and take its score into the trace: $z \leftarrow f(z, \nabla\log\pi)$."""
        action = state.policy.sample(observation, uniforms)
        score = state.policy.score(observation, action)
        last = None if state.last is None else Decision(observation.astype(state.last.observation.dtype), action)
        if self.growth is not None and state.growth is not None:
            state = state._replace(growth=self.growth.see(state.growth, observation))
        return state._replace(trace=self.estimator.trace.update(state.trace, score), last=last), action

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

        An `InputBaseline` adds to the sample what it knows about the newest action's observation. A scale divides the
        sample by the usual size of the advantages. A metric takes the decision in.

        `next_observation` is what the world showed *before* any reset. `terminated` says that the episode is over,
        `truncated` that a time limit cut it; either restarts the trace. `diverged` says that the simulation broke: its
        sample is dropped (gradient, baseline, scale, metric and what growth knows of rewards stay as they were) and the
        trace restarts.
        """
        del next_observation  # for critics, which bootstrap from it
        estimator = self.estimator
        sample, baseline, scale = self._compare(state, reward)
        after = state._replace(
            baseline=baseline,
            gradient=sample if estimator.online else add_sample(_running(state), sample),
            weight=None if state.weight is None else state.weight * (estimator.discount or 1.0),
            metric=self._measure(state),
            scale=scale,
            growth=self._watch(state, reward),
        )
        if diverged is not False:
            dropped = jax.tree.map(jnp.zeros_like, sample) if estimator.online else state.gradient
            kept = {"baseline": state.baseline, "metric": state.metric, "scale": state.scale}
            kept["growth"] = state.growth
            without = after._replace(gradient=dropped, **kept)
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

        A growing learner counts its decisions here, so it is to be called at every one; it may then add a unit.

        `ended` says whether an episode has just ended, for estimators that improve once an episode; `diverged`, as in
        `reinforce`, that there is no sample: an online learner then stays where it is, its rule's momentum too.
        """
        return self._grow(self._improve(state, ended, diverged))

    def _improve(self, state: AgentState, ended: Flag, diverged: Flag) -> AgentState:
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
        moved = self._step(state, jax.tree.map(lambda mean: (size * mean).astype(mean.dtype), running.mean), due)
        return _where(due, moved._replace(gradient=running_mean(running.mean)), state)

    def _grow(self, state: AgentState) -> AgentState:
        if self.growth is None or state.growth is None:
            return state
        growth, policy, new = self.growth.advance(state.growth, state.policy)
        metric = state.metric
        if self.metric is not None and metric is not None:
            metric = self.metric.renew(metric, new)
        return state._replace(growth=growth, policy=policy, metric=metric)

    def _compare(self, state: AgentState, reward: Float[Array, ""]) -> tuple[PyTree[Array], Any, ScaleState | None]:
        """The gradient sample of a reward, and the baseline and the scale afterwards."""
        trace, baseline = self.estimator.trace, self.estimator.baseline
        level = baseline.value(state.baseline)
        if not isinstance(baseline, InputBaseline):
            scale, credit = self._credit(state, reward - level)
            return credit(trace.value(state.trace), reward - level), baseline.update(state.baseline, reward), scale
        observation, action = _last(state)
        expected = baseline.value_at(state.baseline, observation)
        scale, credit = self._credit(state, reward - expected)
        score = state.policy.score(observation, action)
        newest = trace.value(trace.update(trace.init(trainable(state.policy)), score))
        sample = jax.tree.map(
            jnp.add, credit(trace.value(state.trace), reward - level), credit(newest, level - expected)
        )
        return sample, baseline.update(state.baseline, observation, reward), scale

    def _credit(self, state: AgentState, advantage: Float[Array, ""]) -> tuple[ScaleState | None, Credit]:
        """The scale, once it knows this advantage, and what then multiplies an eligibility by its worth."""
        normal, scale, factors = self.estimator.scale, state.scale, []
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

    def _measure(self, state: AgentState) -> FisherState | None:
        if self.metric is None or state.metric is None:
            return None
        return self.metric.update(state.metric, state.policy, *_last(state))

    def _watch(self, state: AgentState, reward: Float[Array, ""]) -> GrowthState | None:
        if self.growth is None or state.growth is None:
            return None
        return self.growth.watch(state.growth, reward)

    def _step(self, state: AgentState, gradient: PyTree[Array], due: Flag = True) -> AgentState:
        parameters, settings = split(state.policy)
        if self.metric is not None and state.metric is not None:
            metric, measured = self.metric, state.metric

            def direction(g: PyTree[Array]) -> PyTree[Array]:
                # The barrier keeps the compiler from solving ahead of the loop in `where_any`.
                return metric.precondition(*jax.lax.optimization_barrier((measured, state.policy, g)))

            gradient = where_any(due, direction, gradient)
        descent = jax.tree.map(jnp.negative, gradient)
        updates, ascent = self.ascent.update(descent, state.ascent, parameters)  # type: ignore[arg-type]
        updates = state.policy.allowed(updates)
        if self.growth is not None and state.growth is not None:
            updates = self.growth.paced(state.growth, updates)
        moved = eqx.apply_updates(parameters, updates)
        return state._replace(policy=eqx.combine(moved, settings).limited(), ascent=ascent)


def _running(state: AgentState) -> RunningMean:
    assert isinstance(state.gradient, RunningMean)
    return state.gradient


def _last(state: AgentState) -> Decision:
    assert state.last is not None
    return state.last


def _no_decision(policy: Policy, dtype: Any) -> Decision:
    observation = jnp.zeros(policy.inputs, dtype)
    return Decision(observation, jnp.zeros_like(policy.mode(observation)))


def where_any(due: Flag, function: Callable[[Any], Any], value: Any) -> Any:
    """`function(value)` where it is `due`. Over many seeds a condition computes both branches, but a loop's body is
    passed over while no seed is due: what is costly is paid once a batch and not at every decision."""
    if due is True:
        return function(value)
    due = jnp.asarray(due)
    return jax.lax.while_loop(
        lambda todo: todo[0], lambda todo: (jnp.zeros_like(due), function(todo[1])), (due, value)
    )[1]


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
