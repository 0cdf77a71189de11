r"""A learned eligibility filter: how much a reward tells about an action a given time ago, relative to the noise.

The gradient is a sum over lags, $\nabla\eta = \sum_k m_k$ with $m_k = \mathbb E[\delta_t s_{t-k}]$ for the score
$s_{t-k}$ of the action $k$ decisions before. A filter weights the lags, $\sum_k c_k \hat m_k$. A mean $\hat m_k$ of
total variance $V_k$ is nearest to $m_k$ on average when it is multiplied by

$$c_k = \frac{\lVert m_k\rVert^2}{\lVert m_k\rVert^2 + V_k} \approx 1 - \frac{V_k}{\lVert\hat m_k\rVert^2},$$

as $\mathbb E\lVert\hat m_k\rVert^2 = \lVert m_k\rVert^2 + V_k$: shrinkage as by James & Stein (1961). The thesis
proposes to learn the parameters of the filter (section 3.2.1). This rule is derived here, not taken from it.
"""

from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._traces import MAX_FILTER_DECISIONS, Trace, credited, latest
from motorgrad.schema import count, number


class LearnedState(NamedTuple):
    r"""The last `scores`, the newest first; the `means` of $\delta_t s_{t-k}$ for every lag and of its squared length;
    `share`, the sum of squared weights of the samples in these means, one over how many they are worth."""

    scores: PyTree[Array]
    means: RunningMean
    share: Float[Array, ""]


class LearnedTrace(Trace):
    r"""A filter whose weights are learned, $z_t = \sum_{k<n} c_k s_{t-k}$ with $c_k = \max(0, 1 - V_k/\lVert\hat
    m_k\rVert^2)$.

    $\hat m_k$ is the running mean of $\delta_t s_{t-k}$ and $V_k$ its estimated variance, all parameters together. A
    lag counts as far as its mean stands out of its noise. Weights start at 0, so nothing is credited at first. They are
    the best ones, lag by lag, for a mean over as many decisions as are remembered. What is neglected: that successive
    samples are correlated, that errors of several lags may add up, and that weights of the past are in the mean of a
    batch.

    It keeps the last scores and their means, four copies of the parameters for each lag. When an episode ends, the
    scores are forgotten and the means are not.

    **Raises:** `ValueError` for a value out of range. An `Estimator` refuses it with parts that have a use of their own
    for the newest score.

    ```python
    estimator = mg.learning.Estimator(mg.learning.LearnedTrace(length=20, rate=1e-3), mg.learning.MeanReward())
    ```
    """

    learns: ClassVar[bool] = True

    length: int = count(20, 1, MAX_FILTER_DECISIONS, unit="decisions", help="$n$, lags from 0 to $n - 1$")
    rate: float = number(
        1e-3,
        0,
        1,
        open_high=True,
        help=r"$\kappa$; the n-th sample moves the means by $\max(1/n, \kappa)$ of its distance. Choose $1/\kappa$ "
        r"about as many decisions as the policy needs to change; 0 is for a policy that stays",
    )

    def init(self, parameters: PyTree[Array]) -> LearnedState:
        scores = jax.tree.map(lambda p: jnp.zeros((self.length, *p.shape), p.dtype), parameters)
        dtype = jax.tree.leaves(parameters)[0].dtype
        return LearnedState(scores, running_mean((scores, jnp.zeros(self.length, dtype))), jnp.ones((), dtype))

    def update(self, state: LearnedState, score: PyTree[Array]) -> LearnedState:
        return state._replace(scores=latest(state.scores, score))

    def value(self, state: LearnedState) -> PyTree[Array]:
        weights = self.weights(state)
        return jax.tree.map(lambda rows: jnp.tensordot(weights, rows, axes=1).astype(rows.dtype), state.scores)

    def weights(self, state: LearnedState) -> Float[Array, " length"]:
        """$c_k$ of the score from 0, 1, 2 … decisions ago."""
        products, squares = state.means.mean
        lengths = _squares(products)
        variance = jnp.maximum(squares - lengths, 0) * state.share
        some = (lengths > 0) & (state.share < 1)
        # The variance of samples about their own mean is too small, by the factor 1 - share.
        kept = 1 - variance / jnp.where(some, (1 - state.share) * lengths, 1)
        return jnp.where(some, jnp.maximum(kept, 0), 0)

    def learn(self, state: LearnedState, advantage: PyTree[Array]) -> LearnedState:
        products = credited(state.scores, advantage)
        means = add_sample(state.means, (products, _squares(products)), self.rate)
        step = jnp.maximum(1 / means.count.astype(state.share.dtype), self.rate)
        share = jnp.square(1 - step) * state.share + jnp.square(step)
        return LearnedState(state.scores, means, share.astype(state.share.dtype))

    def restart(self, state: LearnedState, parameters: PyTree[Array]) -> LearnedState:
        return state._replace(scores=jax.tree.map(jnp.zeros_like, state.scores))


def _squares(rows: PyTree[Array]) -> Float[Array, " length"]:
    """The squared length of every lag's vector, all parameters together."""
    return sum(jnp.sum(jnp.square(leaf.reshape(len(leaf), -1)), axis=1) for leaf in jax.tree.leaves(rows))  # type: ignore[return-value]
