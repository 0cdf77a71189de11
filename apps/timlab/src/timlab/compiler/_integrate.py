"""Integration: classical Runge–Kutta steps, split where a source jumps."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from timlab.diagram import Seconds

PLACES = ((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6))
"""Where in the step each slope is taken, as a fraction of it, and the slope's weight."""
MAX_STEP_PIECES = 16  # what jumps more often is held in the last one


def rk4(
    slope: Callable[[PyTree[Array], Seconds], PyTree[Array]],
    state: PyTree[Array],
    time: Seconds,
    step: Array | float,
    rolled: bool = False,
) -> PyTree[Array]:
    r"""The state one `step` after `time` for $\dot x = f(x, t)$, by the classical fourth-order Runge–Kutta method.
    `slope` is $f$; states are any pytree. With `rolled`, the four slopes are found in a loop: what is compiled is
    smaller, and a little slower.
    """

    def stage(
        carry: tuple[PyTree[Array], PyTree[Array]], place: Array | float, weight: Array | float
    ) -> tuple[PyTree[Array], PyTree[Array]]:
        total, last = carry
        last = slope(_add_scaled(state, place * step, last), time + place * step)
        return _add_scaled(total, weight, last), last

    nothing = jax.tree.map(jnp.zeros_like, state)
    carry = (nothing, nothing)
    if rolled:
        table = tuple(jnp.asarray(PLACES, jnp.result_type(float)).T)
        carry, _ = jax.lax.scan(lambda carry, row: (stage(carry, *row), None), carry, table)
    else:
        for place, weight in PLACES:
            carry = stage(carry, place, weight)
    return _add_scaled(state, step, carry[0])


def rk4_growth(z: np.ndarray | complex) -> Any:
    r"""By how much a step of `rk4` multiplies $x$ where $\dot x = \lambda x$, for $z = \lambda h$ with a step $h$."""
    return abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24)


def integrated(
    slope: Callable[[PyTree[Array], Seconds, Array], PyTree[Array]],
    next_jump: Callable[[Array], Seconds] | None,
    state: PyTree[Array],
    within: Array,
    step: float,
    margin: Seconds = 0.0,
    loop: Callable[..., Any] = jax.lax.while_loop,
    rolled: bool = False,
) -> PyTree[Array]:
    """The state one `step` after `within`: one RK4 step, or one for each piece between jumps. Times are in seconds
    since the tick.

    **Arguments:**

    - `slope`: of a state, the time, and the time at which the RK4 step began.
    - `next_jump`: the time of the first jump after a time; `None` if nothing jumps.
    - `margin`: a jump this close to the end is left to the next step.
    - `loop`: `jax.lax.while_loop`, or the same in Python.
    - `rolled`: as for `rk4`.
    """
    if next_jump is None:
        return rk4(lambda there, now: slope(there, now, within), state, within, step, rolled)

    def piece(position: tuple[Array | int, Array, PyTree[Array]]) -> tuple[Array | int, Array, PyTree[Array]]:
        number, done, state = position
        start = within + done
        jump = next_jump(start) - within
        inside = (jump > done) & (jump < step - margin) & (number < MAX_STEP_PIECES - 1)
        end = jnp.where(inside, jump, step)
        return number + 1, end, rk4(lambda there, now: slope(there, now, start), state, start, end - done, rolled)

    begin = 0, jnp.zeros((), jnp.result_type(float)), state
    return loop(lambda position: position[1] < step, piece, begin)[2]


def _add_scaled(tree: PyTree[Array], factor: Array | float, other: PyTree[Array]) -> PyTree[Array]:
    return jax.tree.map(lambda x, k: x + factor * k, tree, other)
