"""What learners share that keep decisions, and learn from batches of them many times (Lin, 1992)."""

import abc
from collections.abc import Mapping
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from motorgrad._branching import any_of, where, where_any
from motorgrad._goal import Goal
from motorgrad.learning._action_value_ensemble import ActionValueEnsemble
from motorgrad.learning._chain import Adam, Optimizer, PolyakAveraging, Transformation
from motorgrad.learning._gradient_learner import (
    GradientLearner,
    averaging_field,
    optimizer_field,
    transformations_field,
)
from motorgrad.learning._learner import Needs, Transition, first_decision, with_decision
from motorgrad.learning._replay import Drawn, Replay
from motorgrad.learning._scaling import RewardScaling
from motorgrad.policies import Policy, abilities, in_batches, trainable
from motorgrad.schema import count, inner


def coded(policy: Policy, action: Array) -> Float[Array, " numbers"]:
    """An action as the numbers that the networks of values see: real numbers as they are, an alternative as a one among
    zeros."""
    if policy.actions != "discrete":
        return action
    return jax.nn.one_hot(action, policy.outputs, dtype=jax.tree.leaves(trainable(policy))[0].dtype)


class ReplayLearner(GradientLearner):
    """A learner that keeps decisions, and learns the values of actions, and a policy, from batches of them.

    A subclass says what it does with a batch, `update_from_batch`. Its state has the fields of `first_fields`. The
    noise of a policy may last: it explores so, and is judged by what it does on average (`abilities.marginal`).
    """

    aliases: ClassVar[Mapping[str, str]] = {
        "units": "policy.units",
        "discount": "values.discount",
        "learning_rate": "optimizer.learning_rate",
        "weight_decay": "optimizer.weight_decay",
    }

    values: ActionValueEnsemble = inner(ActionValueEnsemble(), help="the values of actions, and how they are learned")
    replay: Replay = inner(Replay(), help="how much experience is kept, and how often it is used")
    update_every: int = count(1, 1, unit="decisions", help="how many are kept from one use of the replay to the next")
    reward_scaling: RewardScaling | None = inner(None, help="none, or `RewardScaling` of the rewards that are drawn")
    optimizer: Optimizer = optimizer_field(Adam(5e-4))
    transformations: tuple[Transformation, ...] = transformations_field()
    averaging: PolyakAveraging | None = averaging_field()

    def validate(self) -> None:
        super().validate()
        self.check_takes_every_gradient(sees_decisions=False)

    @property
    def needs(self) -> Needs:
        goal = None if self.replay.hindsight is None else "replay.hindsight"
        kept = f"the experience kept by {type(self).__name__}"
        return Needs(goal=goal, single_stream=kept, actions="differentiable", memory="noise")

    @abc.abstractmethod
    def update_from_batch(self, state: Any, batch: Drawn, key: jax.Array) -> Any:
        """The state after the steps of one batch of decisions, with rewards as they are to be learned from. The state
        is without its `experience`; the `key` draws random numbers."""

    def first_fields(self, policy: Policy, key: jax.Array) -> dict[str, Any]:
        """The fields of a state before the first decision: the `policy`; the action `values`; the `experience`; how
        many decisions were kept since the last update, `waiting`; the states of the gradient transformations, `chain`,
        and of the `scaling` of rewards; how often the policy has moved, `steps`; where its noise lasts its `memory`,
        and what it saw and drew, `decision`."""
        own = jax.random.fold_in(key, 2)
        dtype = jax.tree.leaves(trainable(policy))[0].dtype
        plain = abilities.marginal(policy)
        observation = jnp.zeros(plain.inputs, dtype)
        action = plain.mode(observation)
        return {
            "policy": policy,
            "values": self.values.init(observation.size + coded(plain, action).size, dtype, jax.random.fold_in(own, 2)),
            "experience": self.replay.init(observation, action, jax.random.fold_in(own, 3)),
            "waiting": jnp.zeros((), jnp.int32),
            "chain": self.chain.init(policy),
            "scaling": None if self.reward_scaling is None else self.reward_scaling.init(dtype),
            "steps": self.first_steps(),
            "memory": abilities.initial_memory(policy),
            "decision": first_decision(policy),
        }

    def act(
        self, state: Any, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> tuple[Any, Array]:
        policy = state.policy
        seen = abilities.observation_with_memory(policy, state.memory, observation)
        action = policy.sample(seen, uniforms)
        state = with_decision(state, seen, action)
        return state._replace(memory=abilities.remember(policy, seen, action)), action

    def observe(self, state: Any, transition: Transition) -> Any:
        """Keep the decision, in the task's own units where these are given. What diverged is dropped."""
        dropped = transition.diverged
        following = transition.next_observation
        seen = abilities.observation_with_memory(state.policy, state.memory, following)
        policy = where(dropped, state.policy, abilities.adapted(state.policy, seen))
        observation = jnp.asarray(transition.observation, state.experience.observations.dtype)
        action = coded(policy, transition.action)
        values = where(dropped, state.values, self.values.adapted(state.values, observation, action))
        scaling = state.scaling
        if self.reward_scaling is not None:
            scaling = where(dropped, scaling, self.reward_scaling.update(scaling, transition.reward))
        kept = observation if transition.raw is None else transition.raw
        kept_after = following if transition.next_raw is None else transition.next_raw
        entry = (kept, transition.action, transition.reward, kept_after, transition.terminated, dropped)
        after = state._replace(
            policy=policy,
            values=values,
            scaling=scaling,
            experience=self.replay.add(state.experience, *entry),
            waiting=where(dropped, state.waiting, state.waiting + 1),
        )
        fresh = after._replace(
            experience=self.replay.restart(after.experience),
            scaling=scaling if self.reward_scaling is None else self.reward_scaling.restart(scaling),
            memory=abilities.initial_memory(policy),
        )
        return where(any_of(transition.terminated, transition.truncated, dropped), fresh, after)

    def update(self, state: Any, goal: Goal | None = None) -> Any:
        """Learn from batches of what is kept, where that is due. Hindsight needs the `goal` of the task."""
        due = state.waiting >= self.update_every
        experience = state.experience
        numbers, structure = jax.tree.flatten(self.hyperparameters)

        # Mapped over seeds, a product of matrices has one more axis, for which XLA's is several times as slow.
        @jax.custom_batching.sequential_vmap
        def learned_in_turn(numbers: list[Any], state: Any, drawn: tuple[Drawn, Array]) -> Any:
            learner = structure.unflatten(numbers)

            def learned(state: Any, each: tuple[Drawn, Array]) -> tuple[Any, None]:
                batch, words = each
                batch = batch._replace(action=jax.vmap(partial(coded, state.policy))(batch.action))
                if learner.reward_scaling is not None:
                    reward = learner.reward_scaling.factor(state.scaling) * batch.reward
                    batch = batch._replace(reward=reward.astype(batch.reward.dtype))
                with in_batches():
                    return learner.update_from_batch(state, batch, jax.random.wrap_key_data(words)), None

            return jax.lax.scan(learned, state, drawn)[0]

        def learn(state: Any) -> Any:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            state, kept = jax.lax.optimization_barrier((state, experience))
            keys = jax.random.split(jax.random.wrap_key_data(kept.key), (self.replay.updates, 2))
            batches = jax.vmap(lambda key: self.replay.draw(kept, key, goal))(keys[:, 0])
            return learned_in_turn(numbers, state, (batches, jax.random.key_data(keys[:, 1])))

        # The loop does not carry the experience: mapped over seeds, it would copy it.
        ready = jnp.logical_and(due, self.replay.ready(experience))
        moved = where_any(ready, learn, state._replace(experience=None))
        return moved._replace(
            experience=where(due, self.replay.renewed(experience), experience),
            waiting=where(due, jnp.zeros_like(state.waiting), state.waiting),
        )

    def decisions_until_due(self, state: Any) -> Int[Array, ""]:
        return self.update_every - 1 - state.waiting
