"""Bayesian Monte Carlo: the posterior of a policy gradient, given the returns and the scores of some episodes."""

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from motorgrad._errors import check, choice

MODELS = ("return", "integrand")
MIN_EPISODES = 3  # with fewer, there is nothing to tell a function from noise by
SHARES = (np.arange(50) + 0.5) / 50  # of the variance: what is the function's, and not noise
RANK = 1e-10  # eigenvalues of a Fisher matrix below this share of the greatest count as 0


class GradientPosterior(NamedTuple):
    """What is known of a gradient.

    - `mean` (parameters,): the estimate.
    - `covariance` (parameters, parameters): its uncertainty; singular where a direction leaves the policy as it is.
    """

    mean: Float[np.ndarray, " parameters"]
    covariance: Float[np.ndarray, "parameters parameters"]


def bayesian_gradient(
    returns: npt.ArrayLike,
    scores: npt.ArrayLike,
    fisher: npt.ArrayLike,
    of: Literal["return", "integrand"] = "return",
) -> GradientPosterior:
    r"""The posterior of $\nabla\rho = \int R(\xi)\,u(\xi)\,p(\xi)\,d\xi$, an integral over episodes $\xi$ with the
    return $R$ and the score $u = \nabla\log p$ (Ghavamzadeh & Engel, 2006; Rasmussen & Ghahramani, 2003; thesis,
    section 7.3).

    Classical Monte Carlo takes the mean of $R_i u_i$ over the sampled episodes. Bayesian Monte Carlo has a Gaussian
    process of what is unknown in the integrand, observed with noise at the samples; the integral of a Gaussian process
    is normal, and with a kernel of the scores in the metric of the Fisher matrix $G = \mathbb E\,uu'$ it has a closed
    form. With $\kappa = u'G^{-1}u'$ of two episodes, `of` is

    - `"return"`: the return is unknown, with the kernel $c + \sigma^2\kappa$, where $c \to \infty$: a baseline that is
      inferred with the rest. The posterior of the gradient is then that of $G$ times the weights of a Bayesian linear
      regression of returns on scores.
    - `"integrand"`: every component of $R\,u$ (in coordinates in which $G$ is the identity) is unknown, with the kernel
      $\sigma^2(1 + \kappa)^2$.

    The original fixes $\sigma$ and the noise. Here the variances of the function and of the noise add up to what the
    samples show, and the function's share is integrated over, all shares being equally likely beforehand. Without this
    bound, a few episodes that happen to lie on a line would be taken for a gradient of any length.

    $G$ must be known better than by these scores: with $G = \frac1n\sum u_i u_i'$ and without a baseline, the mean is
    that of classical Monte Carlo, but for a factor. In a finite world `oracle.fisher` has it; elsewhere the sum of the
    Fisher matrices of the decisions at the observations that were visited estimates it, with less variance than the
    scores.

    **Arguments:** `returns` (episodes,); `scores` (episodes, parameters), each the sum of the scores of an episode's
    decisions; `fisher` (parameters, parameters), which may be singular.

    **Returns:** a `GradientPosterior`.

    **Raises:** `ValueError` for arrays of other shapes, fewer than three episodes, a `fisher` that is not symmetric or
    has negative eigenvalues, scores that are impossible under it, and returns that are all the same.

    ```python
    found = bayesian_gradient(returns, scores, fisher)
    found.mean, np.sqrt(np.diag(found.covariance))
    ```
    """
    choice("of", of, MODELS)
    returns, scores, fisher = (np.asarray(each, float) for each in (returns, scores, fisher))
    enough = f"(episodes, parameters), at least {MIN_EPISODES} episodes"
    check(scores.ndim == 2 and len(scores) >= MIN_EPISODES, "scores.shape", scores.shape, enough)
    episodes, size = scores.shape
    check(returns.shape == (episodes,), "returns.shape", returns.shape, f"({episodes},), one for each episode")
    check(fisher.shape == (size, size), "fisher.shape", fisher.shape, f"({size}, {size})")
    for name, values in {"returns": returns, "scores": scores, "fisher": fisher}.items():
        check(np.isfinite(values).all(), name, values[~np.isfinite(values)].tolist(), "finite numbers")
    check(np.ptp(returns) > 0, "returns", float(returns[0]), "not all the same, as then they say nothing")
    root, inverse = _roots(fisher)
    whitened = scores @ inverse
    beyond = float(np.abs(scores - whitened @ root.T).max())
    possible = beyond <= 1e-4 * float(np.abs(scores).max())
    check(possible, "scores outside the range of fisher", beyond, "0, but for rounding: it is another policy's")
    model = _of_return if of == "return" else _of_integrand
    evidence, means, covariances = model(returns, whitened)
    chance = np.exp(evidence - evidence.max())
    chance = chance / chance.sum()
    mean = chance @ means
    apart = means - mean
    covariance = np.einsum("k,kij->ij", chance, covariances) + np.einsum("k,ki,kj->ij", chance, apart, apart)
    return GradientPosterior(root @ mean, root @ covariance @ root.T)


def _roots(fisher: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A square root of the Fisher matrix and its pseudo-inverse, (parameters, rank) each: $u'$ times the latter has the
    identity as its Fisher matrix."""
    check(np.allclose(fisher, fisher.T, rtol=1e-6), "fisher", fisher.tolist(), "symmetric")
    values, vectors = np.linalg.eigh(fisher)
    check(values[-1] > 0 and values[0] >= -1e-6 * values[-1], "fisher", values.tolist(), "of eigenvalues of at least 0")
    kept = values > RANK * values[-1]
    root = np.sqrt(values[kept])
    return vectors[:, kept] * root, vectors[:, kept] / root


def _of_return(returns: np.ndarray, whitened: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each of `SHARES`: the logarithm of the evidence, and mean and covariance of the gradient in coordinates in
    which the Fisher matrix is the identity. The constant leaves the differences from the means."""
    size = whitened.shape[1]
    rest = returns - returns.mean()
    basis, spread, directions = np.linalg.svd(whitened - whitened.mean(axis=0), full_matrices=False)
    seen = spread > 1e-9 * max(spread[0], 1e-300)
    power = spread[seen] ** 2
    along = basis[:, seen].T @ rest
    beyond = max(rest @ rest - along @ along, 0.0)
    variance = returns.var(ddof=1)
    signal = SHARES[:, None] * variance / size  # of each weight
    noise = (1.0 - SHARES[:, None]) * variance
    total = signal * power + noise
    free = len(returns) - 1 - len(power)
    misfit = (along**2 / total + np.log(total)).sum(axis=1)
    evidence = -0.5 * (misfit + (beyond / noise + free * np.log(noise))[:, 0])
    turned = directions[seen]
    means = (signal * along * np.sqrt(power) / total) @ turned
    shrunk = np.einsum("kr,ri,rj->kij", signal * power / total, turned, turned)
    return evidence, means, signal[..., None] * (np.eye(size) - shrunk)


def _of_integrand(returns: np.ndarray, whitened: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same for a process of the integrand, whose components are independent with one kernel."""
    size = whitened.shape[1]
    values = returns[:, None] * whitened
    kernel = (1.0 + whitened @ whitened.T) ** 2
    across = 1.0 + (whitened**2).sum(axis=1)  # the kernel's mean over episodes, and its mean of means
    whole = 1.0 + size
    power, basis = np.linalg.eigh(kernel)
    variance = np.mean(values**2)
    signal = SHARES[:, None] * variance / np.mean(np.diag(kernel))
    total = signal * np.maximum(power, 0.0) + (1.0 - SHARES[:, None]) * variance
    along = basis.T @ values
    weight = basis.T @ across
    evidence = -0.5 * ((1.0 / total) @ (along**2).sum(axis=1) + size * np.log(total).sum(axis=1))
    means = (signal * weight / total) @ along
    left = signal[:, 0] * np.maximum(whole - (signal / total) @ weight**2, 0.0)
    return evidence, means, left[:, None, None] * np.eye(size)
