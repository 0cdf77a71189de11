"""Muscles that grow weaker or stronger while their motoneurons learn (section 4.4.1 of the thesis)."""

import dataclasses
from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from motorgrad._errors import check, choice


@dataclasses.dataclass(frozen=True)
class Drift:
    r"""The strength of the muscle as a factor that changes with time, from 1 to 1 + `amount` and back.

    **Arguments:**

    - `amount`: the greatest change; −0.3 for a muscle that loses 30 % and regains it, 0 for none. Above −1.
    - `period` (decisions): after which it begins again.
    - `form`: `"sine"`, $1 + \tfrac12 A\,(1 - \cos 2\pi t/T)$; `"steps"`, 1 in the first half of each period and
      $1 + A$ in the second.
    """

    amount: float = 0.0
    period: int = 1_000_000
    form: Literal["sine", "steps"] = "sine"

    def __post_init__(self) -> None:
        check(-1 < self.amount < 100, "amount", self.amount, "above -1 and below 100")
        check(isinstance(self.period, int) and 2 <= self.period < 2**31, "period", self.period, "2 … 2147483647")
        choice("form", self.form, ("sine", "steps"))

    def strength(self, clock: Int[Array, ""] | None) -> Float[Array, ""] | float:
        """The factor at a decision of the period, counted from 0; 1 without a clock."""
        if clock is None:
            return 1.0
        if self.form == "steps":
            return jnp.where(clock < self.period // 2, 1.0, 1.0 + self.amount)
        return 1.0 + 0.5 * self.amount * (1.0 - jnp.cos(2.0 * jnp.pi * clock / self.period))

    def start(self) -> Int[Array, ""] | None:
        """The clock at the first decision; none is kept where nothing drifts."""
        return jnp.zeros((), jnp.int32) if self.amount else None

    def tick(self, clock: Int[Array, ""] | None) -> Int[Array, ""] | None:
        """The clock at the next decision."""
        return None if clock is None else (clock + 1) % self.period
