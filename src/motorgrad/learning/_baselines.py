r"""Reinforcement baselines: what a reward is compared with, $\delta = r - b$.

A good baseline makes the estimate of the gradient far less noisy (Weaver & Tao, 2001). A constant does not bias it; one
that follows the rewards does in short runs, and no longer in long ones. A baseline is
`init(dtype)`, `value(state)` and `update(state, reward)`; the reward is compared with the value *before* its update.
"""

import abc
import dataclasses
import math
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad._running import RunningMean, add_sample, running_mean


class Baseline(abc.ABC):
    """A reinforcement baseline."""

    @abc.abstractmethod
    def init(self, dtype: Any) -> Any:
        """The state before any reward."""

    @abc.abstractmethod
    def value(self, state: Any) -> Float[Array, ""]:
        """The baseline $b$."""

    @abc.abstractmethod
    def update(self, state: Any, reward: Float[Array, ""]) -> Any:
        """Take in a reward."""


@dataclasses.dataclass(frozen=True)
class NoBaseline(Baseline):
    r"""$b \equiv 0$."""

    def init(self, dtype: Any) -> Any:
        return jnp.zeros((), dtype)

    def value(self, state: Any) -> Float[Array, ""]:
        return state

    def update(self, state: Any, reward: Float[Array, ""]) -> Any:
        return state


@dataclasses.dataclass(frozen=True)
class Constant(Baseline):
    r"""$b \equiv c$: for a task whose average reward is known. It leaves what the estimate averages to as it is.

    **Arguments:** `level` $c$, in units of reward; finite.
    """

    level: float

    def __post_init__(self) -> None:
        check(math.isfinite(self.level), "level", self.level, "finite")

    def init(self, dtype: Any) -> Float[Array, ""]:
        return jnp.asarray(self.level, dtype)

    def value(self, state: Float[Array, ""]) -> Float[Array, ""]:
        return state

    def update(self, state: Float[Array, ""], reward: Float[Array, ""]) -> Float[Array, ""]:
        return state


@dataclasses.dataclass(frozen=True)
class MeanReward(Baseline):
    r"""The running mean of all rewards, $b \leftarrow b + \delta/n$ for the n-th reward (Kimura et al., 1995)."""

    def init(self, dtype: Any) -> RunningMean:
        return running_mean(jnp.zeros((), dtype))

    def value(self, state: RunningMean) -> Float[Array, ""]:
        return state.mean

    def update(self, state: RunningMean, reward: Float[Array, ""]) -> RunningMean:
        return add_sample(state, reward)


@dataclasses.dataclass(frozen=True)
class FixedStep(Baseline):
    r"""$b \leftarrow b + \gamma\delta$: forgets, so that it follows a changing task (section 4.4.1 of the thesis).

    **Arguments:** `rate` $\gamma \in (0, 1]$.
    """

    rate: float = 0.01

    def __post_init__(self) -> None:
        check(0 < self.rate <= 1, "rate", self.rate, "in (0, 1]")

    def init(self, dtype: Any) -> Float[Array, ""]:
        return jnp.zeros((), dtype)

    def value(self, state: Float[Array, ""]) -> Float[Array, ""]:
        return state

    def update(self, state: Float[Array, ""], reward: Float[Array, ""]) -> Float[Array, ""]:
        return state + self.rate * (reward - state)
