"""Eligibility traces: how much of a reward each past action is credited with.

A trace filters scores. It is three functions over a state of the parameters' structure: `init(parameters)`,
`update(state, score)` after an action was sampled, and `value(state)`, the eligibility $z$ that multiplies the reward
(section 3.2.1 of the thesis). Every trace restarts from zero when an episode ends.
"""

import abc
import math
from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad.policies import Policy
from motorgrad.schema import Part, Range, count, number, static

MAX_FILTER_DECISIONS = 100_000  # of a finite filter, which keeps as many copies of the parameters


class Trace(Part):
    """An eligibility trace."""

    learns: ClassVar[bool] = False
    """Whether it learns from what follows: then `learn` is called, and episodes begin by `restart`."""

    @abc.abstractmethod
    def init(self, parameters: PyTree[Array]) -> PyTree[Array]:
        """The state at the start of an episode, for parameters of this structure."""

    @abc.abstractmethod
    def update(self, state: PyTree[Array], score: PyTree[Array]) -> PyTree[Array]:
        r"""Add the score $\nabla\log\pi(a_t \mid y_t)$ of the action just sampled."""

    @abc.abstractmethod
    def value(self, state: PyTree[Array]) -> PyTree[Array]:
        """The eligibility $z_t$, in the structure of the parameters."""

    def learn(self, state: PyTree[Array], advantage: PyTree[Array]) -> PyTree[Array]:
        """The state after it was multiplied by an advantage, one number or one for every parameter."""
        return state

    def restart(self, state: PyTree[Array], parameters: PyTree[Array]) -> PyTree[Array]:
        """The state at the start of the next episode; by default that before the first."""
        return self.init(parameters)

    @property
    def needs_episodes(self) -> str | None:
        """Why the trace needs a task with episodes, as a setting; `None` where it does not."""
        return None


def credited(eligibility: PyTree[Array], advantage: PyTree[Array]) -> PyTree[Array]:
    """An eligibility times an advantage, which is one number, or one for every parameter."""
    if isinstance(advantage, Policy):
        return jax.tree.map(jnp.multiply, advantage, eligibility)
    return jax.tree.map(lambda z: advantage * z, eligibility)


def latest(scores: PyTree[Array], score: PyTree[Array]) -> PyTree[Array]:
    """The last scores, the newest first, after one more."""
    return jax.tree.map(lambda buffer, s: jnp.concatenate([s[None], buffer[:-1]]), scores, score)


class Exponential(Trace):
    r"""The exponential trace $z \leftarrow \beta z + \nabla\log\pi$ (Baxter & Bartlett, 2001)."""

    decay: float = number(
        0.9,
        0,
        1,
        help=r"$\beta$, per decision. Choose $1/(1 - \beta)$ above the number of decisions over which actions still "
        r"matter (the mixing time): a small $\beta$ biases the gradient, a large one makes it noisy. 1 never forgets "
        r"and needs a task with episodes",
    )

    def init(self, parameters: PyTree[Array]) -> PyTree[Array]:
        return jax.tree.map(jnp.zeros_like, parameters)

    def update(self, state: PyTree[Array], score: PyTree[Array]) -> PyTree[Array]:
        return jax.tree.map(lambda z, s: self.decay * z + s, state, score)

    def value(self, state: PyTree[Array]) -> PyTree[Array]:
        return state

    @property
    def needs_episodes(self) -> str | None:
        return "decay = 1" if isinstance(self.decay, float) and self.decay == 1 else None


class Episodic(Trace):
    r"""The sum of all scores since the start of the episode, $z \leftarrow z + \nabla\log\pi$.

    It gives the unbiased estimator of episodic tasks (Williams, 1992) and never forgets, so it needs a task with
    episodes.
    """

    def init(self, parameters: PyTree[Array]) -> PyTree[Array]:
        return jax.tree.map(jnp.zeros_like, parameters)

    def update(self, state: PyTree[Array], score: PyTree[Array]) -> PyTree[Array]:
        return jax.tree.map(jnp.add, state, score)

    def value(self, state: PyTree[Array]) -> PyTree[Array]:
        return state

    @property
    def needs_episodes(self) -> str | None:
        return "kind = 'episodic'"


class _Kernel(Trace):
    """A finite filter: it keeps the last scores, the newest first, and weights them."""

    @abc.abstractmethod
    def weights(self) -> Float[Array, " length"]:
        """The weight of the score from 0, 1, 2 … decisions ago."""

    def init(self, parameters: PyTree[Array]) -> PyTree[Array]:
        length = len(self.weights())
        return jax.tree.map(lambda p: jnp.zeros((length, *p.shape), p.dtype), parameters)

    def update(self, state: PyTree[Array], score: PyTree[Array]) -> PyTree[Array]:
        return latest(state, score)

    def value(self, state: PyTree[Array]) -> PyTree[Array]:
        weights = jnp.asarray(self.weights())

        def total(buffer: Array) -> Array:
            return jnp.sum(weights.reshape((-1,) + (1,) * (buffer.ndim - 1)).astype(buffer.dtype) * buffer, axis=0)

        return jax.tree.map(total, state)


class Window(_Kernel):
    r"""The sum of the last scores, the present one included.

    $z_t = \sum_{k=0}^{n-1} \nabla\log\pi_{t-k}$. It estimates $\pi'\,\nabla P \sum_{k<n} P^k r$ (section
    3.2.1) and keeps $n$ copies of the parameters.
    """

    length: int = count(10, 1, MAX_FILTER_DECISIONS, unit="decisions", help="length of the window, $n$")

    def weights(self) -> Float[Array, " length"]:
        return jnp.ones(self.length)


class LaggedGaussian(_Kernel):
    r"""The sum of past scores with Gaussian weights around a lag.

    The score from $k \ge 0$ decisions ago has the weight $\exp(-\frac12((k - \text{lag})/\text{width})^2)$. For tasks
    in which an action affects the reward after a certain delay (section 3.2.1). The filter ends four widths beyond the
    lag, where the weight is below 4e-4. Both numbers set its length, so they are static.
    """

    lag: float = static(
        5.0, allowed=Range(0, MAX_FILTER_DECISIONS), unit="decisions", help="the delay with the greatest weight"
    )
    width: float = static(
        2.0, allowed=Range(0, MAX_FILTER_DECISIONS, open_low=True), unit="decisions", help="the standard deviation"
    )

    def weights(self) -> Float[Array, " length"]:
        age = jnp.arange(math.ceil(self.lag + 4 * self.width) + 1)
        return jnp.exp(-0.5 * ((age - self.lag) / self.width) ** 2)
