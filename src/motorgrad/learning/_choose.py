"""Choices by flags: those known while tracing cost nothing, others choose between two values."""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

T = TypeVar("T")
Flag = Bool[Array, ""] | bool
NEVER = 2**31 - 1
"""So many decisions are as good as any number."""


def any_of(*flags: Flag) -> Flag:
    """Whether any flag is up; plainly `False` where that is known while tracing, so that no select is compiled."""
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


def where_any(due: Flag, function: Callable[[Any], Any], value: Any) -> Any:
    """`function(value)` where it is `due`. Over many seeds a condition computes both branches, but a loop's body is
    passed over while no seed is due: what is costly is paid once a batch and not at every decision."""
    if due is True:
        return function(value)
    due = jnp.asarray(due)
    return jax.lax.while_loop(
        lambda todo: todo[0], lambda todo: (jnp.zeros_like(due), function(todo[1])), (due, value)
    )[1]
