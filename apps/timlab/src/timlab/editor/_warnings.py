"""Warnings about diagrams that run but mislead: filters that are faster than the tick."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from timlab.blocks import DiscreteLag
from timlab.compiler import plan, rk4_growth
from timlab.diagram import Block, Diagram, DiagramError, Moment, Problem

MAX_STATE_NUMBERS = 64  # whose rates are looked at


def warnings(diagram: Diagram) -> list[Problem]:
    """The continuous blocks whose own rates are faster than an integration step, and the discrete lags that are
    faster than their sample period.

    The rates are the eigenvalues of a block's derivative by its own state at the initial state, with all inputs 0. A
    diagram that cannot run has none.
    """
    try:
        made = plan(diagram)
    except DiagramError:
        return []
    step = made.tick / made.solver.substeps
    found = []
    for placed in made.blocks:
        if placed.block.is_continuous and not made.solver.adapts:
            message = _too_fast(_rates(placed.block), step)
        elif isinstance(placed.block, DiscreteLag):
            message = _follows(placed.block, placed.ticks * made.tick)
        else:
            continue
        found += [Problem(placed.path, None, message)] if message else []
    return found


def _too_fast(rates: tuple[complex, ...], step: float) -> str | None:
    fastest = max(map(abs, rates), default=0.0)
    if fastest * step <= 1:
        return None
    grows = any(rate.real < 0 and rk4_growth(rate * step) > 1 for rate in rates)
    worse = ", and the integration is unstable" if grows else ""
    return (
        f"is faster than the tick: its shortest time constant, {1 / fastest:.3g} s, is below the integration step of "
        f"{step:.3g} s{worse}: shorten the tick, give more substeps, or choose a solver that adapts its steps"
    )


def _follows(block: DiscreteLag, period: float) -> str | None:
    shortest = float(np.min(block.constant))
    if shortest >= period:
        return None
    return (
        f"is faster than the tick: its time constant, {shortest:.3g} s, is below its sample period of {period:.3g} s, "
        "so it follows its input at once"
    )


@functools.lru_cache(maxsize=2048)
def _rates(block: Block) -> tuple[complex, ...]:
    """The eigenvalues of the Jacobian of a block's derivative in its own state (1/s); none if they cannot be
    computed."""
    try:
        bound = block.bound({name: jnp.asarray(value) for name, value in block.values().items()})
        state = bound.init(jnp.full(block.init_uniforms, 0.5))
        x, unravel = ravel_pytree(state)
        if x.size > MAX_STATE_NUMBERS:
            return ()
        inputs = {name: jnp.zeros(port.shape, port.dtype) for name, port in block.inputs.items()}
        start = jnp.zeros(())
        now = Moment(jnp.uint32(0), start, start, jnp.full(block.uniforms, 0.5), start)
        matrix = jax.jacfwd(lambda x: ravel_pytree(bound.derivative(unravel(x), inputs, now))[0])(x)
        rates = np.linalg.eigvals(np.asarray(matrix, float))
    except Exception:  # a block's own code may raise anything: a warning must not keep its diagram from running
        return ()
    return tuple(rates.tolist()) if np.isfinite(rates).all() else ()
