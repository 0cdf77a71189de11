r"""Scales: rewards in units of the variation of their discounted sum, advantages in units of their usual size."""

from typing import NamedTuple

import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float

from motorgrad._running import RunningMean, add_observation, running_mean
from motorgrad.schema import Part, number


class ScalingState(NamedTuple):
    r"""The discounted sum of the episode's rewards, `trace`; its running `mean` and `variance` over all episodes."""

    trace: Float[Array, ""]
    mean: RunningMean
    variance: RunningMean


class RewardScaling(Part):
    r"""Divides rewards by the standard deviation of their discounted sum, $r/\sigma$.

    $\sigma^2$ is the variance of $u \leftarrow \gamma u + r$ over all decisions so far, the present one included; $u$
    restarts from 0 with every episode (Engstrom et al., 2020; Elsayed, Vasan & Mahmood, 2024). So values, temporal
    differences and advantages have a size of about 1 in any task. Rewards are not centred: they keep their sign. Until
    $u$ has varied, they stay as they are.
    """

    discount: float = number(0.99, 0, 1, open_high=True, help=r"$\gamma$, as a rule that of the critic")

    def init(self, dtype: DTypeLike) -> ScalingState:
        """The state before any reward."""
        zero = jnp.zeros((), dtype)
        return ScalingState(zero, running_mean(zero), running_mean(zero))

    def update(self, state: ScalingState, reward: Float[Array, ""]) -> ScalingState:
        """The state after a reward."""
        trace = (self.discount * state.trace + reward).astype(state.trace.dtype)
        return ScalingState(trace, *add_observation(state.mean, state.variance, trace))

    def factor(self, state: ScalingState) -> Float[Array, ""]:
        """The factor of a reward."""
        some = state.variance.mean > 0
        return jnp.where(some, 1 / jnp.sqrt(jnp.where(some, state.variance.mean, 1)), 1)

    def restart(self, state: ScalingState) -> ScalingState:
        """The state at the start of an episode."""
        return state._replace(trace=jnp.zeros_like(state.trace))


class NormalizationState(NamedTuple):
    """The decaying sum of squared advantages, and that of their `weight`, which tends to 1."""

    squares: Float[Array, ""]
    weight: Float[Array, ""]


class RootMeanSquare(Part):
    r"""Advantage normalization: divides advantages $\delta$ by $\sqrt{v}$, where $v$ is a running mean of $\delta^2$.

    A learning rate then says how far an advantage of usual size moves the parameters. It means the same for rewards of
    any unit, and steps keep their length where rewards spread less and less while a task is learned. The mean forgets
    as $v \leftarrow v + \gamma\,(\delta^2 - v)$ and is corrected for its start as Adam's is (Kingma & Ba, 2015), so
    that the first advantage counts as one. The mean includes the newest advantage, so none counts as more than
    $1/\sqrt\gamma$; this couples the two, a bias of the order of $\gamma$.
    """

    rate: float = number(1e-3, 0, 1, open_low=True, open_high=True, help=r"$\gamma$, per reward")

    def init(self, dtype: DTypeLike) -> NormalizationState:
        """The state before any advantage."""
        return NormalizationState(jnp.zeros((), dtype), jnp.zeros((), dtype))

    def update(self, state: NormalizationState, advantage: Float[Array, ""]) -> NormalizationState:
        """The state after an advantage."""
        return NormalizationState(
            state.squares + self.rate * (jnp.square(advantage) - state.squares),
            state.weight + self.rate * (1 - state.weight),
        )

    def factor(self, state: NormalizationState) -> Float[Array, ""]:
        """The factor of an advantage; 0 if all advantages have been 0."""
        some = state.squares > 0
        return jnp.where(some, jnp.sqrt(state.weight / jnp.where(some, state.squares, 1)), 0)
