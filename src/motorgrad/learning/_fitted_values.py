"""A critic fitted to λ-returns, batch by batch."""

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._branching import Flag, where, where_any
from motorgrad.learning._critic_fits import CriticFit, CriticStep, level_rate
from motorgrad.policies import split
from motorgrad.schema import count, number


class FittedState(NamedTuple):
    """The decisions that wait for the next fit and their number, `waiting`; the state of Adam, `rule`.

    `seen` and `following` are what the critic saw of each decision and of the next; `live` is 0 where the episode
    terminated; after an `end` another episode began.
    """

    seen: Float[Array, "interval features"]
    following: Float[Array, "interval features"]
    reward: Float[Array, " interval"]
    live: Float[Array, " interval"]
    end: Bool[Array, " interval"]
    waiting: Int[Array, ""]
    rule: optax.OptState


class FittedReturns(CriticFit):
    r"""Fits the values of a batch to its λ-returns by Adam (Kingma & Ba, 2015), several passes at a time.

    Every `interval` decisions the returns

    $$G_t = r_{t+1} - \rho + \gamma\,\big((1 - \lambda)\,v(y_{t+1}) + \lambda\,G_{t+1}\big)$$

    are computed once, from the last decision back; at the end of an episode and of the batch, $G_{t+1}$ is
    $v(y_{t+1})$. Then each pass takes a step of Adam down the mean of $\frac12 (v(y_t) - G_t)^2$. In between the
    weights do not change.
    """

    linear: ClassVar[bool] = False
    single_stream: ClassVar[bool] = True
    leaves_errors: ClassVar[bool] = False

    learning_rate: float = number(3e-3, 0, help="learning rate of Adam")
    rate: float = level_rate()
    interval: int = count(500, 1, 1_000_000, unit="decisions", help="length of a batch, which is kept until it is full")
    passes: int = count(20, 1, 100_000, help="number of times that a batch is used")

    @property
    def mean_rate(self) -> float:
        return self.rate

    def init(self, weights: PyTree, features: int) -> FittedState:
        dtype = jax.tree.leaves(weights)[0].dtype
        numbers = jnp.zeros(self.interval, dtype)
        rows = jnp.zeros((self.interval, features), dtype)
        rule = optax.scale_by_adam().init(weights)
        ends = jnp.zeros(self.interval, bool)
        return FittedState(rows, rows, numbers, numbers, ends, jnp.zeros((), jnp.int32), rule)

    def update(
        self, weights: PyTree, state: FittedState, step: CriticStep, dropped: Flag = False
    ) -> tuple[PyTree, PyTree]:
        def put(rows: Array, row: Array | bool | None) -> Array:
            # There is room: `solve` has emptied what was full. What is dropped is overwritten by the next decision.
            return rows.at[state.waiting].set(jnp.asarray(row, rows.dtype))

        after = state._replace(
            seen=put(state.seen, step.seen),
            following=put(state.following, step.following),
            reward=put(state.reward, step.reward),
            live=put(state.live, jnp.logical_not(step.terminated)),
            end=put(state.end, step.terminated),
            waiting=where(dropped, state.waiting, state.waiting + 1),
        )
        return weights, after

    def restart(self, state: FittedState) -> FittedState:
        return state._replace(end=state.end | (jnp.arange(self.interval) == state.waiting - 1))

    def decisions_until_due(self, state: FittedState) -> Int[Array, ""]:
        return self.interval - 1 - state.waiting

    def solve(
        self, weights: PyTree, state: FittedState, level: Float[Array, ""], critic: Any
    ) -> tuple[PyTree, FittedState]:
        def fit(old: tuple[PyTree, PyTree]) -> tuple[PyTree, PyTree]:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            weights, rule = old
            batch, mean = jax.lax.optimization_barrier((state, level))
            learned, settings = split(weights) if isinstance(weights, eqx.Module) else (weights, None)

            def values(parameters: PyTree, seen: Float[Array, "interval features"]) -> Float[Array, " interval"]:
                whole = parameters if settings is None else eqx.combine(parameters, settings)
                return jax.vmap(lambda x: critic.value(whole, x))(seen)

            later = batch.live * values(learned, batch.following)

            def back(following: Array, decision: tuple[Array, Array, Array]) -> tuple[Array, Array]:
                reward, later, end = decision
                expected = jnp.where(end, later, (1 - critic.decay) * later + critic.decay * following)
                found = (reward - mean + critic.horizon * expected).astype(reward.dtype)
                return found, found

            last = batch.end.at[-1].set(True)
            returns = jax.lax.scan(back, later[-1], (batch.reward, later, last), reverse=True)[1]

            def loss(parameters: PyTree) -> Float[Array, ""]:
                return 0.5 * jnp.mean(jnp.square(values(parameters, batch.seen) - returns))

            def descend(carry: tuple[PyTree, PyTree], _: None) -> tuple[tuple[PyTree, PyTree], None]:
                parameters, rule = carry
                moves, rule = optax.scale_by_adam().update(jax.grad(loss)(parameters), rule)
                moves = jax.tree.map(lambda move: -self.learning_rate * move, moves)
                return (eqx.apply_updates(parameters, moves), rule), None

            (learned, rule), _ = jax.lax.scan(descend, (learned, rule), length=self.passes)
            return learned if settings is None else eqx.combine(learned, settings), rule

        full = self.decisions_until_due(state) < 0
        weights, rule = where_any(full, fit, (weights, state.rule))
        empty = state._replace(end=jnp.zeros_like(state.end), waiting=jnp.zeros_like(state.waiting), rule=rule)
        return weights, where(full, empty, state)
