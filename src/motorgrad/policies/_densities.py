r"""Densities on [−1, 1] with a location $m$ and a spread $s$, from which bounded graded units draw their actions.

`Clipped` and `Squashed` are normal numbers moved into the interval, `Truncated` ones that happen to lie within it, and
`Beta` is the beta distribution. All are functions of one uniform number.
"""

import abc
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import betainc, digamma, gammaln, log_ndtr, ndtr, ndtri, polygamma
from jaxtyping import Array, Float

from motorgrad._random import MIN_UNIFORM

Units = Float[Array, " units"]
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
        """The number in [−1, 1] that a clipped normal number becomes."""
        return x

    def number_before(self, u: Units) -> Units:
        """The clipped normal number that became u, the inverse of `_push`."""
        return u

    def _log_stretch(self, x: Units) -> Units:
        """The logarithm of the derivative of `_push`."""
        return jnp.zeros_like(x)

    def _ends(self, m: Units, s: Units) -> tuple[Units, Units]:
        """The ends in deviations from the mean."""
        return (-self.bound - m) / s, (self.bound - m) / s

    def sample(self, m: Units, s: Units, uniforms: Units) -> Units:
        x = m + s * ndtri(jnp.maximum(uniforms, MIN_UNIFORM)).astype(m.dtype)
        inside = self._push(jnp.clip(x, -self.bound, self.bound))
        return jnp.where(x <= -self.bound, -1, jnp.where(x >= self.bound, 1, inside))

    def log_prob(self, m: Units, s: Units, u: Units) -> Units:
        (low, high) = self._ends(m, s)
        x = self.number_before(u)
        inside = -0.5 * jnp.square((x - m) / s) - jnp.log(s) - LOG_ROOT_TWO_PI - self._log_stretch(x)
        return jnp.where(u <= -1, log_ndtr(low), jnp.where(u >= 1, log_ndtr(-high), inside))

    def slopes(self, m: Units, s: Units, u: Units) -> tuple[Units, Units]:
        (low, high) = self._ends(m, s)
        z = (self.number_before(u) - m) / s
        below = _inverse_mills(low)
        above = _inverse_mills(-high)
        location = jnp.where(u <= -1, -below, jnp.where(u >= 1, above, z)) / s
        return location, jnp.where(u <= -1, -low * below, jnp.where(u >= 1, high * above, z * z - 1))

    def information(self, m: Units, s: Units) -> tuple[Units, Units, Units]:
        # Powers of z integrated over what is not clipped; and at an end of probability Φ, the squared score times Φ.
        a, b = self._ends(m, s)
        at_a = _normal(a)
        at_b = _normal(b)
        inside = ndtr(b) - ndtr(a)
        low = at_a * _inverse_mills(a)
        high = at_b * _inverse_mills(-b)
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

    def number_before(self, u: Units) -> Units:
        return jnp.arctanh(jnp.clip(u, -1, 1) * math.tanh(self.bound))

    def _log_stretch(self, x: Units) -> Units:
        return 2 * (math.log(2) - x - jax.nn.softplus(-2 * x)) - math.log(math.tanh(self.bound))

    def entropy_estimate(self, m: Units, s: Units, uniforms: Units) -> Units:
        """An estimate of the entropy from the numbers of one `sample`, without a quadrature."""
        # The entropy of the normal number is exact, and what squashing takes away is that of one number. The ends have
        # a probability of their own, which is left out: it matters only where |m| is near 4.
        x = m + s * ndtri(jnp.maximum(uniforms, MIN_UNIFORM)).astype(m.dtype)
        return jnp.log(s) + LOG_ROOT_TWO_PI + 0.5 + self._log_stretch(x)

    def location(self, mode: float) -> float:
        return math.atanh(mode * math.tanh(self.bound))


class Truncated(Density):
    r"""A normal number, given that it lies within [−1, 1] (Burkardt, 2014).

    With a large spread it is uniform; with a location outside the interval, exponential from the end. There the closed
    forms of its moments cancel, so a quadrature gives them, on what is not negligible of the interval.
    """

    def sample(self, m: Units, s: Units, uniforms: Units) -> Units:
        # Mirrored such that the upper end is the near one: the normal distribution function is exact for what is below.
        mirrored = m < 0
        m = jnp.where(mirrored, -m, m)
        p = jnp.where(mirrored, 1 - uniforms, uniforms).astype(m.dtype)
        p = jnp.maximum(p, MIN_UNIFORM)
        low = (-1 - m) / s
        high = (1 - m) / s
        from_low = ndtr(low) + p * (ndtr(high) - ndtr(low))
        near = m + s * ndtri(jnp.clip(from_low, MIN_UNIFORM * ndtr(high), 1 - MIN_UNIFORM))
        # Far from the end, the distance from it in deviations is √(η² + 2e) − η but for the correction.
        eta = jnp.maximum(-high, FAR)
        width = (high - low) * (eta + 0.5 * (high - low))
        e = -jnp.log1p((1 - p) * jnp.expm1(-width))
        distance = 2 * e / (jnp.sqrt(eta * eta + 2 * e) + eta)
        away = eta + distance
        distance = distance - jnp.log((away + 1 / away) / (eta + 1 / eta)) / away
        u = jnp.clip(jnp.where(high < -FAR, 1 - s * distance, near), -1, 1)
        return jnp.where(mirrored, -u, u)

    def log_prob(self, m: Units, s: Units, u: Units) -> Units:
        _, square, log_mass, *_ = self._moments(m, s)
        return -0.5 * square(u) - log_mass

    def slopes(self, m: Units, s: Units, u: Units) -> tuple[Units, Units]:
        away, square, _, x, share = self._moments(m, s)
        location = (away(u) - jnp.sum(share * away(x), axis=0)) / (s * s)
        return location, square(u) - jnp.sum(share * square(x), axis=0)

    def information(self, m: Units, s: Units) -> tuple[Units, Units, Units]:
        away, square, _, x, share = self._moments(m, s)
        linear = away(x) / (s * s)
        quadratic = square(x)
        linear = linear - jnp.sum(share * linear, axis=0)
        quadratic = quadratic - jnp.sum(share * quadratic, axis=0)
        products = (linear * linear, linear * quadratic, quadratic * quadratic)
        of_m, both, of_s = (jnp.sum(share * product, axis=0) for product in products)
        return of_m, both, of_s

    def mode(self, m: Units) -> Units:
        return jnp.clip(m, -1, 1)

    def mean(self, m: Units, s: Units) -> Units:
        *_, x, share = self._moments(m, s)
        return jnp.sum(share * x, axis=0)

    def entropy(self, m: Units, s: Units) -> Units:
        _, square, log_mass, x, share = self._moments(m, s)
        return log_mass + 0.5 * jnp.sum(share * square(x), axis=0)

    def _moments(self, m: Units, s: Units) -> tuple[Any, ...]:
        r"""The functions $u - u_0$ and $((u - m)^2 - (u_0 - m)^2)/s^2$, where $u_0$ is the mode; the logarithm of the
        integral of exp(−½ of the second); and a rule for means, its nodes and the share of each."""
        peak = jax.lax.stop_gradient(self.mode(m))
        x, weights = _legendre(*_support(m, s, 1.0))

        def away(u: Array) -> Array:
            return u - peak

        def square(u: Array) -> Array:
            return away(u) * (away(u) + 2 * (peak - m)) / (s * s)

        masses = weights * jnp.exp(-0.5 * square(x))
        whole = jnp.sum(masses, axis=0)
        return away, square, jnp.log(whole), x, masses / whole


class Beta(Density):
    r"""A beta distribution with $\alpha = 1 + \kappa\mu$ and $\beta = 1 + \kappa(1 - \mu)$, on [−1, 1] (Chou et
    al., 2017).

    $\mu = \sigma(2m)$ and $\kappa = 1/s^2$. So the mode is tanh m, and a small spread is, for $m = 0$, the standard
    deviation; with a large one the distribution is uniform. As $\alpha$ and $\beta$ are at least 1, the density has one
    peak and is bounded. The score contains $\log(1 \pm u)$, which is bounded by taking an action at an end as the
    nearest number within: in single precision, 6e-8 from it.

    Newton's method inverts the distribution function.
    """

    iterations = 6

    def _shape(self, m: Units, s: Units) -> tuple[Units, Units, Units, Units, Units]:
        r"""$\alpha$, $\beta$, $\kappa$, $\mu$ and $1 - \mu$."""
        kappa = 1 / (s * s)
        up = jax.nn.sigmoid(2 * m)
        down = jax.nn.sigmoid(-2 * m)
        return 1 + kappa * up, 1 + kappa * down, kappa, up, down

    def sample(self, m: Units, s: Units, uniforms: Units) -> Units:
        alpha, beta, *_ = self._shape(m, s)
        # The lower half is solved, of the distribution or of its mirror image, where log F is exact.
        mirrored = uniforms > 0.5
        alpha, beta = jnp.where(mirrored, beta, alpha), jnp.where(mirrored, alpha, beta)
        p = jnp.maximum(jnp.where(mirrored, 1 - uniforms, uniforms), MIN_UNIFORM).astype(m.dtype)
        log_p = jnp.log(p)
        log_beta = _log_beta(alpha, beta)

        def improved(_: int, x: Array) -> Array:
            # log F is concave in x, so that Newton's method finds its root from everywhere.
            below = jnp.maximum(betainc(alpha, beta, jax.nn.sigmoid(2 * x)), jnp.finfo(x.dtype).tiny)
            log_density = alpha * jax.nn.log_sigmoid(2 * x) + beta * jax.nn.log_sigmoid(-2 * x) - log_beta
            log_below = jnp.log(below)
            return x + jnp.clip((log_p - log_below) * jnp.exp(log_below - log_density) / 2, -2, 2)

        middle = jnp.log((alpha - 0.5) / (beta - 0.5))
        width = jnp.sqrt(1 / (alpha - 0.4) + 1 / (beta - 0.4))
        start = 0.5 * (middle + width * ndtri(p))
        u = jnp.tanh(jax.lax.fori_loop(0, self.iterations, improved, start))
        return jnp.where(mirrored, -u, u)

    def log_prob(self, m: Units, s: Units, u: Units) -> Units:
        alpha, beta, *_ = self._shape(m, s)
        up, down = self._log_shares(u)
        return (alpha - 1) * up + (beta - 1) * down - _log_beta(alpha, beta) - math.log(2)

    def slopes(self, m: Units, s: Units, u: Units) -> tuple[Units, Units]:
        alpha, beta, kappa, up, down = self._shape(m, s)
        log_up, log_down = self._log_shares(u)
        both = digamma(alpha + beta)
        of_alpha = log_up - digamma(alpha) + both
        of_beta = log_down - digamma(beta) + both
        return 2 * kappa * up * down * (of_alpha - of_beta), -2 * kappa * (up * of_alpha + down * of_beta)

    def information(self, m: Units, s: Units) -> tuple[Units, Units, Units]:
        alpha, beta, kappa, up, down = self._shape(m, s)
        of_alpha, of_beta, both = (polygamma(1, each) for each in (alpha, beta, alpha + beta))
        rise = 2 * kappa * up * down
        of_s = up * up * of_alpha + down * down * of_beta - both
        cross = -2 * kappa * rise * (up * of_alpha - down * of_beta)
        return rise * rise * (of_alpha + of_beta), cross, 4 * kappa * kappa * of_s

    def mode(self, m: Units) -> Units:
        return jnp.tanh(m)

    def mean(self, m: Units, s: Units) -> Units:
        alpha, beta, *_ = self._shape(m, s)
        return (alpha - beta) / (alpha + beta)

    def entropy(self, m: Units, s: Units) -> Units:
        alpha, beta, kappa, *_ = self._shape(m, s)
        ends = (alpha - 1) * digamma(alpha) + (beta - 1) * digamma(beta)
        return _log_beta(alpha, beta) - ends + kappa * digamma(alpha + beta) + math.log(2)

    def location(self, mode: float) -> float:
        return math.atanh(mode)

    def _log_shares(self, u: Units) -> tuple[Units, Units]:
        """The logarithms of the distances from both ends, of the whole range."""
        most = 1 - jnp.finfo(u.dtype).epsneg
        u = jnp.clip(u, -most, most)
        return jnp.log1p(u) - math.log(2), jnp.log1p(-u) - math.log(2)


DENSITIES: dict[str, Density] = {"beta": Beta(), "clipped": Clipped(), "squashed": Squashed(), "truncated": Truncated()}
"""The densities of bounded graded units, by name."""

FAR = 10.0
"""From how many deviations outside the interval the tail of the normal distribution is computed by its logarithm."""
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
    rule = np.polynomial.legendre.leggauss(24)
    nodes, weights = (jnp.asarray(x, low.dtype).reshape(-1, *(1,) * low.ndim) for x in rule)
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
    tail = 1 / (away * away)
    expansion = -away * (1 + tail * (1 - tail * (2 - tail * (10 - 74 * tail))))
    return jnp.where(far, expansion, jnp.exp(-0.5 * near * near - LOG_ROOT_TWO_PI - log_ndtr(near)))


def _log_beta(alpha: Units, beta: Units) -> Units:
    """The logarithm of the beta function; JAX's `betaln` has derivatives of single precision only."""
    return gammaln(alpha) + gammaln(beta) - gammaln(alpha + beta)
