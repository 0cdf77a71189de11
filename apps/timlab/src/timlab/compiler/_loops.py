"""Algebraic loops: outputs that depend on themselves within a tick, found by Newton's method."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, PyTree

from timlab.compiler._methods import inverted

MAX_TRIES = 400  # Newton steps
MAX_PLAIN = 64  # of them, before the way from the start is gone in pieces
MIN_PART = 1e-6  # of a Newton step that is still tried
MIN_PIECE = 1e-4  # of that way
STARTS = np.array([0.0, *(sign * 10.0**k for k in (-9, -6, -3, -2, -1, 0, 1, 3) for sign in (1, -1))])
"""Where a search begins if the last tick's values have no finite residual."""

Result = TypeVar("Result")


def tolerance() -> float:
    """By how much, relative and absolute, two Newton steps may still differ."""
    return 64 * float(jnp.finfo(jnp.result_type(float)).eps)


def solved(
    evaluate: Callable[[PyTree[Array]], Result], read: Callable[[Result], PyTree[Array]], guess: PyTree[Array]
) -> Result:
    """What `evaluate` returns for a guess of some of its own results, which `read` takes from it, where the two agree.

    Where no solution is found from `guess`, the results are NaN.
    """
    flat, unravel = ravel_pytree(jax.tree.map(lambda x: jnp.where(jnp.isfinite(x), x, 0.0), guess))

    def residual(x: Array) -> Array:
        return ravel_pytree(read(evaluate(unravel(x))))[0] - x

    def tangent(linear: Callable[[Array], Array], right: Array) -> Array:
        return _solved(jax.vmap(linear, out_axes=1)(jnp.eye(len(right), dtype=right.dtype)), right)

    def solve(residual: Callable[[Array], Array], guess: Array) -> tuple[Array, Array]:
        x, found = root(residual, guess)
        return x, jnp.where(found, 0.0, jnp.nan).astype(x.dtype)  # a number, as it has to have a derivative

    # the solution is differentiated, not the way to it
    x, unknown = jax.lax.custom_root(residual, flat, solve, tangent, has_aux=True)
    return evaluate(unravel(x + unknown))


def root(
    residual: Callable[[Array], Array], guess: Array, loop: Callable[..., Any] = jax.lax.while_loop
) -> tuple[Array, Array]:
    """A vector whose `residual` is zero, and whether it was found.

    Newton's method as long as each of its steps makes the residual smaller, which is nearly always; else `searched`.

    **Arguments:** `loop`: `jax.lax.while_loop`, or the same in Python.
    """
    close = tolerance()

    def turn(at: tuple[Any, ...]) -> tuple[Any, ...]:
        x, last, tries, _, _ = at
        value, slopes = _linearised(residual, x)
        step = -_solved(slopes, value)
        usable = jnp.all(jnp.isfinite(step))
        smaller = usable & (_size(value) < last)
        small = jnp.minimum(_size(value), _size(step)) <= close * (1 + _size(x))
        arrived = jnp.where(smaller, _size(step) <= close * _size(x + step), usable & small)
        goes_on = smaller & ~arrived & (tries < MAX_PLAIN)
        return jnp.where(smaller, x + step, x), _size(value), tries + 1, arrived, goes_on

    endless = jnp.full((), jnp.inf, guess.dtype)
    begin = (guess, endless, jnp.zeros((), jnp.int32), jnp.asarray(False), jnp.asarray(True))
    x, _, _, found, _ = loop(lambda at: at[-1], turn, begin)
    # A loop that is entered only if needed: where many seeds are computed together, a condition would compute both
    # ways. Its body replaces what it starts from, as XLA would compute anything else before the loop, always.
    x, found, _ = loop(
        lambda at: ~at[1] & ~at[2],
        lambda at: (*searched(residual, at[0], loop), jnp.asarray(True)),
        (jnp.where(found, x, guess), found, jnp.asarray(False)),
    )
    return x, found


class Search(NamedTuple):
    """A search for $r(x) = 0$. On the way, it solves $r(x) = \\tau\\,r(x_0)$ for $\\tau$ from 1 to 0."""

    x: Array
    residual: Array
    slopes: Array
    """The Jacobian."""
    first: Array
    """The residual at the start, $r(x_0)$."""
    part: Array
    """How much of a Newton step is tried; 0 before there is a start with a finite residual."""
    tau: Array
    anchor: Array
    """The solution for `reached`."""
    kept: tuple[Array, Array]
    """The residual and the Jacobian there."""
    reached: Array
    piece: Array
    """By how much tau falls next."""
    tries: Array
    found: Array
    lost: Array


def searched(
    residual: Callable[[Array], Array], guess: Array, loop: Callable[..., Any] = jax.lax.while_loop
) -> tuple[Array, Array]:
    """The same as `root` for difficult residuals.

    Newton's steps are halved until the residual becomes smaller (damping). Where that fails, the solution is followed
    from the guess, at which it is known, by ever smaller pieces of the way (continuation; Deuflhard, 2011, chapter 5).
    """
    close = tolerance()
    real = guess.dtype
    starts = jnp.concatenate([guess[None], jnp.repeat(jnp.asarray(STARTS, real)[:, None], len(guess), axis=1)])
    one = jnp.ones((), real)
    zero = jnp.zeros((), real)

    def begun(s: Search, x: Array, value: Array, slopes: Array) -> Search:
        """The search from `x`, or the next try where it cannot begin there."""
        fits = jnp.all(jnp.isfinite(value))
        part = jnp.where(fits, one, zero)
        lost = ~fits & (s.tries >= len(STARTS))
        return Search(x, value, slopes, value, part, zero, x, (value, slopes), one, one, s.tries + 1, s.found, lost)

    def gone_on(s: Search, x: Array, step: Array, value: Array, slopes: Array) -> Search:
        """The search after a step to `x`, or back where it was, with a smaller step or a smaller piece of the way."""
        wanted = s.residual - s.tau * s.first
        missed = value - s.tau * s.first
        good = jnp.all(jnp.isfinite(missed)) & jnp.all(jnp.isfinite(slopes))
        better = good & (_size(missed) <= (1 - 1e-4 * s.part) * _size(wanted))
        arrived = (s.part == 1) & (_size(step) <= close * _size(x)) & good
        # no better, and as exact as roundings allow
        small = (_size(step) <= close * (1 + _size(s.x))) | (_size(wanted) <= close * (1 + _size(s.x)))
        stuck = ~better & ~arrived & ((s.part <= MIN_PART) | (small & (s.part < 0.2)))
        arrived |= stuck & small
        arrived |= _size(wanted) == 0
        slow = (s.tau == 0) & (s.reached == 1) & (s.tries >= MAX_PLAIN) & ~arrived
        fails = (stuck & ~arrived) | slow
        moved = better | (arrived & good & ~stuck)
        x = jnp.where(moved, x, s.x)
        # the next piece of the way: longer after a success, and shorter from the last solution after a failure
        arrives = arrived & ~fails
        anchor = jnp.where(arrives, x, s.anchor)
        reached = jnp.where(arrives, s.tau, s.reached)
        piece = jnp.where(fails, s.piece / 2, jnp.where(arrives, 2 * s.piece, s.piece))
        anew = fails | (arrives & (s.tau > 0))
        tau = jnp.where(anew, jnp.maximum(reached - piece, 0), s.tau)
        x = jnp.where(fails, anchor, x)
        value, slopes = _chosen(moved, (value, slopes), (s.residual, s.slopes))
        kept = _chosen(arrives, (value, slopes), s.kept)
        value, slopes = _chosen(fails, kept, (value, slopes))
        part = jnp.where(anew, one, jnp.where(better, jnp.minimum(one, 4 * s.part), s.part / 2))
        found = arrives & (s.tau == 0)
        lost = fails & (piece < MIN_PIECE)
        return Search(x, value, slopes, s.first, part, tau, anchor, kept, reached, piece, s.tries + 1, found, lost)

    def turn(s: Search) -> Search:
        wanted = s.residual - s.tau * s.first
        step = -_solved(s.slopes, wanted)
        step = jnp.where(jnp.isfinite(step), step, wanted)  # no slope at all: the step of a fixed-point iteration
        x = jnp.where(s.part > 0, s.x + s.part * step, starts[jnp.minimum(s.tries, len(STARTS))])
        value, slopes = _linearised(residual, x)  # in one place, as what is compiled may be large
        return _chosen(s.part > 0, gone_on(s, x, step, value, slopes), begun(s, x, value, slopes))

    none = jnp.zeros_like(guess)
    no = jnp.zeros((), bool)
    flat = jnp.zeros((len(guess), len(guess)), real)
    begin = Search(guess, none, flat, none, zero, zero, guess, (none, flat), one, one, jnp.zeros((), jnp.int32), no, no)
    end = loop(lambda s: ~s.found & ~s.lost & (s.tries < MAX_TRIES), turn, begin)
    return end.x, end.found


def _linearised(residual: Callable[[Array], Array], x: Array) -> tuple[Array, Array]:
    """The residual and its Jacobian."""
    value, push = jax.linearize(residual, x)
    return value, jax.vmap(push, out_axes=1)(jnp.eye(len(x), dtype=x.dtype))


def _solved(matrix: Array, right: Array) -> Array:
    return right / matrix[0] if len(right) == 1 else jnp.sum(inverted(matrix) * right, axis=-1)


def _size(x: Array) -> Array:
    return jnp.max(jnp.abs(x))


def _chosen(condition: Array, new: PyTree[Array], old: PyTree[Array]) -> PyTree[Array]:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), new, old)
