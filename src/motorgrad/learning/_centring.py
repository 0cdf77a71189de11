r"""Centring: the level $\rho$ that a critic compares rewards with.

For the average reward $\rho$ belongs to the definition of the values. For discounted values it takes the constant
$\rho/(1 - \gamma)$ out of them, which is large for discounts near 1, tells no action from another, and takes long to
learn (Naik, Wan, Tomar & Sutton, 2024).
"""

import abc
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._branching import Scalar
from motorgrad._running import RunningMean, add_sample, counted_on, two_sum
from motorgrad.schema import Part, number


class Centring(Part):
    r"""How the level of rewards $\rho$ is learned."""

    reads_errors: ClassVar[bool] = False
    """Whether it learns from temporal differences."""

    @abc.abstractmethod
    def follow(
        self, level: RunningMean, reward: Float[Array, ""], error: Float[Array, ""], least_rate: Scalar
    ) -> RunningMean:
        r"""The level after a reward whose temporal difference was $\delta$, the `error`. A mean of rewards remembers
        1/`least_rate` of them."""


class SimpleCentring(Centring):
    r"""Rewards less their running mean (Naik et al., 2024).

    The n-th reward moves $\rho$ by $\max(1/n, \text{rate})$ of its distance from it, with the rate of the critic's
    `fit`.
    """

    def follow(
        self, level: RunningMean, reward: Float[Array, ""], error: Float[Array, ""], least_rate: Scalar
    ) -> RunningMean:
        return add_sample(level, reward, least_rate)


class ValueBasedCentring(Centring):
    r"""Rewards less a level that is learned from temporal differences, $\rho \leftarrow \rho + \kappa\,\delta$ (Sutton
    & Barto, 2018; Naik et al., 2024).

    The temporal difference is less noisy than the reward once the values are learned, and it tells the average reward
    of the policy that is learned about where that differs from the one that acts.
    """

    reads_errors: ClassVar[bool] = True

    rate: float = number(
        1e-3,
        0,
        1,
        help=r"$\kappa$. Start from a tenth of the critic's learning rate times the squared length of features",
    )

    def follow(
        self, level: RunningMean, reward: Float[Array, ""], error: Float[Array, ""], least_rate: Scalar
    ) -> RunningMean:
        mean, carry = two_sum(level.mean, level.carry, jnp.asarray(self.rate * error, level.mean.dtype))
        return RunningMean(mean, carry, counted_on(level.count))
