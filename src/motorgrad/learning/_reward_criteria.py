r"""Reward criteria: what the rewards of an episode are worth together (section 3.2.1 of the thesis, "Factoring the
Reward").

A criterion is recursive, $c_0 = 0$ and $c_{t+1} = \phi(c_t, r_{t+1})$, and the value of an episode is its last $c_T$. A
learner with a criterion is paid the *increments* $c_{t+1} - c_t$ in place of the rewards. They add up to $c_T$, and
what was paid before an action says nothing about its score, so that

$$\nabla\,\mathbb E[c_T] = \mathbb E[c_T z_T] = \mathbb E \sum_t (c_{t+1} - c_t)\,z_{t+1}$$

for the sum $z$ of all scores of the episode. Any recursive criterion is thereby learned online, from one number for
each decision, and traces that forget bias its gradient as they do that of the sum of rewards.
"""

import abc
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float, Int

from motorgrad._errors import check
from motorgrad.schema import Part, inner, number


class Accumulated(NamedTuple):
    """The `value` of the episode's rewards so far, and their `count`."""

    value: Float[Array, ""]
    count: Int[Array, ""]  # pyright: ignore[reportIncompatibleMethodOverride]


class RewardCriterion(Part):
    r"""What the rewards of an episode are worth together. A criterion of your own defines `accumulated`.

    ```python
    class Soonest(mg.learning.RewardCriterion):
        '''The number of decisions before the first reward above 0, negative: sooner is better.'''

        def accumulated(self, value, reward, count):
            waited = value == -count
            return jnp.where(waited & (reward <= 0), value - 1.0, value)
    ```
    """

    @abc.abstractmethod
    def accumulated(self, value: Float[Array, ""], reward: Float[Array, ""], count: Int[Array, ""]) -> Float[Array, ""]:
        r"""$\phi(c_t, r_{t+1})$: the new value, from the `value` of the `count` rewards before, which is 0 before the
        first, and one more `reward`."""

    def init(self, dtype: DTypeLike) -> Accumulated:
        """The state at the start of an episode."""
        return Accumulated(jnp.zeros((), dtype), jnp.zeros((), jnp.int32))

    def update(self, state: Accumulated, reward: Float[Array, ""]) -> tuple[Float[Array, ""], Accumulated]:
        """The increment that a reward brings, and the state after it."""
        value = self.accumulated(state.value, reward, state.count).astype(state.value.dtype)
        return value - state.value, Accumulated(value, state.count + 1)

    def value_of(self, rewards: Float[Array, " decisions"]) -> Float[Array, ""]:
        """The value of an episode with these rewards; 0 without any."""
        rewards = jnp.asarray(rewards, jnp.result_type(float))

        def add(state: Accumulated, reward: Array) -> tuple[Accumulated, None]:
            return self.update(state, reward)[1], None

        return jax.lax.scan(add, self.init(rewards.dtype), rewards)[0].value


def criterion_field() -> Any:
    """Declare the field `criterion` of what makes advantages of rewards."""
    return inner(
        None,
        help="none for the rewards themselves, or a `RewardCriterion`: what the rewards of an episode are worth "
        "together, such as their `Maximum`. Rewards give way to its increments before anything else sees them",
    )


def check_criterion(criterion: RewardCriterion | None, discount: float | None) -> None:
    """Refuse a criterion whose increments a `discount` would weight once more."""
    wanted = f"None with the criterion {type(criterion).__name__}; the criterion Discounted has one of its own"
    check(criterion is None or discount is None, "discount", discount, wanted)


class Maximum(RewardCriterion):
    """The greatest reward of the episode."""

    def accumulated(self, value: Float[Array, ""], reward: Float[Array, ""], count: Int[Array, ""]) -> Float[Array, ""]:
        return jnp.where(count == 0, reward, jnp.maximum(value, reward))


class Last(RewardCriterion):
    """The last reward of the episode."""

    def accumulated(self, value: Float[Array, ""], reward: Float[Array, ""], count: Int[Array, ""]) -> Float[Array, ""]:
        return reward


class Average(RewardCriterion):
    """The mean reward of the episode, which in episodes of different lengths is not in proportion to their sum."""

    def accumulated(self, value: Float[Array, ""], reward: Float[Array, ""], count: Int[Array, ""]) -> Float[Array, ""]:
        return value + (reward - value) / (count + 1)


class Discounted(RewardCriterion):
    r"""The discounted return of the episode, $\sum_t \gamma^t r_{t+1}$; with $\gamma = 1$ the sum of its rewards."""

    discount: float = number(0.95, 0, 1, open_low=True, help=r"$\gamma$, per decision")

    def accumulated(self, value: Float[Array, ""], reward: Float[Array, ""], count: Int[Array, ""]) -> Float[Array, ""]:
        return value + self.discount**count * reward
