r"""Baselines that depend on the observation: $b(y_t)$, what an action taken at $y_t$ is expected to earn.

The observation on which an action was taken tells nothing about which action it was, so $b(y_t)$ does not bias what
that action is credited with. It was *led to* by older actions, though, and compared with $b(y_t)$ they would lose the
credit for it: a trace of decay $\beta$ would estimate $\nabla_\beta\eta - \beta\nabla_\beta\eta_b$, with $\eta_b$ the
average of $b$. So the reward is compared with $b(y_t)$ for the newest action only, and for older ones with a *level*
that knows no observation, the mean of all rewards:

$$g = (r - \ell)\,z_t + (\ell - b(y_t))\,w_0 s_t,$$

$w_0 s_t$ being the newest score as the trace $z_t$ has it. For a trace without memory this is $(r - b(y_t))\,s_t$.
"""

import abc
import dataclasses
import math
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad._running import RunningMean, add_sample, running_mean, two_sum

MOST = 1_000_000  # bins


class InputBaseline(abc.ABC):
    """A reinforcement baseline that sees the observation on which the newest action was taken."""

    @abc.abstractmethod
    def init(self, dtype: Any, inputs: int) -> Any:
        """The state before any reward, for observations of `inputs` numbers."""

    @abc.abstractmethod
    def value(self, state: Any) -> Float[Array, ""]:
        r"""The level $\ell$, for actions older than the newest."""

    @abc.abstractmethod
    def value_at(self, state: Any, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """The baseline $b(y)$, for the action taken on `observation`."""

    @abc.abstractmethod
    def update(self, state: Any, observation: Float[Array, " inputs"], reward: Float[Array, ""]) -> Any:
        """Take in the reward that followed the action taken on `observation`."""


class LinearState(NamedTuple):
    """`weights` of the inputs and, last, of 1; the `level`."""

    weights: Float[Array, " inputs+1"]
    level: RunningMean


@dataclasses.dataclass(frozen=True)
class LinearBaseline(InputBaseline):
    r"""$b(y) = w \cdot \phi(y)$ with $\phi(y) = (y, 1)$, by normalised least mean squares:
    $w \leftarrow w + \gamma\,(r - b(y))\,\phi/|\phi|^2$ (Nagumo & Noda, 1967).

    The step is in units of the input's own length, so that no input is too large for it.

    **Arguments:** `rate` $\gamma \in (0, 1]$; 1 fits every reward at once and remembers little.
    """

    rate: float = 0.01

    def __post_init__(self) -> None:
        check(0 < self.rate <= 1, "rate", self.rate, "in (0, 1]")

    def init(self, dtype: Any, inputs: int) -> LinearState:
        return LinearState(jnp.zeros(inputs + 1, dtype), running_mean(jnp.zeros((), dtype)))

    def value(self, state: LinearState) -> Float[Array, ""]:
        return state.level.mean

    def value_at(self, state: LinearState, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return jnp.sum(state.weights * _features(state, observation))

    def update(self, state: LinearState, observation: Float[Array, " inputs"], reward: Float[Array, ""]) -> LinearState:
        features = _features(state, observation)
        surprise = reward - jnp.sum(state.weights * features)
        weights = state.weights + self.rate * surprise * features / jnp.sum(features**2)
        return LinearState(weights, add_sample(state.level, reward))


def _features(state: LinearState, observation: Float[Array, " inputs"]) -> Float[Array, " inputs+1"]:
    return jnp.append(observation, 1).astype(state.weights.dtype)


@dataclasses.dataclass(frozen=True)
class BinnedBaseline(InputBaseline):
    r"""The mean reward in each of several `bins` of one observed number.

    The bins are of equal width from `low` to `high`; what lies below or above belongs to the first or the last. A bin
    that has had no reward yet stands at the level.

    **Arguments:**

    - `low` < `high`: the bounds, in units of the observed number.
    - `bins`: their number, from 1.
    - `input`: which of the observed numbers, from 0.
    - `rate` $\gamma \in [0, 1]$: the n-th reward of a bin moves its mean by $\max(1/n, \gamma)$ of its distance. 0 is
      the mean of all rewards so far; with more the mean forgets, and has a memory of $1/\gamma$ rewards.

    **Raises:** `ValueError` for what is out of its range; from `init`, for an input that the task does not have.
    """

    low: float = 0.0
    high: float = 1.0
    bins: int = 10
    input: int = 0
    rate: float = 0.0

    def __post_init__(self) -> None:
        bounds = math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high
        check(bounds, "low, high", (self.low, self.high), "finite, low < high")
        check(1 <= self.bins <= MOST, "bins", self.bins, f"from 1 to {MOST}")
        check(self.input >= 0, "input", self.input, "the place of an observed number, from 0")
        check(0 <= self.rate <= 1, "rate", self.rate, "in [0, 1]")

    def init(self, dtype: Any, inputs: int) -> RunningMean:
        check(self.input < inputs, "input", self.input, f"one of {inputs} observed numbers, 0 … {inputs - 1}")
        return running_mean(jnp.zeros(self.bins + 1, dtype))._replace(count=jnp.zeros(self.bins + 1, jnp.uint32))

    def bin(self, observation: Float[Array, " inputs"]) -> Array:
        """In which bin an observation is."""
        place = (observation[self.input] - self.low) * (self.bins / (self.high - self.low))
        return jnp.clip(jnp.floor(place), 0, self.bins - 1).astype(jnp.int32)

    def value(self, state: RunningMean) -> Float[Array, ""]:
        return state.mean[-1]

    def value_at(self, state: RunningMean, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        # A comparison with every bin: inside a loop over many seeds it is quicker than to look one up.
        means = jnp.where(state.count > 0, state.mean, state.mean[-1])
        return jnp.sum(jnp.where(self._at(observation)[:-1], means[:-1], 0))

    def update(self, state: RunningMean, observation: Float[Array, " inputs"], reward: Float[Array, ""]) -> RunningMean:
        count = state.count + self._at(observation).astype(jnp.uint32)
        least = jnp.append(jnp.full(self.bins, self.rate), 0)  # the level forgets nothing
        step = jnp.maximum(1 / count.astype(state.mean.dtype), least.astype(state.mean.dtype))
        distance = (reward - state.mean) - state.carry
        moved = RunningMean(*two_sum(state.mean, state.carry, step * distance), count)
        return RunningMean(*(jnp.where(count > state.count, new, old) for new, old in zip(moved, state, strict=True)))

    def _at(self, observation: Float[Array, " inputs"]) -> Array:
        """Which means an observation belongs to: its bin's and, last, that of all."""
        return jnp.append(jnp.arange(self.bins) == self.bin(observation), True)
