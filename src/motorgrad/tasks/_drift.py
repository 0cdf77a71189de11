"""Muscles that grow weaker or stronger, and loads that grow, while motoneurons learn (section 4.4.1 of the thesis)."""

import dataclasses
from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from motorgrad._errors import check, choice


@dataclasses.dataclass(frozen=True)
class Drift:
    r"""What changes with time $t$, there and back: the strength of the muscle, or the load beside the one that is seen.

    **Arguments:**

    - `amount`: $A$, the greatest change; 0 for none. Of the strength as a part, above −1: −0.3 for a muscle that loses
      30 % and regains it. Of the load in units of the load.
    - `period` (decisions): $T$, after which it begins again.
    - `form`: `"sine"`, $A f(t)$ with $f = \tfrac12 (1 - \cos 2\pi t/T)$; `"steps"`, 0 in the first half of each period
      and $A$ in the second.
    - `of`: `"strength"`, a factor of the muscle's force, from 1 to $1 + A$; or `"load"`, what hangs in the hand beside
      the observed load, from 0 to $A$: the arm has grown heavier, or holds a tool.
    """

    amount: float = 0.0
    period: int = 1_000_000
    form: Literal["sine", "steps"] = "sine"
    of: Literal["strength", "load"] = "strength"

    def __post_init__(self) -> None:
        choice("of", self.of, ("strength", "load"))
        if self.of == "strength":
            check(-1 < self.amount < 100, "amount", self.amount, "above -1 and below 100, of the strength")
        else:
            check(abs(self.amount) < 1e6, "amount", self.amount, "between -1e6 and 1e6, in units of the load")
        check(isinstance(self.period, int) and 2 <= self.period < 2**31, "period", self.period, "2 … 2147483647")
        choice("form", self.form, ("sine", "steps"))

    def strength(self, clock: Int[Array, ""] | None) -> Float[Array, ""] | float:
        """The factor of the muscle's force at a decision of the period, counted from 0; 1 without a clock."""
        return self._course(1.0, clock) if self.of == "strength" else 1.0

    def load(self, clock: Int[Array, ""] | None) -> Float[Array, ""] | float:
        """What hangs in the hand beside the observed load, at a decision of the period; 0 without a clock."""
        return self._course(0.0, clock) if self.of == "load" else 0.0

    def start(self) -> Int[Array, ""] | None:
        """The clock at the first decision; none is kept where nothing drifts."""
        return jnp.zeros((), jnp.int32) if self.amount else None

    def tick(self, clock: Int[Array, ""] | None) -> Int[Array, ""] | None:
        """The clock at the next decision."""
        return None if clock is None else (clock + 1) % self.period

    def _course(self, start: float, clock: Int[Array, ""] | None) -> Float[Array, ""] | float:
        """From `start` to `start` + `amount` and back."""
        if clock is None:
            return start
        if self.form == "steps":
            return jnp.where(clock < self.period // 2, start, start + self.amount)
        return start + 0.5 * self.amount * (1.0 - jnp.cos(2.0 * jnp.pi * clock / self.period))
