"""One decision: what happens between two observations, for one seed.

The engines for worlds and for bodies differ only in who steps the dynamics; both call the functions here:

    act ──▶ (dynamics step) ──▶ observe ──▶ update ──▶ [new episode where one has ended] ──▶ act

Of a learner it knows the five functions of `motorgrad.learning.Learner`.
"""

import dataclasses
import functools
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._branching import any_of
from motorgrad._goal import Goal
from motorgrad._interface import Statistics
from motorgrad.learning import Learner, Transition, two_sum
from motorgrad.policies import abilities
from motorgrad.schema import Numbers
from motorgrad.tasks import Task, observe, outcome
from motorgrad.training.engines._frozen import Frozen

Mode = Literal["learn", "sample", "mode", "given"]
"""Learn; or act by a frozen policy, with sampled actions or the most probable ones; or take actions that are given."""

Flag = Bool[Array, ""] | bool
MAX_TALLY_DECISIONS = 2**31 - 1
"""Decisions that one `Tally` counts."""


class Tally(NamedTuple):
    """Sums since the last record, for one seed, in few arrays, which make a fast call: of the reward and of each
    metric; what rounding took from them; and how often each metric occurred, episodes ended and the simulation
    diverged. Before the last two, where only the first episode is counted, the number of its decisions."""

    sums: Float[Array, " 1+metrics"]
    carry: Float[Array, " 1+metrics"]
    counts: Int[Array, " _"]


class CycleState(NamedTuple):
    """What one seed carries from decision to decision, beside the dynamics' own state.

    - `agent`: the state of the learner; `numbers`, its hyperparameters, in the order of `Cycle.numbers`.
    - `memory`: what the task remembers; `observation` and `action`, the present ones.
    - `elapsed`: decisions since the start of the episode, where the task has a time limit.
    - `tally`: sums for the next record.
    - `raw`: the present observation in the task's own units, where the learner needs that, too: see `Cycle.keeps_raw`.
    """

    agent: Any
    numbers: Float[Array, " numbers"]
    memory: Any
    observation: Float[Array, " inputs"]
    action: Array
    elapsed: Int[Array, ""] | None
    tally: Tally
    raw: Float[Array, " inputs"] | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class Cycle:
    """The decision of a learner, `agent`, on `task`, as pure functions. The learner gives the structure. Its numbers
    are those of each seed's state, so that one compiled program serves all values."""

    task: Task
    agent: Learner
    mode: Mode = "learn"
    diverges: bool = False
    """Whether the dynamics can diverge and say so."""
    first_episode: bool = False
    """Whether to count the decisions of the first episode alone."""

    @functools.cached_property
    def numbers(self) -> Numbers:
        """The order of the hyperparameters in the vector of a state."""
        return Numbers(self.agent.hyperparameters)

    def acting(self, agent: Learner) -> Any:
        """What chooses actions: the learner, or its policy alone where nothing is to be learned."""
        return agent if self.mode == "learn" else Frozen(agent, self.mode == "mode")

    def learner(self, cycle: CycleState) -> Any:
        """What chooses actions, with the numbers of a state."""
        return self.acting(self.agent.with_numbers(self.numbers, cycle.numbers))

    @functools.cached_property
    def waits(self) -> bool:
        """Whether there are decisions without an update; `decisions_until_due` counts them."""
        found: list[object] = []

        def trace() -> None:
            acting = self.acting(self.agent)
            found.append(acting.decisions_until_due(acting.init(jax.random.key(0))))

        jax.eval_shape(trace)
        return not isinstance(found[0], int)

    @functools.cached_property
    def keeps_raw(self) -> bool:
        """Whether the learner gets observations in the task's own units beside those that are scaled: it needs a goal,
        whose errors have these units. In every mode, so that a run can be frozen and learn on."""
        return self.agent.needs.goal is not None and self.task.observation_code.scales

    @property
    def restarts(self) -> bool:
        """Whether the dynamics are ever reset: at the end of an episode, or where they diverged."""
        return self.task.has_episodes or self.diverges

    def blank(
        self,
        agent: Any,
        numbers: Float[Array, " numbers"],
        init: Float[Array, " _"],
        statistics: Statistics | None = None,
    ) -> CycleState:
        """The state before the first observation, with the running `statistics` of earlier ones, which a policy that
        does not learn leaves as they are."""
        memory = self.task.init(init)
        observation = jnp.zeros(self.task.observation_size)
        if statistics is not None:
            memory = self.task.with_statistics(memory, statistics)
            memory = memory if self.mode == "learn" else self.task.freeze(memory)
        policy = agent.policy
        seen = abilities.observation_with_memory(policy, abilities.initial_memory(policy), observation)
        action = abilities.task_action(policy, policy.mode(seen))
        metrics = len(self.task.metric_names)
        zero = jnp.zeros(1 + metrics)
        tally = Tally(zero, zero, jnp.zeros(metrics + 2 + self.first_episode, jnp.int32))
        elapsed = jnp.zeros((), jnp.int32) if self.task.episode_limit else None
        raw = jnp.zeros_like(observation) if self.keeps_raw else None
        return CycleState(agent, numbers, memory, observation, jnp.zeros_like(action), elapsed, tally, raw)

    def observe(self, cycle: CycleState, state: PyTree, uniforms: Float[Array, " _"]) -> CycleState:
        """The state after an observation of the dynamics in `state`."""
        memory, observation = observe(self.task, cycle.memory, state, uniforms)
        return cycle._replace(memory=memory, observation=observation, raw=self._raw(memory, state, uniforms))

    def _raw(self, memory: PyTree, state: PyTree, uniforms: Float[Array, " _"]) -> Float[Array, " inputs"] | None:
        return self.task.sense(memory, state, uniforms)[1] if self.keeps_raw else None

    def belongs(self, cycle: CycleState, init: Float[Array, " _"], uniforms: Float[Array, " _"]) -> list[bool]:
        """Which leaves of a state belong to the environment that acts, where several feed one learner: those that an
        action or a new episode changes. What is learned is changed by neither, and shared."""
        acted = self.act(cycle, uniforms)
        after = acted._replace(
            agent=self.learner(cycle).restart(acted.agent),
            memory=self.task.renew(acted.memory, init),
            observation=jnp.zeros_like(acted.observation),
            action=jnp.zeros_like(acted.action),
            elapsed=None if acted.elapsed is None else jnp.zeros_like(acted.elapsed),
            raw=None if acted.raw is None else jnp.zeros_like(acted.raw),
        )
        pairs = zip(jax.tree.leaves(cycle), jax.tree.leaves(after), strict=True)
        return [before is not after for before, after in pairs]

    def resume_from(
        self, cycle: CycleState, memory: PyTree, state: PyTree, init: Float[Array, " _"], uniforms: Float[Array, " _"]
    ) -> CycleState:
        """Before the first decision: continue from the `memory` of the task at the end of a run, frozen unless the
        policy learns on."""
        memory = self.task.renew(memory, init)
        memory = memory if self.mode == "learn" else self.task.freeze(memory)
        return self.observe(cycle._replace(memory=memory), state, uniforms)

    def read_tally(self, tally: Tally) -> dict[str, Array]:
        """A tally by name: the sum of rewards, the mean of each metric (NaN if it never occurred) and its count, and
        the numbers of episodes and divergences where the task can have them."""
        found = {"reward": tally.sums[0]}
        if self.first_episode:
            found["decisions"] = tally.counts[-3]
        if self.task.has_episodes:
            found["episodes"] = tally.counts[-2]
        if self.diverges:
            found["diverged"] = tally.counts[-1]
        for index, name in enumerate(self.task.metric_names):
            found[name] = tally.sums[1 + index] / tally.counts[index]
            found[f"{name}_count"] = tally.counts[index]
        return found

    def act(self, cycle: CycleState, uniforms: Float[Array, " _"]) -> CycleState:
        """Choose an action on the present observation, unless it is given."""
        if self.mode == "given":
            return cycle
        agent, action = self.learner(cycle).act(cycle.agent, cycle.observation, uniforms)
        return cycle._replace(agent=agent, action=action)

    def learn(
        self,
        cycle: CycleState,
        state: PyTree,
        uniforms: Float[Array, " _"],
        diverged: Flag = False,
        update: bool = True,
    ) -> tuple[CycleState, Flag]:
        """Observe what the action led to and learn from it. Also returns whether the episode is over. Without `update`
        the learner's update is left out, which would change nothing at this decision, as `decisions_until_due` has
        said."""
        led = outcome(self.task, cycle.memory, state, cycle.action, uniforms, cycle.elapsed)
        ended = any_of(led.terminated, led.truncated, diverged)
        learner = self.learner(cycle)
        raw = self._raw(led.memory, state, uniforms)
        transition = Transition(
            cycle.observation,
            cycle.action,
            led.reward,
            led.observation,
            led.terminated,
            led.truncated,
            diverged,
            raw=cycle.raw,
            next_raw=raw,
        )
        agent = learner.observe(cycle.agent, transition)
        if update and self.mode == "learn" and self.agent.needs.goal is not None:
            agent = learner.update(agent, self.goal(led.memory))
        elif update:
            agent = learner.update(agent)
        tally = self._count(cycle.tally, led.memory, state, led.reward, ended, diverged)
        after = CycleState(agent, cycle.numbers, led.memory, led.observation, cycle.action, led.elapsed, tally, raw)
        return after, ended

    def goal(self, memory: PyTree) -> Goal | None:
        """The goal of the task, which shows observations in its own units as policies see them now."""
        goal = self.task.goal
        if goal is None or not self.keeps_raw:
            return goal
        mean, variance = self.task.statistics(memory) or (None, None)
        return goal._replace(shown=functools.partial(self.task.observation_code.encode, mean, variance))

    def decisions_until_due(self, cycle: CycleState) -> int | Int[Array, ""]:
        """How many decisions at least can be learned from without an update."""
        return self.learner(cycle).decisions_until_due(cycle.agent)

    def restart(
        self,
        cycle: CycleState,
        state: PyTree,
        where: Bool[Array, ""],
        init: Float[Array, " _"],
        uniforms: Float[Array, " _"],
    ) -> CycleState:
        """Begin a new episode `where` one has ended and the dynamics were reset to `state`."""
        elapsed = None if cycle.elapsed is None else jnp.zeros_like(cycle.elapsed)
        renewed = cycle._replace(memory=self.task.renew(cycle.memory, init), elapsed=elapsed)
        fresh = self.observe(renewed, state, uniforms)
        return jax.tree.map(lambda new, old: jnp.where(where, new, old), fresh, cycle)

    def _count(
        self, tally: Tally, memory: PyTree, state: PyTree, reward: Float[Array, ""], ended: Flag, diverged: Flag
    ) -> Tally:
        kept = True if diverged is False else ~jnp.asarray(diverged)
        named = self.task.metrics(memory, state)
        metrics = [named[name] for name in self.task.metric_names]
        occurred = [jnp.logical_and(happened, kept) for _, happened in metrics]
        sums = [jnp.where(kept, reward, 0.0)]
        sums += [jnp.where(yes, value, 0.0) for yes, (value, _) in zip(occurred, metrics, strict=True)]
        decision = [True] if self.first_episode else []
        counts = jnp.stack([jnp.asarray(flag, jnp.int32) for flag in (*occurred, *decision, ended, diverged)])
        counted = Tally(*two_sum(tally.sums, tally.carry, jnp.stack(sums)), tally.counts + counts)
        if not self.first_episode:
            return counted
        return jax.tree.map(lambda new, old: jnp.where(tally.counts[-2] > 0, old, new), counted, tally)
