"""A Gaussian process that is observed through scores and through their derivatives, in tinygp's form."""

# pyright: reportMissingImports=false
# (tinygp is of the extra `search`; `_bayesian.py` imports this file when it is needed)

from typing import Any, NamedTuple, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import tinygp
from jaxtyping import Array, Float
from scipy.optimize import minimize

JITTER = 1e-8
"""Variance added to every observation, in squared standard deviations of the scores, for a stable factorisation."""
BLOCK = 128
"""Places whose posterior is computed at a time, so that one shape is compiled."""
SIGNAL = (0.1, 10.0)
"""Bounds of the process's standard deviation, in standard deviations of the scores."""


class Functional(NamedTuple):
    r"""What an observation sees of the function: $w\,f(x) + v \cdot \nabla f(x)$.

    - `place`: $x$.
    - `weight`: $w$, 1 for a score and 0 for a derivative.
    - `direction`: $v$, 0 for a score and a unit vector for a derivative.

    Where both are 0, the row is empty: it correlates with nothing.
    """

    place: Float[Any, "*rows size"]
    weight: Float[Any, "*rows"]
    direction: Float[Any, "*rows size"]


class Data(NamedTuple):
    """Observations: what they see, their values, and the variances of their noise, as far as these are known."""

    seen: Functional
    values: Float[Any, " rows"]
    variances: Float[Any, " rows"]

    @classmethod
    def of(
        cls, places: np.ndarray, scores: np.ndarray, gradients: np.ndarray, variances: np.ndarray, capacity: int
    ) -> Self:
        """The data of some candidates: one row for each score, then one for each derivative if there are any.

        **Arguments:**

        - `places` (candidates, size), `scores` (candidates,), `gradients` and `variances` (candidates, size): NaN in
          `gradients` marks a derivative that was not observed.
        - `capacity`: for so many candidates there are rows. Those that are not used are empty, so that few shapes are
          compiled.
        """
        count, size = places.shape
        place = np.zeros((capacity, size))
        place[:count] = places
        values = np.zeros((capacity, 1 + size))
        noise = np.ones_like(values)
        used = np.zeros_like(values)
        values[:count, 0] = scores
        noise[:count, 0] = 0.0
        used[:count, 0] = 1.0
        known = np.isfinite(gradients)
        values[:count, 1:] = np.where(known, gradients, 0.0)
        noise[:count, 1:] = np.where(known, variances, 1.0)
        used[:count, 1:] = known
        columns = 1 + size if known.any() else 1
        directions = np.concatenate([np.zeros((1, size)), np.eye(size)])[:columns]
        direction = (used[:, :columns].T[..., None] * directions[:, None]).reshape(-1, size)
        weight = np.concatenate([used[:, 0], np.zeros(capacity * (columns - 1))])
        rows = (array[:, :columns].T.ravel() for array in (values, noise))
        return cls(Functional(np.tile(place, (columns, 1)), weight, direction), *rows)

    @property
    def capacity(self) -> int:
        """For how many candidates there are rows."""
        columns = 1 + self.seen.place.shape[1] if np.any(self.seen.direction) else 1
        return len(self.values) // columns

    def believed(self, row: int, place: Float[np.ndarray, " size"], value: float) -> "Data":
        """The data with one more score, in an empty row."""
        seen = Functional(self.seen.place.copy(), self.seen.weight.copy(), self.seen.direction)
        values = self.values.copy()
        variances = self.variances.copy()
        seen.place[row] = place
        seen.weight[row] = 1.0
        values[row] = value
        variances[row] = 0.0
        return Data(seen, values, variances)


def matern(q: Array) -> tuple[Array, Array, Array]:
    r"""Matérn's kernel with $\nu = 5/2$ as a function of the squared distance $q$, and its first two derivatives."""
    a = jnp.sqrt(5.0 * q + 1e-16)  # so that its derivative at 0 is finite
    decay = jnp.exp(-a)
    return (1.0 + a + a * a / 3.0) * decay, -5.0 / 6.0 * (1.0 + a) * decay, 25.0 / 12.0 * decay


def squared_exponential(q: Array) -> tuple[Array, Array, Array]:
    r"""$e^{-q/2}$ and its first two derivatives."""
    decay = jnp.exp(-0.5 * q)
    return decay, -0.5 * decay, 0.25 * decay


PROFILES = {"matern": matern, "squared-exponential": squared_exponential}


class DerivativeKernel(tinygp.kernels.Kernel):
    r"""The covariance of two functionals under $k(x, x') = \sigma^2 \phi(q)$ with $q = \sum_i (x_i - x'_i)^2 / l_i^2$.

    With $\Delta = (x - x')/l$, $u = v/l$ and $u' = v'/l$, differentiation gives

    $$ w w'\phi + 2\phi'\,(w'\,u\cdot\Delta - w\,u'\cdot\Delta - u\cdot u') - 4\phi''\,(u\cdot\Delta)(u'\cdot\Delta) $$

    times $\sigma^2$.

    It is written out because automatic differentiation of tinygp's Matérn kernel gives 0 for the variance of a
    derivative: its distance has a kink at 0.

    **Arguments:** the name of the `profile` $\phi$; `lengths` $l$; `signal` $\sigma$.
    """

    profile: str = eqx.field(static=True)
    lengths: Any
    signal: Any

    def evaluate(self, X1: Any, X2: Any) -> Array:
        difference = (X1.place - X2.place) / self.lengths
        one = X1.direction / self.lengths
        two = X2.direction / self.lengths
        value, slope, bend = PROFILES[self.profile](jnp.sum(difference**2))
        along_one = one @ difference
        along_two = two @ difference
        mixed = X2.weight * along_one - X1.weight * along_two - one @ two
        return self.signal**2 * (
            X1.weight * X2.weight * value + 2.0 * slope * mixed - 4.0 * bend * along_one * along_two
        )


def process_of(profile: str, settings: Float[Array, " settings"], data: Data) -> tinygp.GaussianProcess:
    """The prior at the observations, for `settings`: the logarithms of the lengths, of the signal and of the standard
    deviation of a score's noise."""
    data = jax.tree.map(jnp.asarray, data)
    *_, signal, noise = settings = jnp.exp(jnp.asarray(settings))
    kernel = DerivativeKernel(profile, settings[:-2], signal)
    variances = data.variances + data.seen.weight * noise**2 + JITTER
    seen: Any = data.seen  # tinygp takes any tree for a place
    return tinygp.GaussianProcess(kernel, seen, diag=variances)


_prior = eqx.filter_jit(process_of)


@eqx.filter_jit
@eqx.filter_value_and_grad
def _misfit(settings: Array, profile: str, data: Data) -> Array:
    """Minus the logarithm of the marginal likelihood."""
    return -process_of(profile, settings, data).log_probability(jnp.asarray(data.values))


def posterior_at(
    prior: tinygp.GaussianProcess, values: Array, places: Float[Array, "places size"]
) -> tuple[Float[Array, " places"], Float[Array, " places"]]:
    """The mean and the variance of the function itself, without noise, at some places."""
    seen: Any = Functional(places, jnp.ones(len(places)), jnp.zeros_like(places))
    # tinygp's `condition` also makes and factorises the covariance of the places, which takes as long again to compile
    across = prior.solver.solve_triangular(prior.kernel(prior.X, seen))
    mean = prior.solver.solve_triangular(values) @ across
    return mean, jnp.maximum(prior.kernel(seen) - jnp.sum(across**2, axis=0), 1e-12)


_posterior_at = eqx.filter_jit(posterior_at)


def fitted(
    profile: str, data: Data, starts: Float[np.ndarray, "starts settings"], bounds: Float[np.ndarray, "settings 2"]
) -> Float[np.ndarray, " settings"]:
    """The settings within `bounds` of the greatest marginal likelihood that L-BFGS finds from the best of `starts`."""

    def misfit(settings: np.ndarray) -> tuple[float, np.ndarray]:
        with jax.enable_x64(True):
            value, slope = _misfit(jnp.asarray(settings), profile, data)
        if not np.isfinite(value) or not np.isfinite(slope).all():  # no Cholesky factor
            return 1e25, np.zeros_like(settings)
        return float(value), np.asarray(slope, float)

    start = min(starts, key=lambda each: misfit(each)[0])
    limits = {"maxiter": 30, "ftol": 1e-6}
    return np.asarray(minimize(misfit, start, jac=True, method="L-BFGS-B", bounds=bounds, options=limits).x, float)


class Posterior:
    """The process given data, in double precision.

    **Arguments:** the name of the kernel's `profile`; `settings` as `process_of` takes them; `data`.
    """

    def __init__(self, profile: str, settings: Float[np.ndarray, " settings"], data: Data):
        self.data = data
        with jax.enable_x64(True):
            self.values = jnp.asarray(data.values)
            self.prior = _prior(profile, jnp.asarray(settings), data)

    def __call__(self, places: Float[np.ndarray, "places size"]) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation of the function at some places."""
        count = len(places)
        size = places.shape[1]
        blocks = np.concatenate([places, np.zeros((-count % BLOCK, size))]).reshape(-1, BLOCK, size)
        with jax.enable_x64(True):
            found = [_posterior_at(self.prior, self.values, jnp.asarray(block)) for block in blocks]
        mean, variance = (np.concatenate(part)[:count] for part in zip(*found, strict=True))
        return mean, np.sqrt(variance)
