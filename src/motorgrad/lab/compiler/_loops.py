"""Algebraic loops: outputs that depend on themselves within a tick, found by Newton's method."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optimistix

MOST_TRIES = 64  # Newton steps


def tolerance() -> float:
    """By how much, relative and absolute, two Newton steps may still differ."""
    return 64 * float(jnp.finfo(jnp.result_type(float)).eps)


def solved(evaluate: Callable[[Any], Any], read: Callable[[Any], Any], guess: Any) -> Any:
    """What `evaluate` returns for a guess of some of its own results, which `read` takes from it, where the two agree.

    Where Newton's method does not converge from `guess`, the results are NaN.
    """
    start = jax.tree.map(lambda x: jnp.where(jnp.isfinite(x), x, 0.0), guess)

    def residual(guess: Any, _: Any) -> Any:
        return jax.tree.map(jnp.subtract, read(evaluate(guess)), guess)

    newton = optimistix.Newton(tolerance(), tolerance())
    found = optimistix.root_find(residual, newton, start, max_steps=MOST_TRIES, throw=False)
    converged = found.result == optimistix.RESULTS.successful
    return evaluate(jax.tree.map(lambda x: jnp.where(converged, x, jnp.nan), found.value))
