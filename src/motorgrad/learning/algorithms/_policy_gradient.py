r"""The policy gradient with traces: the learner of the thesis, online or in batches.

$$z \leftarrow f(z, \nabla\log\pi(a \mid y)),\qquad \delta = r - b,\qquad \theta \leftarrow \theta + \alpha\,\delta z$$

    observation ──▶ act ──▶ action ──▶ (the task) ──▶ reward ──▶ observe ──▶ gradient sample δz ──▶ update
                     └──────── score ──▶ trace z ───────────────▲

An online learner moves at every decision and a batch learner once in a while, by the mean of its samples (section 3.2.2
of the thesis). Every part is a choice: the trace, what rewards are compared with, the metric, the optimizer.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Self

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._branching import NEVER, Flag, any_of, where, where_any
from motorgrad._errors import check
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._accuracy import AccuracyState
from motorgrad.learning._chain import SGD, Optimizer, PolyakAveraging, Transformation
from motorgrad.learning._estimator import Estimator, EstimatorState
from motorgrad.learning._gathered import (
    Gathered,
    decisions_of,
    learn_at_once,
    may_be_judged_later,
    may_gather,
    without_rows,
)
from motorgrad.learning._gradient_learner import (
    GradientLearner,
    averaging_field,
    optimizer_field,
    transformations_field,
)
from motorgrad.learning._learner import Decision, Learner, Needs, Transition, first_decision, with_decision
from motorgrad.learning._natural import Metric
from motorgrad.learning._schedules import Steps
from motorgrad.learning.growth import Growth, GrowthState
from motorgrad.policies import Policy, abilities, trainable
from motorgrad.schema import inner, register, static


class Pending(NamedTuple):
    """What the newest transition means for the update that follows it: whether its episode ended, and whether it
    diverged."""

    ended: Flag
    diverged: Flag


class AgentState(NamedTuple):
    r"""Everything that the policy gradient carries from one decision to the next, for one seed. An absent part has the
    state `None`.

    - `policy`: the parameters.
    - `estimator`: the state of trace, baseline and normalization.
    - `gradient`: the running mean of the samples $g = \delta z$ since the last step. For an online learner it is the
      sample between `observe` and `update`, which uses it up; so is `pending`, also where a step is due at the end of
      an episode.
    - `chain`: the states of the gradient transformations.
    - `decision`: what the units saw and drew, where the policy has hidden units or a memory.
    - `steps`: how often the parameters have moved, where a part depends on it; 2,147,483,647 from there on.
    - `growth`: the state of a learner that grows.
    - `memory`: what the policy remembers of the episode, where it has a memory.
    - `accuracy`: how accurate the gradient is, where that ends a batch.
    - `gathered`: the decisions of the batch, where all are learned from at once. Then there is no `gradient`, and the
      parts of `estimator` are those of the end of the batch before.
    """

    policy: Policy
    estimator: EstimatorState
    gradient: PyTree[Array] | RunningMean | None
    chain: tuple[PyTree, ...]
    decision: Decision | None = None
    steps: Steps = None
    growth: GrowthState | None = None
    memory: Float[Array, " memory"] | None = None
    pending: Pending | None = None
    accuracy: AccuracyState | None = None
    gathered: Gathered | None = None


class Agent(GradientLearner):
    """The policy gradient with traces: what acts, how credit is assigned, and how parameters move.

    ```python
    agent = mg.Agent(
        policy=mg.policies.hyperplanes(task),
        estimator=mg.learning.olgarb(decay=0.995),
        optimizer=mg.learning.SGD(5e-4),
    )
    ```
    """

    aliases: ClassVar[Mapping[str, str]] = {
        "units": "policy.units",
        "trace": "estimator.trace",
        "decay": "estimator.trace.decay",
        "baseline": "estimator.baseline",
        "criterion": "estimator.criterion",
        "discount": "estimator.discount",
        "update_every": "estimator.update_every",
        "reduction": "estimator.reduction",
        "entropy": "estimator.entropy",
        "normalization": "estimator.normalization",
        "learning_rate": "optimizer.learning_rate",
        "weight_decay": "optimizer.weight_decay",
        "damping": "metric.damping",
    }
    critic: ClassVar[str | None] = "estimator.baseline"

    estimator: Estimator = inner(
        Estimator(), help="how rewards are assigned to decisions: trace, baseline and batch (see `Estimator`, `olgarb`)"
    )
    optimizer: Optimizer = optimizer_field(SGD(1e-3))
    metric: Metric | None = inner(
        None, help="none for the plain gradient; a `FisherMetric` for the natural gradient of each unit"
    )
    transformations: tuple[Transformation, ...] = transformations_field()
    growth: Growth | None = inner(
        None, help="none for a policy of one size; a `Growth` that adds the units of a `Masked` pool one by one"
    )
    averaging: PolyakAveraging | None = averaging_field()
    gather: bool = static(
        True,
        help="whether all decisions of a batch are learned from at once, when it is full, where all parts can: "
        "least squares with an interval of `update_every`, an exponential trace, a policy of units without hidden "
        "layers and memory. That is quicker; with false, one after the other, the result differs by rounding alone",
    )

    def validate(self) -> None:
        super().validate()
        every = self.estimator.update_every
        for name in ("growth", "averaging"):
            moves = getattr(self, name) is None or every != "never"
            check(moves, name, getattr(self, name), 'None where parameters never move, update_every = "never"')
        for stage in self.stages.values():
            kind = type(stage).__name__
            wanted = f"1, at every decision, with {kind}; FisherMetric takes batches"
            if stage.steps_from == "batch":
                wanted = f"a batch of more than 1 with {kind}; SGD and Adam step online"
            fits = stage.steps_from == "any" or (every == 1) == (stage.steps_from == "sample")
            check(fits, "estimator.update_every", every, wanted)
            grows = self.growth is not None and not stage.takes_growth
            check(not grows, "growth", type(self.growth).__name__, f"None with {kind}")
        lines = self.metric is not None and self.optimizer.steps_from == "batch"
        check(not lines, "metric", self.metric, f"None with {type(self.optimizer).__name__}; SGD and Adam take one")
        whole = self.averaging is None or self.growth is None
        check(whole, "averaging", self.averaging, "None where a policy grows")

    @property
    def needs(self) -> Needs:
        stages = self.stages
        episodes = [f"estimator.{setting}" for setting in self.estimator.needs_episodes()]
        episodes += [f"{path}.{stage.needs_episodes}" for path, stage in stages.items() if stage.needs_episodes]
        single = [type(stage).__name__ for stage in stages.values() if stage.single_stream]
        single = [self.estimator.single_stream, *single, None if self.growth is None else "a learner that grows"]
        found = next((part for part in single if part is not None), None)
        return Needs(tuple(episodes), single_stream=found, score=True)

    def init(self, key: jax.Array) -> AgentState:
        policy = self.first_policy(key)
        growth = None
        if self.growth is not None:
            growth, policy = self.growth.init(policy, jax.random.fold_in(key, 1))
        zeros = jax.tree.map(jnp.zeros_like, trainable(policy))
        chain = self.chain
        estimator = self.estimator.init(policy, jax.random.fold_in(key, 2))
        gathered = None
        if self.gather and self.growth is None and may_gather(self.estimator) and may_be_judged_later(policy):
            estimator = without_rows(estimator)
            gathered = Gathered.empty(policy, self.estimator.update_every)  # type: ignore[arg-type]
        return AgentState(
            policy=policy,
            estimator=estimator,
            gradient=None if self.estimator.online or gathered is not None else running_mean(zeros),
            chain=chain.init(policy),
            decision=first_decision(policy),
            steps=self.first_steps(),
            growth=growth,
            memory=abilities.initial_memory(policy),
            accuracy=None if self.estimator.accuracy is None else self.estimator.accuracy.init(policy),
            gathered=gathered,
        )

    def act(
        self, state: AgentState, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> tuple[AgentState, Array]:
        r"""Sample an action from `uniforms` and add its score to the trace: $z \leftarrow f(z, \nabla\log\pi)$."""
        policy = state.policy
        seen = abilities.observation_with_memory(policy, state.memory, observation)
        action = policy.sample(seen, uniforms)
        if state.gathered is not None:
            return state, abilities.task_action(policy, action)
        score = policy.score(seen, action)
        state = with_decision(state, seen, action)
        if self.growth is not None and state.growth is not None:
            state = state._replace(growth=self.growth.observe(state.growth, observation))
        estimator = self.estimator.act(state.estimator, abilities.critic_observation(policy, seen), score)
        state = state._replace(estimator=estimator, memory=abilities.remember(policy, seen, action))
        return state, abilities.task_action(policy, action)

    def observe(self, state: AgentState, transition: Transition) -> AgentState:
        r"""Turn a reward into a gradient sample $g = \delta z$, and let every part learn from the decision.

        The end of an episode restarts the trace. What diverged is dropped.
        """
        diverged = transition.diverged
        seen = abilities.observation_with_memory(state.policy, state.memory, transition.next_observation)
        state = state._replace(policy=where(diverged, state.policy, abilities.adapted(state.policy, seen)))
        dtype = jax.tree.leaves(trainable(state.policy))[0].dtype
        decided = Decision(jnp.asarray(transition.observation, dtype), transition.action)
        decided = decided if state.decision is None else state.decision
        transition = transition._replace(
            observation=decided.observation,
            action=decided.action,
            next_observation=abilities.critic_observation(state.policy, seen),
        )
        if state.gathered is not None:
            return self._gathered(state, transition)
        transition, estimator = self.estimator.paid(state.estimator, transition)
        sample, estimator = self.estimator.sample(estimator, state.policy, transition, state.steps)
        if isinstance(state.gradient, RunningMean):
            gradient: PyTree = where(diverged, state.gradient, add_sample(state.gradient, sample))
        else:
            gradient = where(diverged, jax.tree.map(jnp.zeros_like, sample), sample)
        accuracy = state.accuracy
        if self.estimator.accuracy is not None and accuracy is not None:
            accuracy = self.estimator.accuracy.add(accuracy, sample, diverged)
        growth = state.growth
        if self.growth is not None and growth is not None:
            growth = where(diverged, growth, self.growth.add_reward(growth, transition.reward))
        chain = self.chain.map(lambda stage, own: stage.observe(own, state.policy, transition), state.chain)
        after = state._replace(estimator=estimator, gradient=gradient, chain=chain, growth=growth, accuracy=accuracy)
        ended = any_of(transition.terminated, transition.truncated, diverged)
        if self.estimator.online or self.estimator.update_every == "episode":
            after = after._replace(pending=Pending(ended, diverged))
        return after if ended is False else self.restart(after, ended)

    def _gathered(self, state: AgentState, transition: Transition) -> AgentState:
        """The state with one more decision of a batch that will be learned from at once."""

        def observe(stage: Transformation, own: PyTree) -> PyTree:
            return own if stage.takes_batches else stage.observe(own, state.policy, transition)

        assert state.gathered is not None
        chain = self.chain.map(observe, state.chain)
        after = state._replace(chain=chain, gathered=state.gathered.add(transition))
        ended = any_of(transition.terminated, transition.truncated, transition.diverged)
        return after if ended is False else self.restart(after, ended)

    def restart(self, state: AgentState, ended: Flag = True) -> AgentState:
        """Begin a new episode if `ended`: trace and memory are empty, and the discount starts again from 1."""
        chain = self.chain.map(lambda stage, own: stage.restart(own, ended), state.chain)
        if state.gathered is not None:
            return state._replace(chain=chain, gathered=state.gathered.restart(ended))
        fresh = self.estimator.restart(state.estimator, state.policy), abilities.initial_memory(state.policy)
        estimator, memory = where(ended, fresh, (state.estimator, state.memory))
        return state._replace(estimator=estimator, memory=memory, chain=chain)

    def update(self, state: AgentState) -> AgentState:
        r"""Move the parameters, $\theta \leftarrow \theta + \alpha g$, if a step is due, and do the periodic work of a
        critic. A growing learner counts its decisions here, and may then add a unit."""
        if state.gathered is not None:
            return self._learned_at_once(state, state.gathered)
        due = self._due(state)
        chain = self.chain.map(lambda stage, own: stage.solve(own, state.policy, due), state.chain)
        state = state._replace(estimator=self.estimator.solve(state.estimator), chain=chain)
        state = self._moved(state, due)._replace(pending=None)
        if self.growth is None or state.growth is None:
            return state
        growth, policy, new = self.growth.advance(state.growth, state.policy)
        chain = self.chain.map(lambda stage, own: stage.after_growth(own, new), state.chain)
        return state._replace(growth=growth, policy=policy, chain=chain)

    def _learned_at_once(self, state: AgentState, rows: Gathered) -> AgentState:
        """The state after a step of the parameters, and of the critic, where the batch is full."""
        full = rows.waiting >= len(rows.rows)
        numbers = self.hyperparameters

        def learn(old: AgentState) -> AgentState:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            return _of_one_seed(*jax.lax.optimization_barrier((numbers, old, rows, full)))

        learned = where_any(full, learn, state._replace(gathered=None))
        return learned._replace(gathered=rows.emptied(full))

    def after_batch(self, state: AgentState, gathered: Gathered) -> AgentState:
        """The state after all that is learned from a full batch."""
        policy = state.policy
        rows = decisions_of(policy, gathered)
        gradient, estimator = learn_at_once(self.estimator, state.estimator, policy, rows, state.steps)
        if self.estimator.reduction == "sum":
            gradient = jax.tree.map(lambda g: len(rows.ends) * g, gradient)

        def observe(stage: Transformation, own: PyTree) -> PyTree:
            return stage.solve(stage.observe_batch(own, policy, rows.observations, rows.actions), policy, True)

        chain = self.chain.map(observe, state.chain)
        return self.chain.step(state._replace(estimator=estimator, chain=chain), gradient)

    def decisions_until_due(self, state: AgentState) -> int | Int[Array, ""]:
        estimator = self.estimator
        if estimator.online or estimator.update_every == "episode" or self.growth is not None:
            return 0  # the end of an episode cannot be known beforehand
        count = jnp.asarray(NEVER, jnp.int32)
        if state.gathered is not None:
            count = len(state.gathered.rows) - 1 - state.gathered.waiting
            return jnp.minimum(count, self.chain.decisions_until_due(state.chain))
        if isinstance(estimator.update_every, int) and isinstance(state.gradient, RunningMean):
            count = estimator.update_every - 1 - state.gradient.count.astype(jnp.int32)
        if estimator.accuracy is not None and state.accuracy is not None:
            count = jnp.minimum(count, estimator.accuracy.decisions_until_due(state.accuracy))
        if estimator.baseline is not None:
            count = jnp.minimum(count, estimator.baseline.decisions_until_due(state.estimator.baseline))
        return jnp.minimum(count, self.chain.decisions_until_due(state.chain))

    def fed_by_several(self) -> Self:
        """The learner that learns from one decision after the other: each environment has a trace of its own."""
        return dataclasses.replace(self, gather=False)

    def set_policy(self, state: AgentState, policy: Policy) -> AgentState:
        """The state with another policy in place. Gathered decisions are dropped: they are those of the policy before,
        and judged by another they would be credited wrongly."""
        state = super().set_policy(state, policy)
        return state if state.gathered is None else state._replace(gathered=state.gathered.dropped())

    def readings(self, state: AgentState) -> dict[str, Array]:
        """The level of rewards, `baseline`; of a learner that grows the number of `units`, and whether the newest is
        in its `adding` phase; with batches that end by their accuracy, the share of `unsure` steps."""
        found = {"baseline": self.estimator.level(state.estimator)}
        if self.estimator.accuracy is not None and state.accuracy is not None:
            found |= self.estimator.accuracy.readings(state.accuracy)
        if self.growth is not None and state.growth is not None:
            found["units"] = jnp.sum(state.policy.active)  # type: ignore[attr-defined]
            found["adding"] = self.growth.adds(state.growth).astype(jnp.int32)
        return found

    def _due(self, state: AgentState) -> Flag:
        """Whether the parameters are about to move."""
        every = self.estimator.update_every
        if every == "never" or self.estimator.online:
            return self.estimator.online
        running: Any = state.gradient
        if every == "episode":
            full = False if state.pending is None else state.pending.ended
        else:
            full = running.count >= every
            if self.estimator.accuracy is not None and state.accuracy is not None:
                full = full | self.estimator.accuracy.reached(state.accuracy)
        return False if full is False else jnp.logical_and(full, running.count > 0)

    def _moved(self, state: AgentState, due: Flag) -> AgentState:
        """The state after a step of the parameters, where it is due."""
        if due is False:
            return state
        growth = self.growth
        grown = state.growth

        def scaled(updates: PyTree[Array]) -> PyTree[Array]:
            return updates if growth is None or grown is None else growth.scale_updates(grown, updates)

        if self.estimator.online:
            moved = self.chain.step(state, state.gradient, scale=scaled)._replace(gradient=None)
            lost = False if state.pending is None else state.pending.diverged
            return moved if lost is False else where(lost, state._replace(gradient=None), moved)
        running: Any = state.gradient
        size = running.count.astype(jnp.result_type(float)) if self.estimator.reduction == "sum" else 1.0
        gradient = jax.tree.map(lambda mean: (size * mean).astype(mean.dtype), running.mean)
        moved = self.chain.step(state, gradient, due, scaled)._replace(gradient=running_mean(running.mean))
        if self.estimator.accuracy is not None and state.accuracy is not None:
            moved = moved._replace(accuracy=self.estimator.accuracy.restart(state.accuracy))
        return where(due, moved, state)


@jax.custom_batching.sequential_vmap
def _of_one_seed(numbers: Agent, state: AgentState, rows: Gathered, full: Array) -> AgentState:
    """The state of one seed after its batch, where that is `full`. Seeds come one after the other, so that the matrices
    of one stay in the processor's cache, and products of matrices round alike for one seed and for many."""
    return jax.lax.cond(full, lambda old: numbers.after_batch(old, rows), lambda old: old, state)


register(Learner, "policy-gradient", Agent)
