"""Algebraic loops: outputs that depend on themselves within a tick, found by Newton's method."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from motorgrad.lab.compiler._methods import inverted

MOST_TRIES = 400  # Newton steps
PLAIN = 64  # of them, before the way from the start is gone in pieces
SHORTEST = 1e-6  # part of a Newton step that is still tried
SMALLEST = 1e-4  # piece of that way
STARTS = np.array([0.0, *(sign * 10.0**k for k in (-9, -6, -3, -2, -1, 0, 1, 3) for sign in (1, -1))])
"""Where a search begins if the last tick's values have no finite residual."""


def tolerance() -> float:
    """By how much, relative and absolute, two Newton steps may still differ."""
    return 64 * float(jnp.finfo(jnp.result_type(float)).eps)


class Search(NamedTuple):
    """A search for $r(x) = 0$. On the way, it solves $r(x) = \\tau\\,r(x_0)$ for $\\tau$ from 1 to 0."""

    x: Any
    residual: Any
    slopes: Any
    """The Jacobian."""
    part: Any
    """How much of a Newton step is tried."""
    tau: Any
    anchor: Any
    """The solution for `reached`."""
    kept: Any
    """The residual and the Jacobian there."""
    reached: Any
    piece: Any
    """By how much tau falls next."""
    tries: Any
    found: Any
    lost: Any


def root(residual: Callable[[Any], Any], guess: Any, loop: Callable[..., Any] = jax.lax.while_loop) -> tuple[Any, Any]:
    """A vector whose `residual` is zero, and whether it was found.

    Newton's steps are halved until the residual becomes smaller (damping). Where that fails, the solution is followed
    from the guess, at which it is known, by ever smaller pieces of the way (continuation; Deuflhard, 2011, chapter 5).

    **Arguments:** `loop`: `jax.lax.while_loop`, or the same in Python.
    """
    close, eye = tolerance(), jnp.eye(len(guess), dtype=guess.dtype)

    def at(x: Any) -> tuple[Any, Any]:
        value, push = jax.linearize(residual, x)
        return value, jax.vmap(push, out_axes=1)(eye)

    starts, count = jnp.asarray(STARTS, guess.dtype), len(STARTS)

    def unfit(p: Any) -> Any:
        return (p[0] < count) & ~jnp.all(jnp.isfinite(residual(p[1])))

    start = loop(unfit, lambda p: (p[0] + 1, jnp.full_like(guess, starts[p[0]])), (0, guess))[1]
    first, slopes = at(start)
    real = guess.dtype
    one, zero, no = jnp.ones((), real), jnp.zeros((), real), jnp.zeros((), bool)
    begin = Search(start, first, slopes, one, zero, start, (first, slopes), one, one, jnp.zeros((), jnp.int32), no, no)

    def size(x: Any) -> Any:
        return jnp.max(jnp.abs(x))

    def turn(s: Search) -> Search:
        wanted = s.residual - s.tau * first
        step = -_solved(s.slopes, wanted)
        step = jnp.where(jnp.isfinite(step), step, wanted)  # no slope at all: the step of a fixed-point iteration
        x = s.x + s.part * step
        value, slopes = at(x)
        missed = value - s.tau * first
        good = jnp.all(jnp.isfinite(missed)) & jnp.all(jnp.isfinite(slopes))
        better = good & (size(missed) <= (1 - 1e-4 * s.part) * size(wanted))
        arrived = (s.part == 1) & (size(step) <= close * size(x)) & good
        # no better, and as exact as roundings allow
        small = (size(step) <= close * (1 + size(s.x))) | (size(wanted) <= close * (1 + size(s.x)))
        stuck = ~better & ~arrived & ((s.part <= SHORTEST) | (small & (s.part < 0.2)))
        arrived |= stuck & small
        arrived |= size(wanted) == 0
        slow = (s.tau == 0) & (s.reached == 1) & (s.tries >= PLAIN) & ~arrived
        fails = (stuck & ~arrived) | slow
        moved = better | (arrived & good & ~stuck)
        x = jnp.where(moved, x, s.x)
        # the next piece of the way: longer after a success, and shorter from the last solution after a failure
        arrives = arrived & ~fails
        anchor, reached = jnp.where(arrives, x, s.anchor), jnp.where(arrives, s.tau, s.reached)
        piece = jnp.where(fails, s.piece / 2, jnp.where(arrives, 2 * s.piece, s.piece))
        anew = fails | (arrives & (s.tau > 0))
        tau = jnp.where(anew, jnp.maximum(reached - piece, 0), s.tau)
        x = jnp.where(fails, anchor, x)
        value, slopes = jax.tree.map(lambda a, b: jnp.where(moved, a, b), (value, slopes), (s.residual, s.slopes))
        kept = jax.tree.map(lambda a, b: jnp.where(arrives, a, b), (value, slopes), s.kept)
        value, slopes = jax.tree.map(lambda a, b: jnp.where(fails, a, b), kept, (value, slopes))
        part = jnp.where(anew | better, jnp.minimum(1.0, jnp.where(anew, 1.0, 4 * s.part)), s.part / 2).astype(real)
        found, lost = arrives & (s.tau == 0), fails & (piece < SMALLEST)
        return Search(x, value, slopes, part, tau, anchor, kept, reached, piece, s.tries + 1, found, lost)

    end = loop(lambda s: ~s.found & ~s.lost & (s.tries < MOST_TRIES), turn, begin)
    return end.x, end.found


def solved(evaluate: Callable[[Any], Any], read: Callable[[Any], Any], guess: Any) -> Any:
    """What `evaluate` returns for a guess of some of its own results, which `read` takes from it, where the two agree.

    Where no solution is found from `guess`, the results are NaN.
    """
    flat, unravel = ravel_pytree(jax.tree.map(lambda x: jnp.where(jnp.isfinite(x), x, 0.0), guess))

    def residual(x: Any) -> Any:
        return ravel_pytree(read(evaluate(unravel(x))))[0] - x

    def tangent(linear: Callable[[Any], Any], right: Any) -> Any:
        return _solved(jax.vmap(linear, out_axes=1)(jnp.eye(len(right), dtype=right.dtype)), right)

    # the solution is differentiated, not the way to it
    x, found = jax.lax.custom_root(residual, flat, root, tangent, has_aux=True)
    return evaluate(unravel(jnp.where(found, x, jnp.nan)))


def _solved(matrix: Any, right: Any) -> Any:
    return right / matrix[0] if len(right) == 1 else jnp.sum(inverted(matrix) * right, axis=-1)
