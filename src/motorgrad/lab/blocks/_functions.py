"""The functions of expressions, by name."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp


class Function(NamedTuple):
    """A function of numbers, applied element by element."""

    arguments: int
    apply: Callable[..., Any]
    condition: bool = False
    """Whether it gives true or false."""


def truth(value: Any) -> Any:
    """A number as a condition: true unless it is 0."""
    return jnp.asarray(value) != 0


FUNCTIONS: dict[str, Function] = {
    "abs": Function(1, jnp.abs),
    "sign": Function(1, jnp.sign),
    "sqrt": Function(1, jnp.sqrt),
    "exp": Function(1, jnp.exp),
    "log": Function(1, jnp.log),
    "log10": Function(1, jnp.log10),
    "sin": Function(1, jnp.sin),
    "cos": Function(1, jnp.cos),
    "tan": Function(1, jnp.tan),
    "asin": Function(1, jnp.arcsin),
    "acos": Function(1, jnp.arccos),
    "atan": Function(1, jnp.arctan),
    "sinh": Function(1, jnp.sinh),
    "cosh": Function(1, jnp.cosh),
    "tanh": Function(1, jnp.tanh),
    "sigmoid": Function(1, jax.nn.sigmoid),
    "floor": Function(1, jnp.floor),
    "ceil": Function(1, jnp.ceil),
    "round": Function(1, jnp.round),
    "atan2": Function(2, jnp.arctan2),
    "hypot": Function(2, jnp.hypot),
    "mod": Function(2, jnp.mod),
    "min": Function(2, jnp.minimum),
    "max": Function(2, jnp.maximum),
    "clip": Function(3, lambda u, low, high: jnp.minimum(jnp.maximum(u, low), high)),
    "if": Function(3, lambda condition, then, other: jnp.where(truth(condition), then, other)),
}
"""Those that may be called. `round` goes to the nearest even number at halves; `mod` has its divisor's sign."""

OPERATORS: dict[str, Function] = {
    "+": Function(2, lambda a, b: a + b),
    "-": Function(2, lambda a, b: a - b),
    "*": Function(2, lambda a, b: a * b),
    "/": Function(2, lambda a, b: a / b),
    "^": Function(2, jnp.power),
    "<": Function(2, lambda a, b: a < b, True),
    "<=": Function(2, lambda a, b: a <= b, True),
    ">": Function(2, lambda a, b: a > b, True),
    ">=": Function(2, lambda a, b: a >= b, True),
    "==": Function(2, lambda a, b: a == b, True),
    "!=": Function(2, lambda a, b: a != b, True),
    "and": Function(2, lambda a, b: truth(a) & truth(b), True),
    "or": Function(2, lambda a, b: truth(a) | truth(b), True),
    "not": Function(1, lambda a: ~truth(a), True),
}
"""Those that are written between their arguments, or before one."""
COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
