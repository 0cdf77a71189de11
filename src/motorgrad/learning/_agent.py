r"""The learner: act, reinforce, improve.

    observation ──▶ act ──▶ action ──▶ (the task) ──▶ reward ──▶ reinforce ──▶ gradient sample ──▶ improve
                     └──────── score ──▶ trace ─────────────────▲

Three pure functions of one state, so that an online learner calls all three at every decision and a batch learner the
third once in a while (section 3.2.2 of the thesis). Nothing here knows the task.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._errors import check
from motorgrad._running import add_sample, running_mean
from motorgrad.learning._agent_state import AgentState, Decision, last_of, no_decision, running_of
from motorgrad.learning._ascent import adam, decayed, sgd
from motorgrad.learning._choose import NEVER, Flag, any_of, where, where_any
from motorgrad.learning._critic import LinearCritic
from motorgrad.learning._estimator import Estimator, Olgarb
from motorgrad.learning._growth import Growth, GrowthState
from motorgrad.learning._input_baselines import InputBaseline
from motorgrad.learning._natural import FisherMetric, FisherState
from motorgrad.learning._sample import gradient_sample, started
from motorgrad.learning._schedule import Annealed, at
from motorgrad.learning._weight_average import WeightAverage
from motorgrad.policies import Policy, split, trainable


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
    - `average`: `None`, or a `WeightAverage` to give away the average of the last policies in place of the last one.
    """

    policy: Policy | Callable[[jax.Array], Policy]
    estimator: Estimator = dataclasses.field(default_factory=Olgarb)
    ascent: optax.GradientTransformation | sgd | adam | decayed = dataclasses.field(default_factory=lambda: sgd(1e-3))
    metric: FisherMetric | None = None
    growth: Growth | None = None
    average: WeightAverage | None = None

    def __post_init__(self) -> None:
        made = isinstance(self.policy, Policy) or callable(self.policy)
        check(made, "policy", self.policy, "a policy or a function from a key to one")
        check(isinstance(self.estimator, Estimator), "estimator", self.estimator, "an Estimator, such as Olgarb()")
        rule = hasattr(self.ascent, "init") and hasattr(self.ascent, "update")
        check(rule, "ascent", self.ascent, "an optax transformation, such as motorgrad.learning.sgd(1e-3)")
        known = self.metric is None or isinstance(self.metric, FisherMetric)
        check(known, "metric", self.metric, "None or a FisherMetric, such as FisherMetric(rate=1e-3)")
        check(self.growth is None or isinstance(self.growth, Growth), "growth", self.growth, "None or a Growth")
        known = self.average is None or isinstance(self.average, WeightAverage)
        check(known, "average", self.average, "None or a WeightAverage")
        for name in ("growth", "average"):
            moves = getattr(self, name) is None or self.estimator.improve != "never"
            check(moves, name, getattr(self, name), 'None where parameters never move, improve = "never"')
        whole = self.average is None or self.growth is None
        check(whole, "average", self.average, "None where a policy grows")

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
        return AgentState(
            policy=policy,
            trace=self.estimator.trace.init(parameters),
            baseline=started(baseline, policy, dtype),
            gradient=None if self.estimator.online else running_mean(zeros),
            ascent=self.ascent.init(parameters),  # type: ignore[arg-type]
            weight=None if self.estimator.discount is None else jnp.ones((), dtype),
            metric=None if self.metric is None else self.metric.init(policy),
            last=no_decision(policy, dtype) if self._recalls else None,
            scale=None if self.estimator.scale is None else self.estimator.scale.init(dtype),
            growth=growth,
            steps=jnp.zeros((), jnp.int32) if self._counts else None,
            average=None if self.average is None else self.average.init(policy),
        )

    @property
    def _recalls(self) -> bool:
        """Whether a decision must be remembered until its reward comes."""
        estimator = self.estimator
        sees = isinstance(estimator.baseline, InputBaseline | LinearCritic)
        return sees or self.metric is not None or estimator.entropy != 0

    @property
    def _counts(self) -> bool:
        """Whether something depends on how often the parameters have moved."""
        limit = None if self.metric is None else self.metric.kl
        return self.average is not None or any(isinstance(x, Annealed) for x in (self.estimator.entropy, limit))

    def act(
        self, state: AgentState, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> tuple[AgentState, Array]:
        r"""Sample an action from `uniforms` and take its score into the trace: $z \leftarrow f(z, \nabla\log\pi)$."""
        action = state.policy.sample(observation, uniforms)
        score = state.policy.score(observation, action)
        last = None if state.last is None else Decision(observation.astype(state.last.observation.dtype), action)
        if self.growth is not None and state.growth is not None:
            state = state._replace(growth=self.growth.see(state.growth, observation))
        if isinstance(self.estimator.baseline, LinearCritic):
            state = state._replace(baseline=self.estimator.baseline.see(state.baseline, observation))
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

        An `InputBaseline` adds to the sample what it knows about the newest action's observation. With a `LinearCritic`
        $\delta$ is its temporal difference. A scale divides the sample by the usual size of the advantages. The entropy
        bonus adds the gradient of the policy's entropy. A metric takes the decision in.

        `next_observation` is what the world showed *before* any reset. `terminated` says that the episode is over,
        `truncated` that a time limit cut it; either restarts the trace. `diverged` says that the simulation broke: its
        sample is dropped (gradient, baseline, scale, metric and what growth knows of rewards stay as they were) and the
        trace restarts.
        """
        estimator = self.estimator
        sample, baseline, scale = gradient_sample(estimator, state, reward, next_observation, terminated, diverged)
        after = state._replace(
            baseline=baseline,
            gradient=sample if estimator.online else add_sample(running_of(state), sample),
            weight=None if state.weight is None else state.weight * (estimator.discount or 1.0),
            metric=self._measure(state, diverged),
            scale=scale,
            growth=self._watch(state, reward),
        )
        if diverged is not False:
            dropped = jax.tree.map(jnp.zeros_like, sample) if estimator.online else state.gradient
            critical = isinstance(estimator.baseline, LinearCritic)  # and has let it pass
            kept = {"baseline": after.baseline if critical else state.baseline, "scale": state.scale}
            without = after._replace(gradient=dropped, growth=state.growth, **kept)
            after = where(diverged, without, after)
        ended = any_of(terminated, truncated, diverged)
        return after if ended is False else self.restart(after, ended)

    def restart(self, state: AgentState, ended: Flag = True) -> AgentState:
        """Where `ended`, begin a new episode: the trace is empty and the discount starts again from 1."""
        baseline = self.estimator.baseline
        fresh = state._replace(
            trace=self.estimator.trace.init(trainable(state.policy)),
            baseline=baseline.restart(state.baseline) if isinstance(baseline, LinearCritic) else state.baseline,
            weight=None if state.weight is None else jnp.ones_like(state.weight),
        )
        return where(ended, fresh, state)

    def kept(self, state: AgentState) -> Policy:
        """The policy to keep: the average one where there is one, else the one that acts. It takes the state of many
        seeds too."""
        if self.average is None or state.average is None:
            return state.policy
        return self.average.kept(state.average, state.policy)

    def use(self, state: AgentState, policy: Policy) -> AgentState:
        """The state with another policy in place, from which the average begins anew. It takes many seeds too."""
        average = state.average
        if self.average is not None and average is not None:
            average = self.average.begin_from(average, policy)
        return state._replace(policy=policy, average=average)

    def improve(self, state: AgentState, ended: Flag = False, diverged: Flag = False) -> AgentState:
        r"""Move the parameters, $\theta \leftarrow \theta + \alpha g$, if the estimator says that it is time; and solve
        for a critic's weights, if it is time for that.

        It is to be called after every decision but those that `rest` tells of. A growing learner counts its decisions
        here, and may then add a unit.

        `ended` says whether an episode has just ended, for estimators that improve once an episode; `diverged`, as in
        `reinforce`, that there is no sample: an online learner then stays where it is, its rule's momentum too.
        """
        if isinstance(self.estimator.baseline, LinearCritic):
            state = state._replace(baseline=self.estimator.baseline.solve(state.baseline))
        return self._grow(self._improve(state, ended, diverged))

    @property
    def rests(self) -> bool:
        """Whether there are decisions that `improve` need not follow, and `rest` tells of them. There are none for
        online and for growing learners; at the ends of episodes it is not known beforehand."""
        return not self.estimator.online and self.estimator.improve != "episode" and self.growth is None

    def rest(self, state: AgentState) -> Int[Array, ""]:
        """How many decisions at least come before the one that `improve` is to follow: after those it would change
        nothing, however they go, and need not be called."""
        estimator = self.estimator
        rest = jnp.asarray(NEVER if self.rests else 0, jnp.int32)
        if not self.rests:
            return rest
        if isinstance(estimator.improve, int):
            rest = estimator.improve - 1 - running_of(state).count.astype(jnp.int32)
        if isinstance(estimator.baseline, LinearCritic):
            rest = jnp.minimum(rest, estimator.baseline.rest(state.baseline))
        return rest

    def _improve(self, state: AgentState, ended: Flag, diverged: Flag) -> AgentState:
        estimator = self.estimator
        if estimator.improve == "never":
            return state
        if estimator.online:
            moved = self._step(state, state.gradient)._replace(gradient=None)
            return moved if diverged is False else where(diverged, state._replace(gradient=None), moved)
        running = running_of(state)
        full = ended if estimator.improve == "episode" else running.count >= estimator.improve
        if full is False:
            return state
        due = jnp.logical_and(full, running.count > 0)
        size = running.count.astype(jnp.result_type(float)) if estimator.batch == "sum" else 1.0
        moved = self._step(state, jax.tree.map(lambda mean: (size * mean).astype(mean.dtype), running.mean), due)
        return where(due, moved._replace(gradient=running_mean(running.mean)), state)

    def _grow(self, state: AgentState) -> AgentState:
        if self.growth is None or state.growth is None:
            return state
        growth, policy, new = self.growth.advance(state.growth, state.policy)
        metric = state.metric
        if self.metric is not None and metric is not None:
            metric = self.metric.renew(metric, new)
        return state._replace(growth=growth, policy=policy, metric=metric)

    def _measure(self, state: AgentState, diverged: Flag) -> FisherState | None:
        if self.metric is None or state.metric is None:
            return None
        return self.metric.update(state.metric, state.policy, *last_of(state), diverged)

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
        updates = self._bounded(state, updates, due)
        moved = eqx.combine(eqx.apply_updates(parameters, updates), settings).limited()
        return self._noted(state._replace(policy=moved, ascent=ascent))

    def _bounded(self, state: AgentState, step: PyTree[Array], due: Flag) -> PyTree[Array]:
        """A step within the limit on its divergence, where there is one."""
        metric, measured = self.metric, state.metric
        if metric is None or metric.kl is None or measured is None:
            return step
        limit = at(metric.kl, state.steps)

        def bounded(step: PyTree[Array]) -> PyTree[Array]:
            return metric.bounded(*jax.lax.optimization_barrier((measured, state.policy, step, limit)))

        return where_any(due, bounded, step)

    def _noted(self, state: AgentState) -> AgentState:
        """What depends on how often the parameters have moved, once they have."""
        if state.steps is None:
            return state
        steps, average = state.steps + 1, state.average
        if self.average is not None and average is not None:
            average = self.average.update(average, state.policy, steps)
        return state._replace(steps=steps, average=average)
