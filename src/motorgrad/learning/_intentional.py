r"""Intentional updates (Sharifnassab et al., 2026): steps of a given size in the output, not in the parameters.

A step size in units of parameters does not say how far the output $f$ of a function moves. An intentional update names
the change that is wanted and divides it by the sensitivity of the output,

$$\alpha = \frac{\text{intended change}}{\text{sensitivity}}.$$

For a linear function and a single sample this is normalised least mean squares (Nagumo & Noda, 1967). Along a step
$\Delta = \alpha\delta P z$, with a trace $z$ and a diagonal scaling $P$, the output with the gradient $g$ changes by
$\alpha\delta\,g'Pz$. This product may be 0 or negative, as $z$ contains the gradients of older samples. So the
sensitivity here is its bound by the inequality of Cauchy and Schwarz,

$$|g'Pz| \le \sqrt{g'Pg}\,\sqrt{z'Pz},$$

with equality for $z = g$: a step never changes the output by more than is intended. $P$ is that of RMSProp (Tieleman &
Hinton, 2012), $P = \operatorname{diag}(\overline{g^2})^{-1/2}$.
"""

from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._branching import Flag, Scalar, ratio, where
from motorgrad.learning._chain import inner
from motorgrad.learning._critic_fits import CriticStep, LevelFit, level_rate
from motorgrad.learning._overshooting import StepBound
from motorgrad.schema import number


def towards(old: PyTree, new: PyTree, rate: Scalar) -> PyTree:
    """A running mean that forgets, after one more sample; a tree."""
    return jax.tree.map(lambda mean, x: (mean + rate * (x - mean)).astype(mean.dtype), old, new)


def scales(squares: PyTree[Array], weight: Float[Array, ""]) -> PyTree[Array]:
    """The diagonal of $P$; 0 for a parameter whose gradients have all been 0."""

    def scale(square: Array) -> Array:
        some = square > 0
        return jnp.where(some, jnp.sqrt(weight) * jax.lax.rsqrt(jnp.where(some, square, 1)), 0)

    return jax.tree.map(scale, squares)


def length(vector: PyTree[Array], diagonal: PyTree[Array]) -> Float[Array, ""]:
    """$x'Px$."""
    return inner(diagonal, jax.tree.map(jnp.square, vector))


def _inverse_root(sensitivity: Float[Array, ""]) -> Float[Array, ""]:
    some = sensitivity > 0
    return jnp.where(some, jax.lax.rsqrt(jnp.where(some, sensitivity, 1)), 0)


class IntentionalFit(NamedTuple):
    r"""The `trace` $e$; running means of squared gradients and of $|\delta|$, with the `weight` of their samples."""

    trace: PyTree[Array]
    squares: PyTree[Array]
    size: Float[Array, ""]
    weight: Float[Array, ""]


class IntentionalTemporalDifference(LevelFit):
    r"""TD(λ) whose steps take back a given fraction of each error (Sharifnassab et al., 2026).

    $$w \leftarrow w + \frac{\eta\,\delta}{\sqrt{g'Pg \cdot e'Pe}}\,Pe, \qquad g = \nabla_w v(y_t), \qquad
    e \leftarrow \gamma\lambda e + g .$$

    Without a trace, $v(y_t)$ moves by $\eta\delta$: of a linear critic exactly, of a network to first order. With one,
    it moves by no more. Neither the scale of rewards nor that of features matters.
    """

    linear: ClassVar[bool] = False

    fraction: float = number(0.5, 0, 1, help=r"the fraction $\eta$ of the error that a step takes back")
    rate: float = number(1e-3, 0, 1, open_low=True, help="one over the memory of the running means, in decisions")
    clip: float = number(
        20.0, 0, open_low=True, help="bound on an error, in multiples of the running mean of the errors' magnitudes"
    )
    level_rate: float = level_rate()

    def init(self, weights: PyTree, features: int) -> IntentionalFit:
        zero = jnp.zeros((), jax.tree.leaves(weights)[0].dtype)
        return IntentionalFit(weights, weights, zero, zero)

    def update(
        self, weights: PyTree, state: IntentionalFit, step: CriticStep, dropped: Flag = False
    ) -> tuple[PyTree, IntentionalFit]:
        trace = jax.tree.map(lambda e, g: step.discount * step.decay * e + g, state.trace, step.slope)
        most = ratio(self.clip * state.size, state.weight)
        error = jnp.where(most > 0, jnp.clip(step.error, -most, most), step.error)
        means = (state.squares, state.size, state.weight)
        seen = (jax.tree.map(jnp.square, step.slope), jnp.abs(step.error), jnp.ones_like(state.weight))
        squares, size, weight = towards(means, seen, self.rate)
        diagonal = scales(squares, weight)
        change = self.fraction * error * _inverse_root(length(step.slope, diagonal) * length(trace, diagonal))
        moved = eqx.apply_updates(weights, jax.tree.map(lambda p, e: (change * p * e).astype(e.dtype), diagonal, trace))
        after = IntentionalFit(trace, squares, size, weight)
        return where(dropped, weights, moved), where(dropped, state, after)

    def restart(self, state: IntentionalFit) -> IntentionalFit:
        return state._replace(trace=jax.tree.map(jnp.zeros_like, state.trace))


class IntentionalState(NamedTuple):
    r"""Running means of squared scores and of $s'Ps$, with the `weight` of their samples."""

    squares: PyTree[Array]
    sensitivity: Float[Array, ""]
    weight: Float[Array, ""]


class IntentionalStep(StepBound):
    r"""Steps that change the logarithm of the policy by a given amount (Sharifnassab et al., 2026).

    A gradient sample $\delta z$ becomes

    $$\frac{\eta\,\delta}{\sqrt{\sigma \cdot z'Pz}}\,Pz, \qquad \sigma = \overline{s'Ps},$$

    with the running mean of what scores $s$ have of $s'Ps$: the score of one action may be near 0, as that of a normal
    unit near its mean. So on average over actions the squared change of $\log\pi$ is at most $(\eta\delta)^2$, and the
    divergence of the new policy from the old to second order half of that. $\delta$ should be about 1 in size:
    `RootMeanSquare` sees to that, and its rate $\gamma$ lets none count as more than $1/\sqrt\gamma$. For steps of
    this size the learner takes `SGD(1.0)`.
    """

    change: float = number(0.05, 0, unit="nats", help=r"change $\eta$ of the log-probability for an advantage of 1")
    rate: float = number(1e-3, 0, 1, open_low=True, help="one over the memory of the running means, in decisions")

    def init(self, parameters: PyTree[Array]) -> IntentionalState:
        zeros = jax.tree.map(jnp.zeros_like, parameters)
        none = jnp.zeros((), jax.tree.leaves(zeros)[0].dtype)
        return IntentionalState(zeros, none, none)

    def observe(self, state: IntentionalState, score: PyTree[Array]) -> IntentionalState:
        one = jnp.ones_like(state.weight)
        squares = towards(state.squares, jax.tree.map(jnp.square, score), self.rate)
        weight = towards(state.weight, one, self.rate)
        seen = length(score, scales(squares, weight))
        return IntentionalState(squares, towards(state.sensitivity, seen, self.rate), weight)

    def bounded(
        self, state: IntentionalState, sample: PyTree[Array], advantage: Float[Array, ""], eligibility: PyTree[Array]
    ) -> PyTree[Array]:
        usual = ratio(state.sensitivity, state.weight)
        diagonal = scales(state.squares, state.weight)
        factor = self.change * _inverse_root(usual * length(eligibility, diagonal))
        return jax.tree.map(lambda p, g: (factor * p * g).astype(g.dtype), diagonal, sample)
