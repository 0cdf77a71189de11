"""Two controllers for a tripod gait: a state machine per leg, and an open-loop clock."""

import dataclasses
import enum
import math
from typing import Any, NamedTuple

from motorgrad._arrays import AnyArray, Real
from motorgrad._errors import check
from motorgrad.bodies.hexapod._sensors import LEGS, HexapodReading
from motorgrad.schema import Settings, number, static

TRIPODS = (("left_front", "right_middle", "left_rear"), ("right_front", "left_middle", "right_rear"))
"""The legs of the two tripods: front and rear of one side with the middle of the other."""


class LegState(enum.IntEnum):
    """The state of a leg: pushing back on the ground, waiting there, swinging forward in the air, or lowering."""

    STANCE = 0
    WAIT = 1
    SWING = 2
    DROP = 3


class Turning(NamedTuple):
    """Desired velocities of a leg in rad/s: `lateral`, positive forward, and `vertical`, positive up."""

    lateral: float
    vertical: float


@dataclasses.dataclass(frozen=True)
class TripodController(Settings):
    """A finite-state machine for each leg of a hexapod (thesis, section 5.3.3 and figure 5.7).

    It is deterministic and does not learn. At each decision, a leg changes its state if a condition holds:

    - stance → wait when the leg is behind `back`;
    - wait → swing when more than one leg of the opposing tripod supports the body;
    - swing → drop when the leg is ahead of `forward`;
    - drop → stance when the foot touches the ground with more than `contact`.

    A leg supports the body in stance and while it waits. The thesis counts the legs "in the stance phase", and knows
    two phases (section 5.3): in one a leg stands on the ground, in the other it swings. A waiting leg stands, so it
    counts, though the state machine has a state of its own for it. If only legs in the *state* stance counted, legs
    that land one by one, each reaching `back` before the next lands, would soon all wait for each other, for ever.

    A leg over a hollow drops for ever, and if two of a tripod do, the others wait. `mended` prevents that: the vertical
    joint within `margin` of its lower limit also counts as contact. This is our addition.

    The state of a leg sets the velocities of its two joints:

    | state | lateral | vertical |
    |---|---|---|
    | stance | −`stance` | −`press` |
    | wait | 0 | −`press` |
    | swing | `swing` | `lift` |
    | drop | 0 | −`drop` |
    """

    back: float = number(-20.0, unit="degrees", help="lateral angle at which stance ends, positive forward")
    forward: float = number(20.0, unit="degrees", help="lateral angle at which swing ends")
    stance: float = number(3.0, 0, open_low=True, unit="rad/s", help="backward velocity in stance")
    swing: float = number(6.0, 0, open_low=True, unit="rad/s", help="forward velocity in swing")
    lift: float = number(6.0, 0, open_low=True, unit="rad/s", help="upward velocity in swing")
    drop: float = number(6.0, 0, open_low=True, unit="rad/s", help="downward velocity while dropping")
    press: float = number(1.0, 0, unit="rad/s", help="downward velocity in stance and wait")
    contact: float = number(0.5, 0, unit="N", help="force above which a foot counts as touching the ground")
    margin: float = number(
        1.0, 0, unit="degrees", help="distance from the lower limit that counts as contact, if `mended`"
    )
    mended: bool = static(
        True, help="whether a leg at its lower limit counts as touching the ground; without, the rules are the thesis's"
    )

    def validate(self) -> None:
        check(self.back < self.forward, "back", self.back, f"below forward = {self.forward!r}")

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
        """The initial states (..., 6): one tripod in stance, the other in swing."""
        first = _members(reading.lateral)
        return _xp(first).where(first, int(LegState.STANCE), int(LegState.SWING))

    def decide(self, states: AnyArray, reading: HexapodReading, lowest: AnyArray) -> Any:
        """The next states of the legs.

        **Arguments:** `states` (..., 6), integers as in `LegState`; the sensor readings; `lowest` (6,), the lower
        limits of the vertical joints in rad. NumPy or JAX; legs in the order of `LEGS`.
        """
        xp = _xp(states)
        first = _members(reading.lateral)
        supports = (states == LegState.STANCE) | (states == LegState.WAIT)
        of_first = xp.sum(supports & first, axis=-1, keepdims=True)
        of_second = xp.sum(supports & ~first, axis=-1, keepdims=True)
        down = reading.contact > self.contact
        if self.mended:
            down = down | (reading.vertical < xp.asarray(lowest) + math.radians(self.margin))
        done = {
            LegState.STANCE: reading.lateral < math.radians(self.back),
            LegState.WAIT: xp.where(first, of_second, of_first) > 1,
            LegState.SWING: reading.lateral > math.radians(self.forward),
            LegState.DROP: down,
        }
        after = states
        for state, ready in done.items():
            after = xp.where((states == state) & ready, (state + 1) % len(LegState), after)
        return after

    def velocities(self, states: AnyArray) -> Any:
        """The desired velocities (..., 12) in rad/s: of the six lateral joints, then of the six vertical ones."""
        xp = _xp(states)
        table = xp.asarray(list(self.turning.values()))
        return xp.concat([table[states, 0], table[states, 1]], axis=-1)


@dataclasses.dataclass(frozen=True)
class TripodClock(Settings):
    """An open-loop clock by which two tripods alternate between swing and stance, whatever the legs sense (thesis,
    section 5.4.1).

    A phase from 0 to 1 spans one stride. The first tripod is in stance while the phase is in [0, `duty`), the second
    half a stride later; each swings for the rest of the stride.
    """

    duty: float = number(
        0.5, 0, 1, open_low=True, open_high=True, help="the fraction of a stride that each tripod spends in stance"
    )

    def advance(self, phase: Real, period: Real, seconds: float) -> Any:
        """The phase `seconds` later, for a stride of `period` seconds. NumPy or JAX, any shape."""
        return (phase + seconds / period) % 1.0

    def activation(self, phase: AnyArray) -> Any:
        """Which synergies are active at phases (...), as zeros and ones (..., 4): swing and stance of the first tripod,
        then of the second, as in `motorgrad.tasks.TRIPOD_SYNERGIES`."""
        xp = phase.__array_namespace__()
        first, second = ((phase + shift) % 1.0 < self.duty for shift in (0.0, 0.5))
        return xp.stack([~first, first, ~second, second], axis=-1) * 1.0


def _members(like: AnyArray) -> Any:
    """Which legs belong to the first tripod, in the shape of `like` (..., 6)."""
    xp = _xp(like)
    return xp.broadcast_to(xp.asarray([leg in TRIPODS[0] for leg in LEGS]), like.shape)


def _xp(array: AnyArray) -> Any:
    return array.__array_namespace__()
