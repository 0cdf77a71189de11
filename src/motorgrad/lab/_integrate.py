"""The classical Runge–Kutta step of fourth order."""

from collections.abc import Callable
from typing import Any

import jax

PLACES = ((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6))
"""Where in the step each slope is taken, in steps, and its weight."""


def rk4(slope: Callable[[Any, Any], Any], state: Any, time: Any, step: float) -> Any:
    r"""The state one `step` after `time`, of $\dot x = f(x, t)$ with `slope` $f$; any pytree."""
    total, last = None, None
    for place, weight in PLACES:
        there = state if last is None else _plus(state, place * step, last)
        last = slope(there, time + place * step)
        total = jax.tree.map(lambda k: weight * k, last) if total is None else _plus(total, weight, last)  # noqa: B023
    return _plus(state, step, total)


def _plus(tree: Any, factor: float, other: Any) -> Any:
    return jax.tree.map(lambda x, k: x + factor * k, tree, other)
