"""A learner that has stopped learning: its policy acts, by drawn actions or by the most probable ones."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from motorgrad._branching import any_of, where
from motorgrad.learning import NEVER, Decision, Learner, Transition, first_decision, with_decision
from motorgrad.policies import Policy, abilities, with_interface


class FrozenState(NamedTuple):
    """The policy; where it has hidden units or a memory, what it saw and drew at the newest decision; its memory."""

    policy: Policy
    decision: Decision | None = None
    memory: Float[Array, " memory"] | None = None


class Frozen:
    """What engines know of a learner, for the policy of another one, which acts and never learns.

    **Arguments:** the `learner` whose first policy it takes until `set_policy` brings in another; whether to take the
    most probable actions (`greedy`) or to draw them.
    """

    def __init__(self, learner: Learner, greedy: bool):
        self._learner = learner
        self._greedy = greedy

    def init(self, key: jax.Array) -> FrozenState:
        policy = self._learner.init(key).policy
        return FrozenState(policy, first_decision(policy), abilities.initial_memory(policy))

    def act(
        self, state: FrozenState, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> tuple[FrozenState, Array]:
        policy = state.policy
        seen = abilities.observation_with_memory(policy, state.memory, observation)
        action = policy.mode(seen) if self._greedy else policy.sample(seen, uniforms)
        state = with_decision(state, seen, action)
        return state._replace(memory=abilities.remember(policy, seen, action)), abilities.task_action(policy, action)

    def observe(self, state: FrozenState, transition: Transition) -> FrozenState:
        ended = any_of(transition.terminated, transition.truncated, transition.diverged)
        return self.restart(state, ended)

    def restart(self, state: FrozenState, ended: Any = True) -> FrozenState:
        return state._replace(memory=where(ended, abilities.initial_memory(state.policy), state.memory))

    def update(self, state: FrozenState) -> FrozenState:
        return state

    def decisions_until_due(self, state: FrozenState) -> Int[Array, ""]:
        return jnp.asarray(NEVER, jnp.int32)

    def readings(self, state: FrozenState) -> dict[str, Array]:
        return {}

    def final_policy(self, state: FrozenState) -> Policy:
        return state.policy

    def set_policy(self, state: FrozenState, policy: Policy) -> FrozenState:
        return state._replace(policy=with_interface(policy, None))
