"""The dynamics of Hill-type muscles in JAX."""

import functools
import types
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from motorgrad.bodies.muscles._curve_sets import with_curves

_Arrays = tuple[Array, ...]
# as in `_hill_dynamics`, in single precision
_CLOSE = 1e-3
_STILL = 1e-6
# of a fiber within a step, from a good guess, and of one at rest, from none
_REFINEMENTS = 14
_SEARCHES = 60


@functools.cache
def hill_in_jax(curves: str = "de-groote") -> types.SimpleNamespace:
    """The functions of Hill-type muscles as JAX functions of arrays: those that the physics runs, with JAX's NumPy in
    place of NumPy. Only the loops differ: theirs end when the fiber is found, which JAX cannot.

    **Arguments:** `curves`: as of `Hill`.

    **Returns:** an object with `next_activation`, `next_fiber`, `steady_fiber`, `rigid_tension`,
    `compliant_tension` and `tendon_stiffness`, whose arguments the source tells.

    **Raises:** `ValueError` for other curves.
    """
    return with_curves(curves, instead={"balanced": _balanced, "steady_fiber": _steady_fiber}, np=jnp)


# `bracket`, `newton` and the tangents are put in place by `hill_in_jax`
bracket: Any = None
newton: Any = None
active_tangent: Any = None
passive_tangent: Any = None


def _balanced(
    guess: Array, base: Array, pace: Array, activation: Array, path: Array, muscle: _Arrays, curves: _Arrays
) -> Any:
    low, high = bracket(path, muscle[1])

    def refine(number: Array, found: tuple[Array, Array, Array]) -> Any:
        new, low, high, _ = newton(*found, base, pace, activation, path, muscle, curves)
        far = jnp.abs(new - found[0]) * pace > _CLOSE
        return jnp.where(far & (number % 8 == 7), 0.5 * (low + high), new), low, high

    start = jnp.broadcast_arrays(jnp.clip(guess, low, high), low, high)
    return jax.lax.fori_loop(0, _REFINEMENTS, refine, tuple(start))[0]


def _steady_fiber(
    activation: Array,
    length: Array,
    velocity: Array,
    optimal: Array,
    slack: Array,
    pennation: Array,
    fastest: Array,
    damping: Array,
    stiffness: Array,
) -> Any:
    height = jnp.sin(pennation)
    path = length / optimal
    muscle = (optimal / slack, height, damping, stiffness)
    now = jnp.clip(activation, 0.0, 1.0)
    pace = 1e-3

    def refine(number: Array, found: tuple[Array, Array, Array]) -> Any:
        fiber = found[0]
        curves = (fiber, *active_tangent(fiber), *passive_tangent(fiber))
        speed = velocity * jnp.sqrt(1.0 - (height / fiber) ** 2) / (optimal * fastest)
        new, low, high, flat = newton(*found, fiber - speed / pace, pace, now, path, muscle, curves)
        far = jnp.abs(new - fiber) > _STILL
        return jnp.where((far & (number % 8 == 7)) | flat, 0.5 * (low + high), new), low, high

    low, high = bracket(path + 0.0 * now, height)
    return jax.lax.fori_loop(0, _SEARCHES, refine, tuple(jnp.broadcast_arrays(high, low, high)))[0]
