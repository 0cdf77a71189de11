r"""Densities on [−1, 1] with a location $m$ and a spread $s$, from which bounded graded units draw their actions.

`Clipped` and `Squashed` are normal numbers moved into the interval, with closed forms. `Truncated` and `Beta` are given
by the logarithm of a density; one quadrature on the part of the interval where the density is not negligible yields
their normalisation, moments and inverse distribution function. It is accurate to single precision however narrow the
density is, and however far its location lies outside, where the closed forms cancel.
"""

import abc
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import log_ndtr, ndtr, ndtri
from jaxtyping import Array, Float

Units = Float[Array, " units"]
LEAST = 2.0**-24  # replaces a uniform number of 0, whose normal quantile is −∞: below the resolution of float32
LOG_ROOT_TWO_PI = 0.5 * math.log(2 * math.pi)


class Density(abc.ABC):
    """A family of distributions on [−1, 1]. Everything is a function of arrays `m` and `s` with one entry per unit."""

    @abc.abstractmethod
    def sample(self, m: Units, s: Units, uniforms: Units) -> Units:
        """The inverse distribution function at numbers from U[0, 1)."""

    @abc.abstractmethod
    def log_prob(self, m: Units, s: Units, u: Units) -> Units:
        """The logarithm of the density; at an end with a probability of its own, of that probability."""

    @abc.abstractmethod
    def slopes(self, m: Units, s: Units, u: Units) -> tuple[Units, Units]:
        r"""The derivatives of `log_prob` by $m$ and by $\log s$."""

    @abc.abstractmethod
    def information(self, m: Units, s: Units) -> tuple[Units, Units, Units]:
        r"""The Fisher information of $m$ and $\log s$: $I_{mm}$, $I_{ms}$ and $I_{ss}$."""

    @abc.abstractmethod
    def mode(self, m: Units) -> Units:
        """The most probable value."""

    @abc.abstractmethod
    def mean(self, m: Units, s: Units) -> Units:
        """The mean."""

    @abc.abstractmethod
    def entropy(self, m: Units, s: Units) -> Units:
        """The entropy in nats, with respect to the measure of `log_prob`."""

    def at_end(self, u: Units) -> Any:
        """Whether a value is an end with a probability of its own."""
        return False

    def inside(self, m: Units, s: Units) -> Any:
        """The probability of not being at such an end."""
        return 1.0

    def location(self, mode: float) -> float:
        """The location whose mode is `mode`, above −1 and below 1."""
        return mode


class Clipped(Density):
    r"""A normal number that is clipped to [−1, 1] (Fujita & Maeda, 2018).

    The ends have a probability of their own, $\Phi((-1 - m)/s)$ and $\Phi((m - 1)/s)$, and its derivatives are their
    score. So a unit can rest, or act with all its strength, for sure. The score of a normal number that was clipped
    without being told would be biased, and of higher variance.
    """

    bound = 1.0

    def _push(self, x: Units) -> Units:
        """From the clipped normal number to [−1, 1]."""
        return x

    def _pull(self, u: Units) -> Units:
        """The inverse of `_push`."""
        return u

    def _log_stretch(self, x: Units) -> Units:
        """The logarithm of the derivative of `_push`."""
        return jnp.zeros_like(x)

    def _ends(self, m: Units, s: Units) -> tuple[Units, Units]:
        """The ends in deviations from the mean."""
        return (-self.bound - m) / s, (self.bound - m) / s

    def sample(self, m: Units, s: Units, uniforms: Units) -> Units:
        x = m + s * ndtri(jnp.maximum(uniforms, LEAST)).astype(m.dtype)
        inside = self._push(jnp.clip(x, -self.bound, self.bound))
        return jnp.where(x <= -self.bound, -1, jnp.where(x >= self.bound, 1, inside))

    def log_prob(self, m: Units, s: Units, u: Units) -> Units:
        (low, high), x = self._ends(m, s), self._pull(u)
        inside = -0.5 * jnp.square((x - m) / s) - jnp.log(s) - LOG_ROOT_TWO_PI - self._log_stretch(x)
        return jnp.where(u <= -1, log_ndtr(low), jnp.where(u >= 1, log_ndtr(-high), inside))

    def slopes(self, m: Units, s: Units, u: Units) -> tuple[Units, Units]:
        (low, high), z = self._ends(m, s), (self._pull(u) - m) / s
        below, above = _inverse_mills(low), _inverse_mills(-high)
        location = jnp.where(u <= -1, -below, jnp.where(u >= 1, above, z)) / s
        return location, jnp.where(u <= -1, -low * below, jnp.where(u >= 1, high * above, z * z - 1))

    def information(self, m: Units, s: Units) -> tuple[Units, Units, Units]:
        # Powers of z integrated over what is not clipped; and at an end of probability Φ, the squared score times Φ.
        a, b = self._ends(m, s)
        at_a, at_b, inside = _normal(a), _normal(b), ndtr(b) - ndtr(a)
        low, high = at_a * _inverse_mills(a), at_b * _inverse_mills(-b)
        of_m = inside + a * at_a - b * at_b + low + high
        both = (a * a + 1) * at_a - (b * b + 1) * at_b + a * low + b * high
        of_s = 2 * inside + (a * a + 1) * a * at_a - (b * b + 1) * b * at_b + a * a * low + b * b * high
        return of_m / (s * s), both / s, of_s

    def mode(self, m: Units) -> Units:
        return self._push(jnp.clip(m, -self.bound, self.bound))

    def mean(self, m: Units, s: Units) -> Units:
        a, b = self._ends(m, s)
        return ndtr(-b) - ndtr(a) + self._over_inside(m, s, self._push)

    def entropy(self, m: Units, s: Units) -> Units:
        a, b = self._ends(m, s)

        def surprise(x: Array) -> Array:
            return 0.5 * jnp.square((x - m) / s) + jnp.log(s) + LOG_ROOT_TWO_PI + self._log_stretch(x)

        ends = -ndtr(a) * log_ndtr(a) - ndtr(-b) * log_ndtr(-b)
        return ends + self._over_inside(m, s, surprise)

    def at_end(self, u: Units) -> Any:
        return (u <= -1) | (u >= 1)

    def inside(self, m: Units, s: Units) -> Any:
        a, b = self._ends(m, s)
        return ndtr(b) - ndtr(a)

    def _over_inside(self, m: Units, s: Units, function: Callable[[Array], Array]) -> Units:
        """The integral of a function of the normal number, times its density, over what is not clipped."""
        x, weights = _legendre(*_support(m, s, self.bound))
        return jnp.sum(weights * _normal((x - m) / s) / s * function(x), axis=0)


class Squashed(Clipped):
    r"""The hyperbolic tangent of a normal number (Haarnoja et al., 2018).

    The logistic function of a normal number is the same but for the units of $m$ and $s$. The normal number is clipped
    to ±4 before it is squashed, and the result, within ±0.9993, stretched to ±1: the exact ends occur, with a
    probability and a finite score of their own, as in `Clipped`. Beyond ±4 single precision could not tell from the
    action which number was drawn.

    The `mode` is that of the number before it is squashed, so the median of the result.
    """

    bound = 4.0

    def _push(self, x: Units) -> Units:
        return jnp.tanh(x) / math.tanh(self.bound)

    def _pull(self, u: Units) -> Units:
        return jnp.arctanh(jnp.clip(u, -1, 1) * math.tanh(self.bound))

    def _log_stretch(self, x: Units) -> Units:
        return 2 * (math.log(2) - x - jax.nn.softplus(-2 * x)) - math.log(math.tanh(self.bound))

    def location(self, mode: float) -> float:
        return math.atanh(mode * math.tanh(self.bound))


DENSITIES: dict[str, Density] = {"clipped": Clipped(), "squashed": Squashed()}
"""The densities of bounded graded units, by name."""

NEGLIGIBLE = 20.0
"""What a density has fallen to, e^-20 of its peak, where an integral over it ends."""


def _support(m: Units, s: Units, bound: float) -> tuple[Units, Units]:
    """Where within ±`bound` the density of a normal number is not negligible against its greatest there."""
    m, s = jax.lax.stop_gradient((m, s))
    peak = jnp.clip(m, -bound, bound)
    # The distance t from the peak at which (t² + 2 t |m − peak|)/2s² is so large.
    off = jnp.abs(m - peak)
    reach = 2 * NEGLIGIBLE * s * s / (off + jnp.sqrt(off * off + 2 * NEGLIGIBLE * s * s))
    return jnp.maximum(peak - reach, -bound), jnp.minimum(peak + reach, bound)


def _legendre(low: Units, high: Units) -> tuple[Float[Array, "nodes units"], Float[Array, "nodes units"]]:
    """Nodes and weights of the Gauss-Legendre rule on each interval."""
    nodes, weights = (jnp.asarray(x, low.dtype)[:, None] for x in np.polynomial.legendre.leggauss(24))
    half = (high - low) / 2
    return (low + high) / 2 + half * nodes, half * weights


def _normal(z: Units) -> Units:
    """The standard normal density."""
    return jnp.exp(-0.5 * z * z - LOG_ROOT_TWO_PI)


def _inverse_mills(z: Units) -> Units:
    r"""$\varphi(z)/\Phi(z)$, the derivative of $\log\Phi$."""
    far = z < -30
    near = jnp.where(far, -30.0, z)  # beyond, the logarithms are so large that their difference loses its digits
    away = jnp.where(far, z, -30.0)
    return jnp.where(far, -away - 1 / away, jnp.exp(-0.5 * near * near - LOG_ROOT_TWO_PI - log_ndtr(near)))
