"""Linear algebra in compiled code.

Mapped over several matrices, JAX's solvers share them among XLA's threads, and wait for these threads on one of them
(jaxlib's `ParallelBatchMap`). Where two solvers of a program run at once, such as those of a critic and of a metric,
both may wait for the last free thread: then the program stands still for ever. A single matrix is solved by the thread
that asks. So the functions here solve one matrix after the other, however they are mapped.
"""

import contextlib
import functools
from collections.abc import Iterator
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


@jax.custom_batching.sequential_vmap
def linear_solve(
    matrix: Float[Array, "size size"], right: Float[Array, "size *columns"]
) -> Float[Array, "size *columns"]:
    """$x$ with $Ax = b$; not finite where $A$ is singular."""
    return jnp.linalg.solve(matrix, right)


@jax.custom_batching.sequential_vmap
def positive_solve(
    matrix: Float[Array, "size size"], right: Float[Array, "size *columns"]
) -> Float[Array, "size *columns"]:
    """$x$ with $Ax = b$, for a symmetric positive definite $A$; not a number for another."""
    # The solver reads by columns. Handed the transpose, which is the same, it needs no copy by columns.
    factor = jax.lax.linalg.cholesky(matrix.T, symmetrize_input=False)
    return jax.scipy.linalg.cho_solve((factor, True), right)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Keep the BLAS of SciPy, which JAX's solvers call, to one thread. Its other threads would wait busily for their
    share of a matrix of a few hundred rows, which takes twice the processor time and gains nothing."""
    with _libraries().limit(limits=1, user_api="blas"):
        yield


@functools.cache
def _libraries() -> "ThreadpoolController":
    import scipy.linalg.cython_lapack  # noqa: F401 (what JAX loads with its first solver)
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
