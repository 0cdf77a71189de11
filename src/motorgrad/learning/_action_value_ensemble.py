r"""Values of actions by several networks, learned from batches of decisions of any age."""

from typing import Any, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jax.typing import DTypeLike
from jaxtyping import Array, Float, PyTree

from motorgrad.learning._critics import ValueNetwork, value_network
from motorgrad.learning._replay import Drawn
from motorgrad.learning._schedules import Annealed, Steps, at
from motorgrad.policies import Architecture, MultilayerPerceptron, adapted, split
from motorgrad.schema import Part, count, inner, number


class EnsembleState(NamedTuple):
    """The networks; their slow copies, of what is learned alone; the state of Adam."""

    weights: tuple[ValueNetwork, ...]
    slow: PyTree
    rule: optax.OptState


class ActionValueEnsemble(Part):
    r"""The value $Q(y, a)$ of an action by several networks, of which the least counts (Fujimoto et al., 2018).

    Each learns by Adam from $r + \gamma \min_k \bar Q_k(y', a')$, for the next action $a'$ that a learner names, and
    whatever the policy was when the decision was made. $\bar Q$ are slow copies of the networks, which follow them by
    the share `tracking` at every step.
    """

    discount: float = number(0.99, 0, 1, open_high=True, help=r"$\gamma$, the weight of the next value")
    learning_rate: float | Annealed = number(5e-4, 0, help="learning rate of Adam")
    tracking: float = number(
        0.01, 0, 1, help="the share of the distance to the networks by which their slow copies move at a step"
    )
    members: int = count(2, 1, 1_000, help="number of networks")
    network: Architecture = inner(
        MultilayerPerceptron(sparsity=0.0, activation="relu", standardise=True),
        help="the hidden layers. They see the observation and the action, in one vector",
    )

    def init(self, inputs: int, dtype: DTypeLike, key: jax.Array) -> EnsembleState:
        """The state before any decision, for this many `inputs`: observation and action."""
        weights = tuple(value_network(self.network, inputs, dtype, own) for own in jax.random.split(key, self.members))
        learned = split(cast(Any, weights))[0]
        return EnsembleState(weights, learned, optax.scale_by_adam().init(learned))

    def values(
        self,
        weights: tuple[ValueNetwork, ...],
        observation: Float[Array, "batch inputs"],
        action: Float[Array, "batch actions"],
    ) -> Float[Array, "members batch"]:
        """$Q_k(y, a)$ of all members."""
        joined = jnp.concatenate([observation, action], axis=1).astype(weights[0].weights.dtype)
        return jnp.stack([jax.vmap(member)(joined) for member in weights])

    def adapted(self, state: EnsembleState, observation: Array, action: Array) -> EnsembleState:
        """The state after one more decision was seen, for networks that keep statistics."""
        seen = jnp.concatenate([observation, action]).astype(state.weights[0].weights.dtype)
        after = [
            eqx.tree_at(lambda each: each.layers, member, adapted(member.layers, seen)) for member in state.weights
        ]
        return state._replace(weights=tuple(after))

    def later(
        self, state: EnsembleState, observation: Float[Array, "batch inputs"], action: Float[Array, "batch actions"]
    ) -> Float[Array, " batch"]:
        r"""$\min_k \bar Q_k(y', a')$, by the slow copies."""
        settings = split(cast(Any, state.weights))[1]
        return jnp.min(self.values(eqx.combine(state.slow, settings), observation, action), axis=0)

    def least(
        self, state: EnsembleState, observation: Float[Array, "batch inputs"], action: Float[Array, "batch actions"]
    ) -> Float[Array, " batch"]:
        r"""$\min_k Q_k(y, a)$."""
        return jnp.min(self.values(state.weights, observation, action), axis=0)

    def update(
        self, state: EnsembleState, batch: Drawn, later: Float[Array, " batch"], steps: Steps = None
    ) -> EnsembleState:
        """The state after a step down the squared errors of a batch of decisions, for the `later` value of each; the
        parameters have made `steps`."""
        learned, settings = split(cast(Any, state.weights))
        wanted = (batch.reward + self.discount * (1 - batch.terminated) * later).astype(later.dtype)

        def loss(learned: PyTree) -> Float[Array, ""]:
            found = self.values(eqx.combine(learned, settings), batch.observation, batch.action)
            return 0.5 * batch.mean(jnp.sum(jnp.square(found - wanted), axis=0))

        moves, rule = optax.scale_by_adam().update(jax.grad(loss)(learned), state.rule)
        rate = at(self.learning_rate, steps)
        learned = eqx.apply_updates(learned, jax.tree.map(lambda move: (-rate * move).astype(move.dtype), moves))
        slow = jax.tree.map(lambda old, new: (old + self.tracking * (new - old)).astype(old.dtype), state.slow, learned)
        return EnsembleState(eqx.combine(learned, settings), slow, rule)
