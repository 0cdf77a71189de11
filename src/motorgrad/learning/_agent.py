r"""The learner: act, reinforce, improve.

    observation ──▶ act ──▶ action ──▶ (the task) ──▶ reward ──▶ reinforce ──▶ gradient sample ──▶ improve
                     └──────── score ──▶ trace ─────────────────▲

Three pure functions of one state, so that an online learner calls all three at every decision and a batch learner the
third once in a while (section 3.2.2 of the thesis). Nothing here knows the task.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._errors import check
from motorgrad._goal import Goal
from motorgrad._running import RunningMean, add_sample, counted_on, running_mean
from motorgrad.learning._baselines import Transition
from motorgrad.learning._branching import NEVER, Flag, any_of, where, where_any
from motorgrad.learning._chain import SGD, Chain, Optimizer, PolyakAveraging, Transformation, as_transformation
from motorgrad.learning._estimator import Estimator, EstimatorState
from motorgrad.learning._natural import Metric
from motorgrad.learning._schedules import Steps, changes
from motorgrad.learning.growth import Growth, GrowthState
from motorgrad.policies import InitialPolicy, Policy, abilities, split, trainable, with_frozen_functions, with_interface
from motorgrad.schema import Numbers, Part, inner


class Decision(NamedTuple):
    """The observation of the units, the action that they drew, and the random numbers if the estimator needs them."""

    observation: Float[Array, " inputs"]
    action: Array
    uniforms: Float[Array, " uniforms"] | None = None


class AgentState(NamedTuple):
    r"""Everything a learner carries from one decision to the next, for one seed. An absent part has the state `None`.

    - `policy`: the parameters.
    - `estimator`: the state of trace, baseline and normalization.
    - `gradient`: the running mean of the samples $g = \delta z$ since the last step; of $\delta$ alone where a batch is
      used again. For an online learner it is the sample between `reinforce` and `improve`, which uses it up.
    - `chain`: the states of the gradient transformations.
    - `decision`: the decision that awaits its reward, where a part recalls it or the policy has hidden units or a
      memory.
    - `steps`: how often the parameters have moved, where a part depends on it; 2,147,483,647 from there on.
    - `growth`: the state of a learner that grows.
    - `index`: what a sparse learner knows of its units.
    - `memory`: what the policy remembers of the episode, where it has a memory.
    """

    policy: Policy
    estimator: EstimatorState
    gradient: PyTree[Array] | RunningMean | None
    chain: tuple[PyTree, ...]
    decision: Decision | None = None
    steps: Steps = None
    growth: GrowthState | None = None
    index: PyTree = None
    memory: Float[Array, " memory"] | None = None


def _ready(policy: object) -> Any:
    """A policy whose leaves are arrays, also where it holds an `eqx.nn.MLP`; anything else as it is."""
    return with_frozen_functions(policy) if isinstance(policy, Policy) else policy


class Agent(Part):
    """A learner: what acts, how credit is assigned, and how parameters move.

    It is one tree of parts. Numbers are leaves: they may differ by seed, and change while the learner runs. Structure
    is static: the kinds of parts, lengths, intervals and counts. A part that is absent is `None`.

    ```python
    agent = mg.Agent(
        policy=mg.policies.hyperplanes(task),
        estimator=mg.learning.olgarb(decay=0.995),
        optimizer=mg.learning.SGD(5e-4),
    )
    ```

    Its methods are pure functions. Compile them with `equinox.filter_jit(agent.improve)`: `jax.jit` refuses a bound
    method of a tree that holds arrays, because it cannot hash them.
    """

    aliases: ClassVar[Mapping[str, str]] = {
        "units": "policy.units",
        "trace": "estimator.trace",
        "decay": "estimator.trace.decay",
        "baseline": "estimator.baseline",
        "discount": "estimator.discount",
        "improve": "estimator.improve",
        "batch": "estimator.batch",
        "entropy": "estimator.entropy",
        "normalization": "estimator.normalization",
        "learning_rate": "optimizer.learning_rate",
        "weight_decay": "optimizer.weight_decay",
        "damping": "metric.damping",
    }
    """Short names of the settings that everyone types, for options, TOML and `agent_for`."""

    policy: InitialPolicy | Any = inner(
        converter=_ready,
        help="the initial policy, or a function from a key to one, so that every seed starts from its own",
    )
    estimator: Estimator = inner(
        Estimator(), help="how rewards are assigned to decisions: trace, baseline and batch (see `Estimator`, `olgarb`)"
    )
    optimizer: Optimizer = inner(
        SGD(1e-3),
        converter=as_transformation,
        help="how a gradient moves the parameters: `SGD`, `Adam`, or any optax transformation, which receives minus "
        "the gradient",
    )
    metric: Metric | None = inner(
        None, help="none for the plain gradient; a `FisherMetric` for the natural gradient of each unit"
    )
    transformations: tuple[Transformation, ...] = inner(
        (),
        converter=lambda stages: tuple(map(as_transformation, stages)),
        help="further gradient transformations after the optimizer, ours or optax's",
    )
    growth: Growth | None = inner(
        None, help="none for a policy of one size; a `Growth` that adds the units of a `Masked` pool one by one"
    )
    averaging: PolyakAveraging | None = inner(
        None, help="none, or `PolyakAveraging` to keep the mean of the last parameters in place of the last ones"
    )

    def validate(self) -> None:
        made = isinstance(self.policy, Policy) or callable(self.policy)
        check(made, "policy", self.policy, "a policy or a function from a key to one")
        weights = any(map(eqx.is_inexact_array, jax.tree.leaves(self.policy)))
        bare = isinstance(self.policy, eqx.Module) and weights and not isinstance(self.policy, Policy)
        wanted = "a Policy; motorgrad.policies.Network(units, module, observed) puts any module under units"
        check(not bare, "policy", type(self.policy).__name__, wanted)
        for index, stage in enumerate(self.transformations):
            check(isinstance(stage, Transformation), f"transformations.{index}", stage, "a Transformation, or optax's")
        for name in ("growth", "averaging"):
            moves = getattr(self, name) is None or self.estimator.improve != "never"
            check(moves, name, getattr(self, name), 'None where parameters never move, improve = "never"')
        for stage in self._stages().values():
            stage.validate_in(self)
        whole = self.averaging is None or self.growth is None
        check(whole, "averaging", self.averaging, "None where a policy grows")

    @property
    def hyperparameters(self) -> Self:
        """The tree without the policy, whose numbers are learned: its leaves are all numbers that may be changed."""
        return self.with_policy(None)

    def with_policy(self, policy: Policy | Callable[[jax.Array], Policy] | None) -> Self:
        """The agent with another policy, built without its checks: the policy may be traced or absent."""
        made = object.__new__(type(self))
        for field in dataclasses.fields(self):
            object.__setattr__(made, field.name, policy if field.name == "policy" else getattr(self, field.name))
        return made

    def with_numbers(self, numbers: Numbers, vector: Float[Array, " numbers"]) -> Self:
        """The agent with its numbers from a vector, which may be traced."""
        return numbers.tree(vector).with_policy(self.policy)

    @property
    def precision(self) -> np.dtype:
        """The floating-point type of the parameters, to which the numbers are rounded."""
        parameters = jax.eval_shape(lambda: trainable(self._first_policy(jax.random.key(0))))
        return jax.tree.leaves(parameters)[0].dtype

    @property
    def chain(self) -> Chain:
        """The gradient transformations, in their order."""
        return Chain(tuple(self._stages().values()))

    def _stages(self) -> dict[str, Transformation]:
        """The gradient transformations by path."""
        further = {f"transformations.{index}": stage for index, stage in enumerate(self.transformations)}
        found = {"metric": self.metric, "optimizer": self.optimizer, **further, "averaging": self.averaging}
        return {path: stage for path, stage in found.items() if stage is not None}

    @property
    def one_stream(self) -> str | None:
        """The part that needs successive decisions of one environment, in words; `None` where none does."""
        found = [type(stage).__name__ for stage in self._stages().values() if stage.one_stream]
        return self.estimator.one_stream or next(iter(found), None)

    @property
    def needs_goal(self) -> str | None:
        """The setting that needs a task with a goal, by path; `None` where none does."""
        setting = self.estimator.needs_goal
        return None if setting is None else f"estimator.{setting}"

    def needs_episodes(self) -> list[str]:
        """The settings that need a task with episodes."""
        found = {path: stage.needs_episodes for path, stage in self._stages().items()}
        own = [f"{path}.{setting}" for path, setting in found.items() if setting]
        return [*(f"estimator.{setting}" for setting in self.estimator.needs_episodes()), *own]

    def _first_policy(self, key: jax.Array) -> Policy:
        """The policy that the agent was given, or the one that its function draws."""
        policy = self.policy if isinstance(self.policy, Policy) else _ready(self.policy(key))
        if isinstance(policy, Policy):  # what it means to the task is no part of what is learned
            policy = with_interface(policy, None)
        trains = len(jax.tree.leaves(trainable(policy))) > 0
        check(trains, "policy", type(policy).__name__, "a policy with trainable parameters")
        return policy

    def init(self, key: jax.Array) -> AgentState:
        """The state before the first decision; `key` matters where the initial policy is random."""
        policy = self._first_policy(key)
        leaves = jax.tree.leaves(trainable(policy))
        growth = None
        if self.growth is not None:
            growth, policy = self.growth.init(policy, jax.random.fold_in(key, 1))
        zeros = jax.tree.map(jnp.zeros_like, trainable(policy))
        if self.estimator.climbs:
            zeros = jnp.zeros((), leaves[0].dtype)  # no gradient is made before the batch is full
        chain = self.chain
        # Of hidden units and of a memory, the decision tells what was drawn and what was seen.
        kept = abilities.has_hidden_units(policy) or abilities.has_memory(policy)
        decision = None
        if chain.needs_decision or self.estimator.needs_decision or kept:
            observation = jnp.zeros(policy.inputs, leaves[0].dtype)
            uniforms = jnp.zeros(policy.uniforms, leaves[0].dtype) if self.estimator.needs_uniforms else None
            decision = Decision(observation, jnp.zeros_like(policy.mode(observation)), uniforms)
        return AgentState(
            policy=policy,
            estimator=self.estimator.init(policy, jax.random.fold_in(key, 2)),
            gradient=None if self.estimator.online else running_mean(zeros),
            chain=chain.init(policy),
            decision=decision,
            steps=jnp.zeros((), jnp.int32) if chain.needs_steps or changes(self.hyperparameters) else None,
            growth=growth,
            memory=abilities.initial_memory(policy),
        )

    def act(
        self, state: AgentState, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> tuple[AgentState, Array]:
        r"""Sample an action from `uniforms` and add its score to the trace: $z \leftarrow f(z, \nabla\log\pi)$."""
        policy = state.policy
        seen = abilities.observation_with_memory(policy, state.memory, observation)
        action = policy.sample(seen, uniforms)
        score = policy.score(seen, action)
        if state.decision is not None:
            drawn = None if state.decision.uniforms is None else uniforms.astype(state.decision.uniforms.dtype)
            state = state._replace(decision=Decision(seen.astype(state.decision.observation.dtype), action, drawn))
        if self.growth is not None and state.growth is not None:
            state = state._replace(growth=self.growth.observe(state.growth, observation))
        estimator = self.estimator.act(state.estimator, abilities.critic_observation(policy, seen), score)
        memory = abilities.remember(policy, seen, action)
        return state._replace(estimator=estimator, memory=memory), abilities.task_action(policy, action)

    def choose(
        self,
        state: AgentState,
        observation: Float[Array, " inputs"],
        uniforms: Float[Array, " uniforms"],
        greedy: bool = False,
    ) -> tuple[AgentState, Array]:
        """Act without learning: sample an action, or take the most probable one."""
        policy = state.policy
        seen = abilities.observation_with_memory(policy, state.memory, observation)
        action = policy.mode(seen) if greedy else policy.sample(seen, uniforms)
        if state.decision is not None and (abilities.has_hidden_units(policy) or abilities.has_memory(policy)):
            state = state._replace(decision=Decision(seen.astype(state.decision.observation.dtype), action))
        return state._replace(memory=abilities.remember(policy, seen, action)), abilities.task_action(policy, action)

    def reinforce(
        self,
        state: AgentState,
        reward: Float[Array, ""],
        next_observation: Float[Array, " inputs"],
        terminated: Flag = False,
        truncated: Flag = False,
        diverged: Flag = False,
    ) -> AgentState:
        r"""Turn a reward into a gradient sample $g = \delta z$, and let every part learn from the decision.

        `next_observation` is what the world showed *before* any reset. `terminated` says that the episode is over,
        `truncated` that a time limit cut it; either restarts the trace. `diverged` says that the simulation broke: its
        sample is dropped, nothing is learned from it, and the trace restarts.
        """
        recalled: Any = (None, None, None) if state.decision is None else state.decision
        seen = abilities.observation_with_memory(state.policy, state.memory, next_observation)
        state = state._replace(policy=where(diverged, state.policy, abilities.adapted(state.policy, seen)))
        observation, action, uniforms = recalled
        after = abilities.critic_observation(state.policy, seen)
        transition = Transition(observation, action, reward, after, terminated, diverged, uniforms=uniforms)
        sample, estimator = self.estimator.sample(state.estimator, state.policy, transition, state.steps)
        gradient: PyTree = sample
        if isinstance(state.gradient, RunningMean):
            gradient = where(diverged, state.gradient, add_sample(state.gradient, sample))
        else:
            gradient = where(diverged, jax.tree.map(jnp.zeros_like, sample), sample)
        growth = state.growth
        if self.growth is not None and growth is not None:
            growth = where(diverged, growth, self.growth.reinforce(growth, reward))
        chain = self.chain.map(lambda stage, inner: stage.observe(inner, state.policy, transition), state.chain)
        after = state._replace(estimator=estimator, gradient=gradient, chain=chain, growth=growth)
        ended = any_of(terminated, truncated, diverged)
        return after if ended is False else self.restart(after, ended)

    def restart(self, state: AgentState, ended: Flag = True) -> AgentState:
        """Begin a new episode if `ended`: trace and memory are empty, and the discount starts again from 1."""
        chain = self.chain.map(lambda stage, inner: stage.restart(inner, ended), state.chain)
        fresh = self.estimator.restart(state.estimator, state.policy), abilities.initial_memory(state.policy)
        estimator, memory = where(ended, fresh, (state.estimator, state.memory))
        return state._replace(estimator=estimator, memory=memory, chain=chain)

    def final_policy(self, state: AgentState) -> Policy:
        """The policy to keep: the averaged one if there is one, else the one that acts. States of many seeds are
        allowed."""
        return self.chain.final_policy(state.chain, state.policy)

    def set_policy(self, state: AgentState, policy: Policy) -> AgentState:
        """The state with another policy in place, from which averages begin anew. States of many seeds are allowed."""
        policy = with_interface(policy, None)
        chain = self.chain.map(lambda stage, inner: stage.reset(inner, policy), state.chain)
        return state._replace(policy=policy, chain=chain)

    def improve(
        self, state: AgentState, ended: Flag = False, diverged: Flag = False, goal: Goal | None = None
    ) -> AgentState:
        r"""Move the parameters, $\theta \leftarrow \theta + \alpha g$, if the estimator requires a step now, and do
        the periodic work of a critic.

        Call it after every decision, except those that `rest` allows you to skip. A growing learner counts its
        decisions here, and may then add a unit.

        `ended` says whether an episode has just ended, for estimators that improve once an episode; `diverged`, as in
        `reinforce`, that there is no sample: an online learner then does not move, and neither does its momentum. The
        `goal` of the task is for learners that use experience for other targets.
        """
        due = self._due(state, ended)
        chain = self.chain.map(lambda stage, inner: stage.solve(inner, state.policy, due), state.chain)
        state = state._replace(estimator=self.estimator.solve(state.estimator), chain=chain)
        state = self._improve(state, ended, diverged, goal)
        if self.growth is None or state.growth is None:
            return state
        growth, policy, new = self.growth.advance(state.growth, state.policy)
        chain = self.chain.map(lambda stage, inner: stage.after_growth(inner, new), state.chain)
        return state._replace(growth=growth, policy=policy, chain=chain)

    @property
    def rests(self) -> bool:
        """Whether there are decisions that `improve` need not follow; `rest` counts them. Online and growing learners
        have none, and those that improve at the ends of episodes cannot know them beforehand."""
        return not self.estimator.online and self.estimator.improve != "episode" and self.growth is None

    def rest(self, state: AgentState) -> Int[Array, ""]:
        """The least number of coming decisions for which `improve` would change nothing and can be skipped."""
        if not self.rests:
            return jnp.asarray(0, jnp.int32)
        estimator = self.estimator
        rest = jnp.asarray(NEVER, jnp.int32)
        if isinstance(estimator.improve, int) and isinstance(state.gradient, RunningMean):
            rest = estimator.improve - 1 - state.gradient.count.astype(jnp.int32)
        if estimator.baseline is not None:
            rest = jnp.minimum(rest, estimator.baseline.rest(state.estimator.baseline))
        return jnp.minimum(rest, self.chain.rest(state.chain))

    def _due(self, state: AgentState, ended: Flag) -> Flag:
        """Whether the parameters are about to move."""
        if self.estimator.improve == "never" or self.estimator.online:
            return self.estimator.online
        running: Any = state.gradient
        full = ended if self.estimator.improve == "episode" else running.count >= self.estimator.improve
        return False if full is False else jnp.logical_and(full, running.count > 0)

    def _improve(self, state: AgentState, ended: Flag, diverged: Flag, goal: Goal | None) -> AgentState:
        estimator = self.estimator
        if estimator.improve == "never":
            return state
        if estimator.online:
            moved = self._step(state, state.gradient)._replace(gradient=None)
            return moved if diverged is False else where(diverged, state._replace(gradient=None), moved)
        due = self._due(state, ended)
        if due is False:
            return state
        running: Any = state.gradient
        if estimator.climbs:
            moved = self._climbed(state, due, goal)
            return where(due, moved._replace(gradient=running_mean(running.mean)), moved)
        size = running.count.astype(jnp.result_type(float)) if estimator.batch == "sum" else 1.0
        moved = self._step(state, jax.tree.map(lambda mean: (size * mean).astype(mean.dtype), running.mean), due)
        return where(due, moved._replace(gradient=running_mean(running.mean)), state)

    def _climbed(self, state: AgentState, due: Flag, goal: Goal | None) -> AgentState:
        """The state after the steps of `Estimator.climb`, where they are due."""
        estimator, batch = self.estimator, state.estimator.batch
        numbers, structure = jax.tree.flatten(self.hyperparameters)

        def steps(numbers: PyTree, state: AgentState, drawn: PyTree) -> AgentState:
            agent = structure.unflatten(numbers)
            return agent.estimator.climb(state, drawn, agent._step)

        # Mapped over seeds, a product of matrices has one more axis, for which XLA's is several times as slow.
        steps = jax.custom_batching.sequential_vmap(steps) if estimator.seeds_in_turn else steps

        def climb(state: AgentState) -> AgentState:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            state, kept = jax.lax.optimization_barrier((state, batch))
            return steps(numbers, state, estimator.drawn(kept, goal))

        # The loop does not carry the batch: mapped over seeds, it would copy it.
        alone = state._replace(estimator=state.estimator._replace(batch=None))
        moved = where_any(jnp.logical_and(due, estimator.ready(batch)), climb, alone)
        batch = where(due, estimator.used(batch), batch)
        return moved._replace(estimator=moved.estimator._replace(batch=batch))

    def _step(self, state: AgentState, gradient: PyTree[Array], due: Flag = True) -> AgentState:
        parameters, settings = split(state.policy)
        stages = self.chain
        updates, chain = stages.update(gradient, state.chain, state.policy, state.steps, due)
        if self.growth is not None and state.growth is not None:
            updates = self.growth.scale_updates(state.growth, updates)
        updates = stages.constrain(updates, chain, state.policy, state.steps, due)
        moved = abilities.limited(eqx.combine(eqx.apply_updates(parameters, updates), settings))
        steps = None if state.steps is None else counted_on(state.steps)
        chain = stages.map(lambda stage, inner: stage.after_step(inner, moved, steps), chain)
        return state._replace(policy=moved, chain=chain, steps=steps)
