r"""A baseline that learns its own rate: incremental delta-bar-delta (Sutton, 1992), for rewards of any unit.

Section 4.4.1 of the thesis proposes to treat the rate $\gamma$ of $b \leftarrow b + \gamma\delta$ as a parameter to be
optimised. The rate is $\gamma = e^\beta$, and $\beta$ descends the squared error of the baseline as a forecast of the
next reward. The gradient $-\partial\frac12\delta^2/\partial\beta$ is $\delta h$, where the sensitivity
$h = \partial b/\partial\beta$ is followed from reward to reward:

$$\beta \leftarrow \beta + \kappa\,\delta h/v,\qquad b \leftarrow b + \gamma\delta,\qquad
h \leftarrow (1 - \gamma)\,h + \gamma\delta .$$

The running mean $v$ of $\delta^2$ is our addition, in the spirit of Mahmood et al. (2012): $\kappa$ then has no unit.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float

from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._baselines import ScalarBaseline
from motorgrad.policies import Policy
from motorgrad.schema import number

LEAST_RATE = 1e-6
"""The rate does not fall below it: a baseline that no longer moves would learn no more about its rate either."""


class LearnedStepState(NamedTuple):
    r"""The baseline, `value`; the logarithm of its rate, `log_rate`; $h$, its `sensitivity` to that; the running mean
    of $\delta^2$, `square`."""

    value: Float[Array, ""]
    log_rate: Float[Array, ""]
    sensitivity: Float[Array, ""]
    square: RunningMean


class LearnedStep(ScalarBaseline):
    r"""A mean that forgets, $b \leftarrow b + \gamma\delta$, and learns its rate $\gamma$ by meta-gradient (section
    4.4.1).

    It follows rewards whose mean drifts at a speed that is not known, or that changes. Where the mean is a random walk
    under white noise, the best rate is the gain of the Kalman filter in its steady state.
    """

    rate: float = number(
        0.01, 0, 1, open_low=True, at_start=True, help=r"the first $\gamma$, one over the memory in rewards"
    )
    meta_rate: float = number(
        0.01,
        0,
        1,
        help=r"$\kappa$, how fast the logarithm of the rate is learned. It then scatters by about "
        r"$\sqrt{\kappa/2}$; where $\gamma$ is small, it takes about $2/(\kappa\gamma)$ rewards to be learned",
    )

    def init(self, policy: Policy, dtype: DTypeLike) -> LearnedStepState:
        zero = jnp.zeros((), dtype)
        return LearnedStepState(zero, jnp.log(jnp.asarray(self.rate, dtype)), zero, running_mean(zero))

    def level(self, state: LearnedStepState) -> Float[Array, ""]:
        return state.value

    def learn(self, state: LearnedStepState, reward: Float[Array, ""]) -> LearnedStepState:
        error = reward - state.value
        square = add_sample(state.square, jnp.square(error), self.meta_rate)
        some = square.mean > 0
        slope = jnp.where(some, error * state.sensitivity / jnp.where(some, square.mean, 1), 0)
        log_rate = jnp.clip(state.log_rate + self.meta_rate * slope, jnp.log(LEAST_RATE), 0)
        log_rate = log_rate.astype(state.log_rate.dtype)
        moved = jnp.exp(log_rate) * error
        sensitivity = (1 - jnp.exp(log_rate)) * state.sensitivity + moved
        return LearnedStepState(state.value + moved, log_rate, sensitivity, square)
