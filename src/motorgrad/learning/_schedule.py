"""Numbers that change while a policy is learnt."""

import dataclasses
import math
from typing import Any

import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int

from motorgrad._errors import check


@dataclasses.dataclass(frozen=True)
class Annealed:
    """A number that goes in a straight line from `start` to `end`, and stays there.

    **Arguments:** `start` and `end`, at least 0, in the number's own units; `steps` of the parameters, at least 1,
    after which it is at its end.
    """

    start: float
    end: float = 0.0
    steps: int = 1000

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            check(0 <= getattr(self, name) < math.inf, name, getattr(self, name), "a finite number of at least 0")
        check(1 <= self.steps < 2**31, "steps", self.steps, "a positive number of steps of the parameters")


def at(number: float | Annealed, steps: Int[Array, ""] | None) -> Float[Array, ""]:
    """A number as it is after so many steps of the parameters; `None` for one that does not change."""
    if not isinstance(number, Annealed) or steps is None:
        return jnp.asarray(number.start if isinstance(number, Annealed) else number, jnp.result_type(float))
    line: Any = optax.linear_schedule(number.start, number.end, number.steps)
    return line(steps)


def check_schedule(name: str, number: Any) -> None:
    """Refuse what is neither a finite number of at least 0 nor `Annealed`."""
    fixed = isinstance(number, int | float) and not isinstance(number, bool) and 0 <= number < math.inf
    check(fixed or isinstance(number, Annealed), name, number, "a finite number of at least 0, or Annealed")
