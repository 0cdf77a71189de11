r"""Overshooting-bounded steps (Elsayed, Vasan & Mahmood, 2024, algorithm 3): as long as a single sample allows.

A step $\alpha\delta z$ changes the prediction that it is for by some $\alpha|\delta|$ times the squared length of its
gradient. Where that is more than the error, the step overshoots. The step size is divided by

$$M = \max(1, \alpha\kappa \max(|\delta|, 1)\,\lVert z\rVert_1),$$

a bound that needs no second derivative and no further pass through a network. The error $\delta$ should be about 1 in
size; the sum of magnitudes of the step is then $1/\kappa$ at most.
"""

import abc

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._branching import Scalar
from motorgrad.learning._critic_fits import TemporalDifference
from motorgrad.schema import Part, number


def overshooting(error: Float[Array, ""], trace: PyTree[Array], scaling: Scalar) -> Float[Array, ""]:
    r"""$M$, what a step $\delta z$ is divided by, for $\alpha\kappa$ as the `scaling`."""
    length = sum(map(_length, jax.tree.leaves(trace)), start=jnp.zeros((), error.dtype))
    return jnp.maximum(1, scaling * jnp.maximum(jnp.abs(error), 1) * length)


def _length(z: Array) -> Float[Array, ""]:
    """The sum of magnitudes. Of a matrix it is a product with ones, a third of the time: XLA adds up one number after
    the other, but multiplies several at once."""
    return jnp.sum(jnp.abs(z) @ jnp.ones(z.shape[-1], z.dtype) if z.ndim > 1 else jnp.abs(z))


class BoundedTemporalDifference(TemporalDifference):
    r"""TD(λ) whose steps are bounded so that they do not overshoot (Elsayed, Vasan & Mahmood, 2024, algorithm 3).

    $w \leftarrow w + (\alpha/M)\,\delta e$ with $M = \max(1, \alpha\kappa\max(|\delta|, 1)\,\lVert e\rVert_1)$. Rewards
    should be about 1 in size.
    """

    learning_rate: float = number(1.0, 0, help=r"$\alpha$, the step size where the bound leaves it")
    scaling: float = number(2.0, 0, help=r"$\kappa$; the greater, the shorter the steps. 0 bounds nothing")

    def rate_of(self, error: Float[Array, ""], trace: PyTree) -> Scalar:
        return self.learning_rate / overshooting(error, trace, self.learning_rate * self.scaling)


class StepBound(Part):
    """How long the step of a gradient sample is, judged by the sample alone and by those before it."""

    def init(self, parameters: PyTree[Array]) -> PyTree:
        """The state before any decision, for parameters of this structure."""
        return None

    def observe(self, state: PyTree, score: PyTree[Array]) -> PyTree:
        """The state after a decision with this score."""
        return state

    @abc.abstractmethod
    def bounded(
        self, state: PyTree, sample: PyTree[Array], advantage: Float[Array, ""], eligibility: PyTree[Array]
    ) -> PyTree[Array]:
        r"""What takes the place of a `sample`, which is the `advantage` $\delta$ times the `eligibility` $z$, and more
        where there is an entropy bonus."""


class OvershootingBound(StepBound):
    r"""Bounds the steps of a policy, as `BoundedTemporalDifference` those of a critic.

    A gradient sample $g = \delta z$ is divided by $M = \max(1, \kappa\max(|\delta|, 1)\,\lVert z\rVert_1)$. With
    `SGD(1.0)` and a batch of one this is the actor's step of Elsayed, Vasan & Mahmood (2024); with another learning
    rate, the bound is as many times wider. Advantages should be about 1 in size; `RootMeanSquare` sees to that.
    """

    scaling: float = number(3.0, 0, help=r"$\kappa$; the greater, the shorter the steps. 0 bounds nothing")

    def bounded(
        self, state: PyTree, sample: PyTree[Array], advantage: Float[Array, ""], eligibility: PyTree[Array]
    ) -> PyTree[Array]:
        factor = 1 / overshooting(advantage, eligibility, self.scaling)
        return jax.tree.map(lambda g: (factor * g).astype(g.dtype), sample)
