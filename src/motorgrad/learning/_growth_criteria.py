"""When a growing learner adds a unit, and when it stops: by the clock, or once the reward no longer rises."""

import abc
import dataclasses
import math
import statistics
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from motorgrad._errors import check

BATCHES = (
    20  # parts of a window; the spread of their means gives the interval, as rewards in a row depend on each other
)


class Criterion(abc.ABC):
    """When the next unit is due."""

    @abc.abstractmethod
    def check(self, adding: int) -> None:
        """Refuse what does not go with an adding phase of so many decisions."""

    @abc.abstractmethod
    def init(self, dtype: Any) -> Any:
        """The state when a unit has been added."""

    @abc.abstractmethod
    def watch(self, state: Any, reward: Float[Array, ""], settled: Bool[Array, ""]) -> Any:
        """Take in a reward; `settled`, whether the newest unit's adding phase is over."""

    @abc.abstractmethod
    def due(self, state: Any, age: Int[Array, ""]) -> Bool[Array, ""]:
        """Whether a unit is to be added now, `age` decisions after the last."""

    @abc.abstractmethod
    def renew(self, state: Any) -> Any:
        """The state after a unit was added."""


@dataclasses.dataclass(frozen=True)
class Clock(Criterion):
    """A unit every `interval` decisions, until the pool is full (section 6.4.3 of the thesis).

    **Arguments:** `interval`, in decisions, at least as many as the adding phase has.
    """

    interval: int = 10_000

    def __post_init__(self) -> None:
        check(1 <= self.interval < 2**30, "interval", self.interval, "from 1 to 1,073,741,823 decisions")

    def check(self, adding: int) -> None:
        wanted = f"at least the {adding:,} decisions of the adding phase"
        check(self.interval >= adding, "interval", self.interval, wanted)

    def init(self, dtype: Any) -> None:
        return None

    def watch(self, state: Any, reward: Float[Array, ""], settled: Bool[Array, ""]) -> Any:
        return state

    def due(self, state: Any, age: Int[Array, ""]) -> Bool[Array, ""]:
        return age >= self.interval

    def renew(self, state: Any) -> Any:
        return state


class PlateauState(NamedTuple):
    """What a `Plateau` remembers: the batch under way (`batch`, its mean, of `rewards`); the window under way (`mean`
    and `squares`, the sum of squared deviations, of its batches' means, of which there are `batches`); the `last`
    window's mean and its variance, and how many `windows` there have been since the newest unit settled; the level
    `best` reached before a unit was added, and its variance; how many units in a row were `vain`; whether a unit is
    `due`."""

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


@dataclasses.dataclass(frozen=True)
class Plateau(Criterion):
    r"""A unit once the reward no longer rises; none any more once units no longer raise it.

    From the end of the adding phase rewards are averaged over windows. A window's mean has a variance, found from those
    of its 20 parts. A unit is due when a window is not better than the one before it by more than the interval of the
    difference, $z\sqrt{v + v'}$. What it was worth is seen when the next is due: it brought nothing where the last
    window is not better, by as much, than the best level at which a unit was added before. After `patience` such units
    in a row none is added any more.

    **Arguments:** `window`, in decisions, at least 40; `confidence` in (0, 1), of the interval of a difference, both
    sides together; `patience`, units, at least 1.

    Short windows have wide intervals, in which every rise is lost: the reward seems flat at once. A task that needs
    several units before it pays wants a `patience` of more than those.
    """

    window: int = 4_000
    confidence: float = 0.95
    patience: int = 3

    def __post_init__(self) -> None:
        check(2 * BATCHES <= self.window < 2**30, "window", self.window, f"at least {2 * BATCHES} decisions")
        check(0 < self.confidence < 1, "confidence", self.confidence, "in (0, 1)")
        check(1 <= self.patience < 2**30, "patience", self.patience, "at least 1 unit")

    def check(self, adding: int) -> None:
        del adding

    def init(self, dtype: Any) -> PlateauState:
        zero, none = jnp.zeros((), dtype), jnp.zeros((), jnp.int32)
        return PlateauState(
            batch=zero, rewards=none, mean=zero, squares=zero, batches=none, last=zero, last_variance=zero,
            windows=none, best=jnp.full((), -math.inf, dtype), best_variance=zero, vain=none, due=jnp.zeros((), bool),
        )  # fmt: skip

    def watch(self, state: PlateauState, reward: Float[Array, ""], settled: Bool[Array, ""]) -> PlateauState:
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
        return _where(settled, _where(whole, self._judge(within), within), state)

    def _judge(self, state: PlateauState) -> PlateauState:
        """A window is whole: has the reward risen in it, and since the best level before a unit was added?"""
        variance = state.squares / (BATCHES * (BATCHES - 1))
        sure = statistics.NormalDist().inv_cdf(0.5 + self.confidence / 2)
        rose, better = (
            state.mean - before > sure * jnp.sqrt(variance + spread)
            for before, spread in ((state.last, state.last_variance), (state.best, state.best_variance))
        )
        flat = (state.windows > 0) & ~rose
        zero = jnp.zeros_like(state.mean)
        return PlateauState(
            batch=zero, rewards=jnp.zeros_like(state.rewards), mean=zero, squares=zero,
            batches=jnp.zeros_like(state.batches), last=state.mean, last_variance=variance,
            windows=state.windows + 1,
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


def _where(condition: Bool[Array, ""], yes: PlateauState, no: PlateauState) -> PlateauState:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), yes, no)
