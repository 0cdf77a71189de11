r"""Baselines that weight a reward by the eligibility that it meets.

A sample is $g = (r - b)\,z$. A constant $b$ does not change its mean, as $\mathbb E z = 0$. The one that makes its mean
square least is not the mean of rewards, but

$$b^* = \frac{\mathbb E[\lVert z\rVert^2\,r]}{\mathbb E[\lVert z\rVert^2]}$$

(Greensmith, Bartlett & Baxter, 2004). A reward counts as much as $z$ magnifies it. Every unit, and every parameter, may
have a baseline of its own, which is the best one for its own part of $z$.
"""

import abc
from typing import Any, ClassVar, Literal

import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float, PyTree

from motorgrad._branching import ratio, where
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._baselines import Advantage, Baseline
from motorgrad.learning._learner import Transition
from motorgrad.policies import Policy, abilities, trainable
from motorgrad.schema import number, static

Each = Literal["policy", "unit", "parameter"]
Rows = tuple[Float[Array, "units parameters"], ...]


class EligibilityBaseline(Baseline):
    """A mean of rewards, weighted by a function of the squared length of the trace at that time, `weight`.

    The state is the running mean of the products of weights and rewards, and that of the weights.
    """

    needs_eligibility: ClassVar[bool] = True

    rate: float = number(
        0.0, 0, 1, help=r"$\gamma$, per reward; the n-th reward moves the means by $\max(1/n, \gamma)$ of the distance"
    )

    @property
    @abc.abstractmethod
    def apart(self) -> Each:
        """What has a baseline of its own."""

    @abc.abstractmethod
    def weight(self, squares: Float[Array, "*own"]) -> Float[Array, "*own"]:
        """The weight of a reward, from the squared length of the part of the trace that has a baseline of its own."""

    def init(self, policy: Policy, dtype: DTypeLike) -> RunningMean:
        like = self._lengths(policy, jax.tree.map(jnp.zeros_like, trainable(policy)))
        return running_mean(tuple((part.astype(dtype),) * 2 for part in like))

    def values(self, state: RunningMean) -> tuple[Float[Array, "units parameters"], ...]:
        """The baselines, in the form of `abilities.blocks`, with axes of length 1 for what shares one; 0 for what has
        not been eligible yet."""
        return tuple(ratio(products, weights) for products, weights in state.mean)

    def level(self, state: RunningMean) -> Float[Array, ""]:
        products, weights = (sum(jnp.sum(pair[place]) for pair in state.mean) for place in (0, 1))
        return ratio(jnp.asarray(products), jnp.asarray(weights))

    def update(self, state: RunningMean, policy: Policy, transition: Transition) -> tuple[Advantage, RunningMean]:
        reward, eligibility = transition.reward, transition.eligibility
        squares = self._lengths(policy, eligibility)
        weights = tuple(self.weight(part) for part in squares)
        after = add_sample(state, tuple((w * reward, w) for w in weights), self.rate)
        level = reward - self.level(state)
        errors: Any = level
        if self.apart != "policy":
            rows = abilities.blocks(policy, eligibility)
            apart = zip(self.values(state), rows, strict=True)
            errors = abilities.from_blocks(policy, tuple(jnp.broadcast_to(reward - b, row.shape) for b, row in apart))
        return Advantage(level, errors), where(transition.diverged, state, after)

    def _lengths(self, policy: Policy, eligibility: PyTree[Array]) -> Rows:
        """The squared lengths of the parts of a trace that have a baseline of their own."""
        squares = [jnp.square(row) for row in abilities.blocks(policy, eligibility)]
        if self.apart == "policy":
            return (jnp.reshape(jnp.stack([jnp.sum(part) for part in squares]).sum(), (1, 1)),)
        return tuple(squares if self.apart == "parameter" else [part.sum(1, keepdims=True) for part in squares])


class OptimalBaseline(EligibilityBaseline):
    r"""The constant that makes samples least noisy (Greensmith, Bartlett & Baxter, 2004), for the whole policy or for
    each part of it.

    $b^* = \overline{\lVert z\rVert^2 r}\,/\,\overline{\lVert z\rVert^2}$, with means over all rewards so far or over
    the last $1/\gamma$. It minimises the mean square of single samples, and ignores that successive samples of a long
    trace are correlated.

    ```python
    estimator = mg.learning.olgarb(0.95, mg.learning.OptimalBaseline(each="unit", rate=1e-4))
    ```
    """

    each: Each = static(
        "policy",
        kw_only=True,
        help="what has a baseline of its own: the policy as a whole, every unit (row of its blocks) or parameter",
    )

    @property
    def apart(self) -> Each:
        return self.each

    def weight(self, squares: Float[Array, "*own"]) -> Float[Array, "*own"]:
        return squares


class UnitMean(EligibilityBaseline):
    r"""A mean of rewards for every unit, weighted by its share in them, $b_i = \overline{\lVert z_i\rVert\,r}\,/\,
    \overline{\lVert z_i\rVert}$.

    A unit that acts only in a part of the input space compares rewards with those that are usual there. The weight is
    the length of the unit's trace, where `OptimalBaseline` has its square.
    """

    @property
    def apart(self) -> Each:
        return "unit"

    def weight(self, squares: Float[Array, "*own"]) -> Float[Array, "*own"]:
        return jnp.sqrt(squares)
