r"""Batches that end once their gradient is accurate enough (section 3.2.2 of the thesis).

The mean $\hat g$ of a batch has an error of variance $e^2$, the sum over all parameters. Samples $\delta z$ share most
of a trace, so their variance would promise too much: the batch is cut into blocks longer than the trace, and the
variance of $n$ block means $\bar g_i$ shows that of their mean (the method of batch means; Law & Kelton, 2000),

$$e^2 = \frac{1}{n (n - 1)} \sum_i \lVert \bar g_i - \hat g \rVert^2,\qquad
\lVert g \rVert^2 \approx \lVert \hat g \rVert^2 - e^2 .$$
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._branching import Flag, where
from motorgrad._errors import check
from motorgrad._running import RunningMean, add_observation, counted_on, running_mean
from motorgrad.policies import Policy, trainable
from motorgrad.schema import Part, count, number


class AccuracyState(NamedTuple):
    """The sum of the samples of the `block` in progress, and their `waiting` number; the running `mean` and `variance`
    of the means of the batch's blocks; how many steps were made, and how many of them `unsure`."""

    block: Float[Array, " parameters"]
    waiting: Int[Array, ""]
    mean: RunningMean
    variance: RunningMean
    steps: Int[Array, ""]
    unsure: Int[Array, ""]


class Accuracy(Part):
    r"""Ends a batch once the relative standard error of its mean gradient is small enough,
    $e^2 \le \epsilon^2\,(\lVert\hat g\rVert^2 - e^2)$.

    It is looked at after every block. A batch that never gets so accurate ends at its greatest length, the estimator's
    `update_every`; the reading `unsure` of a run is the share of steps that were made so. Stopping when a batch looks
    accurate is a little optimistic: the less, the more blocks it has at `least`.
    """

    error: float = number(
        1.0,
        0,
        open_low=True,
        help=r"$\epsilon$, the standard error relative to the gradient; the estimate is then about "
        r"$\arctan\epsilon$ away from its direction, 45° for 1",
    )
    block: int = count(
        20, 1, 1_000_000, unit="decisions", help="length of a block, best some times the reach of the trace"
    )
    least: int = count(5, 2, 1_000_000, unit="blocks", help="the least number of blocks of a batch")

    def check(self, update_every: Any) -> None:
        """Refuse another greatest length of a batch than one with room for its blocks."""
        least = self.least * self.block
        fits = isinstance(update_every, int) and update_every >= least
        words = f"a number of at least {least:,} samples, the greatest length of a batch, with Accuracy"
        check(fits, "update_every", update_every, words)

    def init(self, policy: Policy) -> AccuracyState:
        """The state before the first sample."""
        zeros = jnp.zeros_like(ravel_pytree(trainable(policy))[0])
        none = jnp.zeros((), jnp.int32)
        return AccuracyState(zeros, none, running_mean(zeros), running_mean(zeros), none, none)

    def add(self, state: AccuracyState, sample: PyTree[Array], dropped: Flag = False) -> AccuracyState:
        """The state after a gradient sample; one that is `dropped` changes nothing."""
        block = state.block + ravel_pytree(sample)[0].astype(state.block.dtype)
        full = state.waiting + 1 >= self.block
        mean, variance = add_observation(state.mean, state.variance, block / self.block)
        ended = state._replace(
            block=jnp.zeros_like(block), waiting=jnp.zeros_like(state.waiting), mean=mean, variance=variance
        )
        after = where(full, ended, state._replace(block=block, waiting=state.waiting + 1))
        return where(dropped, state, after)

    def reached(self, state: AccuracyState) -> Bool[Array, ""]:
        """Whether the batch so far is accurate enough."""
        blocks = state.mean.count.astype(state.block.dtype)
        square = jnp.sum(state.variance.mean) / jnp.maximum(blocks - 1, 1)
        signal = jnp.sum(jnp.square(state.mean.mean)) - square
        return (blocks >= self.least) & (square <= self.error**2 * signal)

    def restart(self, state: AccuracyState) -> AccuracyState:
        """The state after a step of the parameters."""
        zeros = jnp.zeros_like(state.block)
        return AccuracyState(
            zeros,
            jnp.zeros_like(state.waiting),
            running_mean(zeros),
            running_mean(zeros),
            counted_on(state.steps),
            counted_on(state.unsure, jnp.where(self.reached(state), 0, 1)),
        )

    def decisions_until_due(self, state: AccuracyState) -> Int[Array, ""]:
        """The least number of coming decisions in which no block ends."""
        return self.block - 1 - state.waiting

    def readings(self, state: AccuracyState) -> dict[str, Array]:
        """The share of steps that were made at the greatest length of a batch, `unsure`; 0 before the first."""
        return {"unsure": state.unsure / jnp.maximum(state.steps, 1)}
