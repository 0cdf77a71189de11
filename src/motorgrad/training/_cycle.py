"""One decision: what happens between two observations, for one seed.

The engines for worlds and for bodies differ only in who moves the dynamics; both go through the functions here:

    act ──▶ (dynamics step) ──▶ settle: reward, observe, reinforce, improve ──▶ [restart where an episode ended] ──▶ act
"""

import dataclasses
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from motorgrad.learning import NEVER, Agent, AgentState, two_sum
from motorgrad.tasks import Task, outcome

Mode = Literal["learn", "sample", "mode"]
"""Learn; or act by a frozen policy, sampled or taking the most probable action."""


class Tally(NamedTuple):
    """Sums since the last record, for one seed, in two vectors (few arrays make a fast call).

    `sums`: the reward's and each reading's, and what rounding took from them, `carry`; `counts`: of each reading's
    occurrences, of episodes ended, of divergences.
    """

    sums: Float[Array, " 1+readings"]
    carry: Float[Array, " 1+readings"]
    counts: Int[Array, " readings+2"]


class CycleState(NamedTuple):
    """What one seed carries from decision to decision, beside the dynamics' own state."""

    agent: AgentState
    memory: Any
    observation: Float[Array, " inputs"]
    action: Array
    elapsed: Int[Array, ""] | None
    tally: Tally


@dataclasses.dataclass(frozen=True, eq=False)
class Cycle:
    """The decision of `agent` on `task`, as pure functions."""

    task: Task
    agent: Agent
    mode: Mode = "learn"
    diverges: bool = False
    """Whether the dynamics can break and say so."""

    @property
    def restarts(self) -> bool:
        """Whether the dynamics are ever put back: at an episode's end, or where they broke."""
        return self.task.has_episodes or self.diverges

    def begin(self, agent: AgentState, state: Any, init: Float[Array, " _"], observe: Float[Array, " _"]) -> CycleState:
        """Before the first decision, the dynamics being in `state`; no action has been taken yet."""
        memory, observation = self.task.observe(self.task.init(init), state, observe)
        policy = agent.policy
        action = policy.mode(observation)
        readings = len(self.task.reports)
        zero = jnp.zeros(1 + readings)
        tally = Tally(zero, zero, jnp.zeros(readings + 2, jnp.int32))
        elapsed = jnp.zeros((), jnp.int32) if self.task.episode_limit else None
        return CycleState(agent, memory, observation, jnp.zeros_like(action), elapsed, tally)

    def adopt(
        self, cycle: CycleState, memory: Any, state: Any, init: Float[Array, " _"], observe: Float[Array, " _"]
    ) -> CycleState:
        """Before the first decision: go on, frozen, from the `memory` that the task had at the end of a run."""
        memory = self.task.freeze(self.task.renew(memory, init))
        memory, observation = self.task.observe(memory, state, observe)
        return cycle._replace(memory=memory, observation=observation)

    def read(self, tally: Tally) -> dict[str, Array]:
        """A tally by name: the reward's sum, each reading's mean (NaN if it never occurred) and count, and episodes and
        divergences where the task can have them."""
        found = {"reward": tally.sums[0]}
        if self.task.has_episodes:
            found["episodes"] = tally.counts[-2]
        if self.diverges:
            found["diverged"] = tally.counts[-1]
        for index, name in enumerate(self.task.reports):
            found[name] = tally.sums[1 + index] / tally.counts[index]
            found[f"{name}_count"] = tally.counts[index]
        return found

    def act(self, cycle: CycleState, uniforms: Float[Array, " _"]) -> CycleState:
        """Choose an action on the present observation."""
        if self.mode == "learn":
            agent, action = self.agent.act(cycle.agent, cycle.observation, uniforms)
            return cycle._replace(agent=agent, action=action)
        policy = cycle.agent.policy
        chosen = policy.mode(cycle.observation) if self.mode == "mode" else policy.sample(cycle.observation, uniforms)
        return cycle._replace(action=chosen)

    def settle(
        self,
        cycle: CycleState,
        state: Any,
        observe: Float[Array, " _"],
        diverged: Bool[Array, ""] | bool = False,
        resting: bool = False,
    ) -> tuple[CycleState, Bool[Array, ""] | bool]:
        """Take in what the action led to, and learn from it; also says whether the episode is over.

        `resting`: without `Agent.improve`, which at this decision has nothing to do, as `rest` has said.
        """
        led = outcome(self.task, cycle.memory, state, cycle.action, observe, cycle.elapsed)
        agent = cycle.agent
        ended: Any = False
        for flag in (led.terminated, led.truncated, diverged):
            if flag is not False:
                ended = flag if ended is False else ended | flag
        if self.mode == "learn":
            told = (led.reward, led.observation, led.terminated, led.truncated, diverged)
            agent = self.agent.reinforce(agent, *told)
            agent = agent if resting else self.agent.improve(agent, ended, diverged)
        tally = self._count(cycle.tally, led.memory, state, led.reward, ended, diverged)
        return CycleState(agent, led.memory, led.observation, cycle.action, led.elapsed, tally), ended

    @property
    def rests(self) -> bool:
        """Whether there are decisions that can be settled `resting`: `rest` tells of them."""
        return self.mode != "learn" or self.agent.rests

    def rest(self, cycle: CycleState) -> Int[Array, ""]:
        """How many decisions at least come that can be settled `resting`."""
        return self.agent.rest(cycle.agent) if self.mode == "learn" else jnp.asarray(NEVER, jnp.int32)

    def restart(
        self,
        cycle: CycleState,
        state: Any,
        where: Bool[Array, ""],
        init: Float[Array, " _"],
        observe: Float[Array, " _"],
    ) -> CycleState:
        """Begin a new episode `where` one has ended, the dynamics having been put back to `state`."""
        memory, observation = self.task.observe(self.task.renew(cycle.memory, init), state, observe)
        fresh = cycle._replace(
            memory=memory,
            observation=observation,
            elapsed=None if cycle.elapsed is None else jnp.zeros_like(cycle.elapsed),
        )
        return jax.tree.map(lambda new, old: jnp.where(where, new, old), fresh, cycle)

    def _count(
        self, tally: Tally, memory: Any, state: Any, reward: Float[Array, ""], ended: Any, diverged: Any
    ) -> Tally:
        kept = True if diverged is False else ~jnp.asarray(diverged)
        named = self.task.readings(memory, state)
        readings = [named[name] for name in self.task.reports]
        occurred = [jnp.logical_and(happened, kept) for _, happened in readings]
        sums = [jnp.where(kept, reward, 0.0)]
        sums += [jnp.where(yes, value, 0.0) for yes, (value, _) in zip(occurred, readings, strict=True)]
        counts = jnp.stack([jnp.asarray(flag, jnp.int32) for flag in (*occurred, ended, diverged)])
        return Tally(*two_sum(tally.sums, tally.carry, jnp.stack(sums)), tally.counts + counts)
