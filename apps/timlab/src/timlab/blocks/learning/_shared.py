"""Shared by blocks that learn: limits, a port, a policy as one vector, and what counts at a tick."""

from collections.abc import Callable
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from timlab.diagram import Moment, Port, Signals

T = TypeVar("T")

VALID = Port((), "bool", default=1.0, help="whether the reward of this tick counts")
MAX_UNITS = 10_000
MAX_PARAMETERS = 1_000_000


class Vector(eqx.Module):
    """All parameters of a policy as one array, in place of the policy, for an optimizer or a baseline that is weighted
    by eligibility. They count as one unit."""

    parameters: Float[Array, " size"]

    def blocks(self, gradient: "Vector") -> tuple[Float[Array, "1 size"]]:
        return (gradient.parameters[None],)

    def from_blocks(self, blocks: tuple[Float[Array, "1 size"]]) -> "Vector":
        return Vector(blocks[0][0])


def is_paid(inputs: Signals, now: Moment, port: str = "valid") -> Array:
    """Whether the reward of this tick counts: it is valid, and an action came before it."""
    return inputs[port] & (now.tick > 0)


def where(condition: Array, yes: T, no: T) -> T:
    """The leaves of one tree or of the other."""
    return jax.tree.map(lambda a, b: a if a is b else jnp.where(condition, a, b), yes, no)


def reads(function: Callable[..., Any], *shapes: PyTree[jax.ShapeDtypeStruct]) -> list[bool]:
    """Which leaves of its arguments, of these shapes, a function uses: traced, it shows what it does not say."""
    traced = jax.make_jaxpr(function)(*shapes).jaxpr
    used = [variable for equation in traced.eqns for variable in equation.invars] + traced.outvars
    return [any(variable is argument for variable in used) for argument in traced.invars]
