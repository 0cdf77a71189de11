"""Which candidates a Gaussian process can best do without."""

# pyright: reportMissingImports=false
# (tinygp is of the extra `search`; `_bayesian.py` imports this file when it is needed)

from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_triangular

from motorgrad.search._gaussian_process import Posterior


def information(
    precision: Float[np.ndarray, "candidates rows rows"],
    weights: Float[np.ndarray, "candidates rows"],
    noise: Float[np.ndarray, "candidates rows"],
) -> Float[np.ndarray, " candidates"]:
    r"""How much the posterior would lose with each candidate: the relative entropy, in nats, of the posterior process
    with it to the one without it.

    The two differ by the candidate's own rows $b$, its score and derivatives. With $Q = (K + N)^{-1}$ and $\alpha =
    Qy$, the others predict these rows with the covariance $S = Q_{bb}^{-1}$ and the error $S\alpha_b$ (Sundararajan &
    Keerthi, 2001), so that the relative entropy of the values without noise is

    $$ \tfrac12\bigl[\operatorname{tr}(Q_{bb}N_b) - |b| - \log\det(Q_{bb}N_b) + \alpha_b'(S - N_b)\,\alpha_b\bigr]. $$

    **Arguments:** `precision` $Q_{bb}$, `weights` $\alpha_b$, and `noise`, the diagonal of $N_b$, of each candidate.
    """
    share = precision * noise[:, None, :]  # of the predictive variance that is noise
    trace = np.trace(share, axis1=1, axis2=2) - weights.shape[1]
    determinant = np.linalg.slogdet(share)[1]
    error = np.linalg.solve(precision, weights[..., None])[..., 0]
    moved = np.sum(weights * (error - noise * weights), axis=1)
    return 0.5 * (trace - determinant + moved)


def parts_of(posterior: Posterior) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What `information` takes, of every candidate for which the posterior's data have room."""
    rows = _rows(posterior)
    precision, weights, noise = _solved(posterior)
    return precision[rows[:, :, None], rows[:, None, :]], weights[rows], noise[rows]


def least_informative(posterior: Posterior, known: int, count: int, kept: int) -> list[int]:
    """The candidates to forget, one after another the one with the least `information` given those that are left.

    Each takes time of the second power of the number of rows, as the inverse is brought up to date and not made anew.

    **Arguments:** the posterior of all candidates; `known`, their number; `count`, how many to forget; `kept`, the
    candidate that must stay.
    """
    rows = _rows(posterior)
    precision, weights, noise = _solved(posterior)
    left = np.arange(known)
    gone = []
    for _ in range(count):
        own = rows[left]
        blocks = precision[own[:, :, None], own[:, None, :]]
        losses = np.where(left == kept, np.inf, information(blocks, weights[own], noise[own]))
        least = int(losses.argmin())
        block = own[least]
        gain = np.linalg.solve(blocks[least], precision[block])
        weights = weights - gain.T @ weights[block]
        precision = precision - precision[:, block] @ gain
        gone.append(int(left[least]))
        left = np.delete(left, least)
    return gone


def _rows(posterior: Posterior) -> np.ndarray:
    """The rows of each candidate: of its score and its derivatives."""
    return np.arange(len(posterior.data.values)).reshape(-1, posterior.data.capacity).T


def _solved(posterior: Posterior) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""$Q$, $\alpha$ and the diagonal of $N$, of all rows."""
    solver: Any = posterior.prior.solver
    root = np.asarray(solver.scale_tril)
    inverse = solve_triangular(root, np.eye(len(root)), lower=True)
    precision = inverse.T @ inverse
    return precision, precision @ posterior.data.values, np.asarray(posterior.prior.noise.diagonal())
