"""Numbers that change while a policy is learned."""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from motorgrad.schema import Part, count, number


class Annealed(Part):
    """A number that moves in a straight line from `start` to `end` and stays there."""

    start: float = number(low=0, help="the first value")
    end: float = number(0.0, 0, help="the last value")
    steps: int = count(1000, 1, unit="steps of the parameters", help="duration of the change from `start` to `end`")


Steps = Int[Array, ""] | None
"""How many steps the parameters have made; `None` where nothing counts them."""


def at(value: float | Annealed, steps: Steps) -> Float[Array, ""]:
    """The value of a number after this many steps of the parameters; `None` for one that does not change."""
    if not isinstance(value, Annealed):
        return jnp.asarray(value, jnp.result_type(float))
    if steps is None:
        return jnp.asarray(value.start, jnp.result_type(float))
    left = 1 - jnp.clip(steps, 0, value.steps) / value.steps
    return (value.start - value.end) * left + value.end


def changes(tree: object) -> bool:
    """Whether any number in a tree of parts is `Annealed`."""
    if isinstance(tree, Annealed):
        return True
    if isinstance(tree, Part):
        return any(changes(value) for value in vars(tree).values())
    return isinstance(tree, tuple) and any(map(changes, tree))
