"""The open-loop tripod gait: a clock that feels nothing."""

import dataclasses
from typing import Any

from motorgrad._errors import check


@dataclasses.dataclass(frozen=True)
class TripodClock:
    """A clock by which two tripods take turns in swing and stance, whatever the legs feel (thesis, section 5.4.1).

    One turn of its phase, from 0 to 1, is one stride. The first tripod stands while the phase is in [0, `duty`), the
    second half a turn later, and each swings for the rest of it.

    **Arguments:**

    - `duty`: the part of a stride in which each tripod stands, in (0, 1).

    **Raises:** `ValueError` for a duty out of range.
    """

    duty: float = 0.5

    def __post_init__(self) -> None:
        check(0 < self.duty < 1, "duty", self.duty, "in (0, 1)")

    def advance(self, phase: Any, period: Any, seconds: float) -> Any:
        """The phase `seconds` later, for a stride of `period` seconds. NumPy or JAX, any shape."""
        return (phase + seconds / period) % 1.0

    def activation(self, phase: Any) -> Any:
        """Which synergies are active at phases (...), as zeros and ones (..., 4): swing and stance of the first tripod,
        then of the second, as `motorgrad.tasks.TRIPOD_SYNERGIES` has them."""
        xp = phase.__array_namespace__()
        first, second = ((phase + shift) % 1.0 < self.duty for shift in (0.0, 0.5))
        return xp.stack([~first, first, ~second, second], axis=-1) * 1.0
