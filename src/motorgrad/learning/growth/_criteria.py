"""When a growing learner adds a unit, and when it stops: by the clock, or once the reward no longer rises."""

import abc
import math
from typing import NamedTuple

import jax.numpy as jnp
from jax.scipy.special import ndtri
from jax.typing import DTypeLike
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._branching import where
from motorgrad._errors import check
from motorgrad._running import counted_on
from motorgrad.schema import Part, count, number

BATCHES = 20
"""Parts of a window. The spread of their means gives the interval, because successive rewards are correlated."""


class Criterion(Part):
    """When the next unit is due."""

    def check(self, adding: int) -> None:
        """Refuse settings that do not fit an adding phase of this length in decisions."""

    @abc.abstractmethod
    def init(self, dtype: DTypeLike) -> PyTree:
        """The state when a unit has been added."""

    @abc.abstractmethod
    def add_reward(self, state: PyTree, reward: Float[Array, ""], grown: Bool[Array, ""]) -> PyTree:
        """The state after a reward; `grown` says whether the adding phase of the newest unit is over."""

    @abc.abstractmethod
    def due(self, state: PyTree, age: Int[Array, ""]) -> Bool[Array, ""]:
        """Whether a unit is to be added now, `age` decisions after the last."""

    @abc.abstractmethod
    def renew(self, state: PyTree) -> PyTree:
        """The state after a unit was added."""


class Clock(Criterion):
    """A unit every `interval` decisions, until the pool is full (section 6.4.3 of the thesis)."""

    interval: int = count(
        10_000, 1, 2**30 - 1, unit="decisions", help="time from one unit to the next, at least the adding phase"
    )

    def check(self, adding: int) -> None:
        wanted = f"at least the {adding:,} decisions of the adding phase"
        check(self.interval >= adding, "criterion.interval", self.interval, wanted)

    def init(self, dtype: DTypeLike) -> None:
        return None

    def add_reward(self, state: PyTree, reward: Float[Array, ""], grown: Bool[Array, ""]) -> PyTree:
        return state

    def due(self, state: PyTree, age: Int[Array, ""]) -> Bool[Array, ""]:
        return age >= self.interval

    def renew(self, state: PyTree) -> PyTree:
        return state


class PlateauState(NamedTuple):
    """What a `Plateau` remembers.

    - `batch`: the mean of the current batch, of `rewards` many.
    - `mean` and `squares`: the mean of the current window's batch means and the sum of their squared deviations;
      `batches`, how many.
    - `last` and `last_variance`: the mean of the last window and its variance; `windows`, how many since the newest
      unit was grown.
    - `best` and `best_variance`: the best level before a unit was added.
    - `vain`: how many units in a row brought nothing; `due`: whether a unit is due.
    """

    batch: Float[Array, ""]
    rewards: Int[Array, ""]
    mean: Float[Array, ""]
    squares: Float[Array, ""]
    batches: Int[Array, ""]
    last: Float[Array, ""]
    last_variance: Float[Array, ""]
    windows: Int[Array, ""]
    best: Float[Array, ""]
    best_variance: Float[Array, ""]
    vain: Int[Array, ""]
    due: Bool[Array, ""]


class Plateau(Criterion):
    r"""Adds a unit once the reward no longer rises, and stops once units no longer raise it.

    After the adding phase, rewards are averaged over windows. The variance of a window's mean comes from its 20 parts.
    A unit is due when a window is not better than the one before it by more than the interval of the difference,
    $z\sqrt{v + v'}$. Its worth is judged when the next is due: it brought nothing where the last window is not better,
    by as much, than the best level at which a unit was added before. After `patience` such units in a row no more are
    added.

    Short windows have wide intervals that hide every rise: the reward seems flat at once. A task that needs several
    units before it pays needs a larger `patience`.
    """

    window: int = count(
        4_000, 2 * BATCHES, 2**30 - 1, unit="decisions", help="length of the windows whose mean rewards are compared"
    )
    confidence: float = number(
        0.95, 0, 1, open_low=True, open_high=True, help="level of the two-sided interval of a difference"
    )
    patience: int = count(
        3, 1, 2**30 - 1, unit="units", help="successive ones without improvement after which growth stops"
    )

    def init(self, dtype: DTypeLike) -> PlateauState:
        zero = jnp.zeros((), dtype)
        none = jnp.zeros((), jnp.int32)
        return PlateauState(
            batch=zero, rewards=none, mean=zero, squares=zero, batches=none, last=zero, last_variance=zero,
            windows=none, best=jnp.full((), -math.inf, dtype), best_variance=zero, vain=none, due=jnp.zeros((), bool),
        )  # fmt: skip

    def add_reward(self, state: PlateauState, reward: Float[Array, ""], grown: Bool[Array, ""]) -> PlateauState:
        rewards = state.rewards + 1
        batch = state.batch + (reward - state.batch) / rewards
        part = rewards >= self.window // BATCHES
        batches = state.batches + part
        away = batch - state.mean
        mean = jnp.where(part, state.mean + away / jnp.maximum(batches, 1), state.mean)
        squares = jnp.where(part, state.squares + away * (batch - mean), state.squares)
        within = state._replace(
            batch=jnp.where(part, 0, batch), rewards=jnp.where(part, 0, rewards), mean=mean, squares=squares,
            batches=batches,
        )  # fmt: skip
        whole = part & (batches >= BATCHES)
        return where(grown, where(whole, self._judge(within), within), state)

    def _judge(self, state: PlateauState) -> PlateauState:
        """The state after a whole window: has the reward risen in it, and above the best level before?"""
        variance = state.squares / (BATCHES * (BATCHES - 1))
        sure = ndtri(0.5 + self.confidence / 2)
        rose, better = (
            state.mean - before > sure * jnp.sqrt(variance + spread)
            for before, spread in ((state.last, state.last_variance), (state.best, state.best_variance))
        )
        flat = (state.windows > 0) & ~rose
        zero = jnp.zeros_like(state.mean)
        return PlateauState(
            batch=zero, rewards=jnp.zeros_like(state.rewards), mean=zero, squares=zero,
            batches=jnp.zeros_like(state.batches), last=state.mean, last_variance=variance,
            windows=counted_on(state.windows),
            best=jnp.where(flat & better, state.mean, state.best),
            best_variance=jnp.where(flat & better, variance, state.best_variance),
            vain=jnp.where(state.due, state.vain, jnp.where(flat, jnp.where(better, 0, state.vain + 1), state.vain)),
            due=state.due | flat,
        )  # fmt: skip

    def due(self, state: PlateauState, age: Int[Array, ""]) -> Bool[Array, ""]:
        del age
        return state.due & (state.vain < self.patience)

    def renew(self, state: PlateauState) -> PlateauState:
        fresh = self.init(state.mean.dtype)
        return fresh._replace(best=state.best, best_variance=state.best_variance, vain=state.vain)
