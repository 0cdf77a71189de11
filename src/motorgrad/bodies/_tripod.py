"""The fixed controller of a tripod gait: one small state machine for each leg."""

import dataclasses
import enum
import math
from typing import Any, NamedTuple

from motorgrad._errors import check
from motorgrad.bodies._hexapod_sensors import LEGS, HexapodReading
from motorgrad.bodies._muscle import not_negative, positive

TRIPODS = (("left_front", "right_middle", "left_rear"), ("right_front", "left_middle", "right_rear"))
"""The legs of the two tripods: front and rear of one side with the middle of the other."""


class LegState(enum.IntEnum):
    """What a leg is doing: pushing back on the ground, holding there, going forward in the air, coming down."""

    STANCE = 0
    WAIT = 1
    SWING = 2
    DROP = 3


class Turning(NamedTuple):
    """Desired velocities of a leg in rad/s: `lateral`, positive forward, and `vertical`, positive up."""

    lateral: float
    vertical: float


@dataclasses.dataclass(frozen=True)
class TripodController:
    r"""A finite-state machine for each leg of a hexapod (thesis, section 5.3.3 and figure 5.7).

    It is deterministic, and learns nothing. At each decision every leg changes its state where a condition holds:

    - stance → wait when the leg is back beyond `back`;
    - wait → swing when more than one leg of the opposing tripod is in stance;
    - swing → drop when the leg is forward beyond `forward`;
    - drop → stance when the foot touches the ground with more than `contact`.

    So far the source, and so worded it can stand still for ever, in two ways, which `mended` ends. A leg over a hollow
    drops for ever while the others wait: the vertical joint within `margin` of its lower limit counts as contact too.
    And legs that come down one by one, each back before the next stands, never make two in stance, until all six wait:
    then the first tripod swings.

    Then its state sets the velocities of its two joints:

    | state | lateral | vertical |
    |---|---|---|
    | stance | −`stance` | −`press` |
    | wait | 0 | −`press` |
    | swing | `swing` | `lift` |
    | drop | 0 | −`drop` |

    **Arguments:** `back` and `forward` in degrees, positive forward; `stance`, `swing`, `lift`, `drop`, `press` in
    rad/s; `contact` in N; `margin` in degrees; `mended`.

    **Raises:** `ValueError` naming the field and what it may be.
    """

    back: float = -20.0
    forward: float = 20.0
    stance: float = 3.0
    swing: float = 6.0
    lift: float = 6.0
    drop: float = 6.0
    press: float = 1.0
    contact: float = 0.5
    margin: float = 1.0
    mended: bool = True

    def __post_init__(self) -> None:
        for name in ("stance", "swing", "lift", "drop"):
            positive(name, getattr(self, name))
        for name in ("press", "contact", "margin"):
            not_negative(name, getattr(self, name))
        right = math.isfinite(self.back) and math.isfinite(self.forward) and self.back < self.forward
        check(right, "back", self.back, f"a finite angle in degrees below forward = {self.forward!r}")

    @property
    def turning(self) -> dict[LegState, Turning]:
        """The velocities that each state sets."""
        return {
            LegState.STANCE: Turning(-self.stance, -self.press),
            LegState.WAIT: Turning(0.0, -self.press),
            LegState.SWING: Turning(self.swing, self.lift),
            LegState.DROP: Turning(0.0, -self.drop),
        }

    def begin(self, reading: HexapodReading) -> Any:
        """The states (..., 6) of the legs at the start: one tripod in stance, the other in swing."""
        first = _members(reading.lateral)
        return _xp(first).where(first, int(LegState.STANCE), int(LegState.SWING))

    def decide(self, states: Any, reading: HexapodReading, lowest: Any) -> Any:
        """The next states of the legs.

        **Arguments:** `states` (..., 6), whole numbers as in `LegState`; what the body feels; `lowest` (6,), the lower
        limits of its vertical joints in rad. NumPy or JAX; legs in the order of `LEGS`.
        """
        xp = _xp(states)
        first = _members(reading.lateral)
        standing = states == LegState.STANCE
        in_first = xp.sum(standing & first, axis=-1, keepdims=True)
        in_second = xp.sum(standing & ~first, axis=-1, keepdims=True)
        down = reading.contact > self.contact
        go = xp.where(first, in_second, in_first) > 1
        if self.mended:
            go = go | (first & xp.all(states == LegState.WAIT, axis=-1, keepdims=True))
            down = down | (reading.vertical < xp.asarray(lowest) + math.radians(self.margin))
        done = {
            LegState.STANCE: reading.lateral < math.radians(self.back),
            LegState.WAIT: go,
            LegState.SWING: reading.lateral > math.radians(self.forward),
            LegState.DROP: down,
        }
        after = states
        for state, ready in done.items():
            after = xp.where((states == state) & ready, (state + 1) % len(LegState), after)
        return after

    def velocities(self, states: Any) -> Any:
        """The desired velocities (..., 12) in rad/s: of the six lateral joints, then of the six vertical ones."""
        xp = _xp(states)
        table = xp.asarray(list(self.turning.values()))
        return xp.concat([table[states, 0], table[states, 1]], axis=-1)


def _members(like: Any) -> Any:
    """Which legs are of the first tripod, of the shape of `like` (..., 6)."""
    xp = _xp(like)
    return xp.broadcast_to(xp.asarray([leg in TRIPODS[0] for leg in LEGS]), like.shape)


def _xp(array: Any) -> Any:
    return array.__array_namespace__()
