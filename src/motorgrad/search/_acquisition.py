"""The value of the next candidate under a posterior, and where it is greatest."""

# pyright: reportMissingImports=false
# (tinygp is of the extra `search`; `_bayesian.py` imports this file when it is needed)

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import tinygp
from jax.scipy.stats import norm
from jaxtyping import Array, Float
from scipy.optimize import minimize

from motorgrad.search._gaussian_process import Posterior, posterior_at
from motorgrad.search._space import reflected

# places that are tried: anywhere, about the best one per width, climbed from
UNIFORM = 512
LOCAL = 64
REFINED = 4


def log_expected_improvement(mean: Array, deviation: Array, best: Array | float) -> Array:
    r"""The logarithm of $E[\max(f - f^*, 0)]$ for a normal $f$ (Jones et al., 1998).

    $\log\sigma + \log(\varphi(z) + z\Phi(z))$ with $z = (\mu - f^*)/\sigma$. Far below the best, the sum would be 0 in
    floating-point numbers and have no slope; there the logarithm is taken apart (Ament et al., 2023).
    """
    z = (mean - best) / deviation
    near = jnp.maximum(z, -1.0)
    low = jnp.clip(z, -1e3, -1.0)
    far = jnp.minimum(z, -1e3)
    ratio = jnp.log(-low) + norm.logcdf(low) - norm.logpdf(low)  # of two terms that nearly cancel
    height = jnp.where(
        z > -1.0,
        jnp.log(norm.pdf(near) + near * norm.cdf(near)),
        jnp.where(z > -1e3, norm.logpdf(low) + jnp.log(-jnp.expm1(ratio)), norm.logpdf(far) - 2.0 * jnp.log(-far)),
    )
    return jnp.log(deviation) + height


def worth(mean: Array, deviation: Array, best: Array | float, exploration: float | None) -> Array:
    r"""The logarithm of the expected improvement, or with an `exploration` $\kappa$ the bound $\mu + \kappa\sigma$."""
    if exploration is None:
        return log_expected_improvement(mean, deviation, best)
    return mean + exploration * deviation


_worth = eqx.filter_jit(worth)


@eqx.filter_jit
def _climb(
    prior: tinygp.GaussianProcess, values: Array, places: Array, best: Array, exploration: float | None
) -> tuple[tuple[Array, Array], Array]:
    """The worth of several places: its sum, each, and the gradients."""

    def total(places: Array) -> tuple[Array, Array]:
        mean, variance = posterior_at(prior, values, places)
        each = worth(mean, jnp.sqrt(variance), best, exploration)
        return jnp.sum(each), each

    return jax.value_and_grad(total, has_aux=True)(places)


def most_worth(
    posterior: Posterior, exploration: float | None, random: np.random.Generator
) -> Float[np.ndarray, " size"]:
    """The place from 0 to 1 with the greatest worth that random trials and L-BFGS from the best of them find.

    Improvements are on the greatest posterior mean of all observed places, which is less lucky than the greatest score.
    """
    seen = posterior.data.seen
    size = seen.place.shape[1]
    scored = seen.place[seen.weight > 0]
    means = posterior(scored)[0]
    local = [scored[means.argmax()] + width * random.standard_normal((LOCAL, size)) for width in (0.1, 0.01)]
    tried = np.concatenate([random.random((UNIFORM, size)), reflected(np.concatenate(local))])
    with jax.enable_x64(True):
        best = jnp.asarray(means.max())
        mean, deviation = map(jnp.asarray, posterior(tried))
        found = np.asarray(_worth(mean, deviation, best, exploration))
        starts = tried[np.argsort(-found, kind="stable")[:REFINED]]

        def descent(flat: np.ndarray) -> tuple[float, np.ndarray]:
            places = jnp.asarray(flat.reshape(starts.shape))
            (value, _), slope = _climb(posterior.prior, posterior.values, places, best, exploration)
            return -float(value), -np.asarray(slope, float).ravel()

        bounds = [(0.0, 1.0)] * starts.size
        flat = minimize(descent, starts.ravel(), jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 50}).x
        places = np.clip(flat.reshape(starts.shape), 0.0, 1.0)
        (_, each), _ = _climb(posterior.prior, posterior.values, jnp.asarray(places), best, exploration)
    return places[np.asarray(each).argmax()]
