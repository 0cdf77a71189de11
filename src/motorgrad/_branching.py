"""Conditions in compiled code: those known while tracing cost nothing, others select between two values."""

from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

T = TypeVar("T")
Flag = Bool[Array, ""] | bool
Scalar = Float[Array, ""] | float
NEVER = 2**31 - 1
"""A number of decisions after which nothing is ever due."""


def any_of(*flags: Flag) -> Flag:
    """Whether any flag is set; plain `False` where that is known while tracing, so that no select is compiled."""
    known = [flag for flag in flags if flag is not False]
    if not known:
        return False
    result = known[0]
    for flag in known[1:]:
        result = jnp.logical_or(result, flag)
    return result


def where(condition: Flag, yes: T, no: T) -> T:
    """The leaves of one tree or of the other."""
    if condition is False:
        return no
    return jax.tree.map(lambda a, b: a if a is b else jnp.where(condition, a, b), yes, no)


def ratio(dividend: Array, divisor: Array) -> Array:
    """One number over another where that is above 0, else 0; also the derivatives are finite."""
    some = divisor > 0
    return jnp.where(some, dividend / jnp.where(some, divisor, 1), 0)


def where_any(due: Flag, function: Callable[[T], T], value: T) -> T:
    """`function(value)` where it is `due`, computed only if it is due for any seed.

    Mapped over seeds, `lax.cond` computes both branches at every decision. The body of a loop is skipped while no seed
    is due, so costly work is paid for once a batch.
    """
    if due is True:
        return function(value)
    due = jnp.asarray(due)
    return jax.lax.while_loop(
        lambda todo: todo[0], lambda todo: (jnp.zeros_like(due), function(todo[1])), (due, value)
    )[1]
