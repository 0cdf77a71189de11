"""External forces on a particle: the walls of a box, and a circular field of force (appendix A.3 of the
thesis)."""

import dataclasses
from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from motorgrad._errors import check
from motorgrad.schema import Range, Settings, number, static

Side = Literal["left", "bottom", "right", "top"]
SIDES: tuple[Side, ...] = ("left", "bottom", "right", "top")

WITHIN = Range(-1e6, 1e6, open_low=True, open_high=True)
POSITIVE = Range(1e-6, 1e6, open_low=True, open_high=True)
NOT_NEGATIVE = Range(0, 1e6, open_high=True)

Components = tuple[Float[Array, ""], Float[Array, ""]]
"""x and y. Separate scalars compile to much faster code than an array of two."""
Flags = tuple[Bool[Array, ""], Bool[Array, ""]]


@dataclasses.dataclass(frozen=True)
class Walls(Settings):
    r"""A box of up to four walls.

    A particle beyond a wall is put on it. If it still moves outwards, it rebounds with `restitution` × its normal
    speed; if the rebound is so slow that the force pressing on it would reverse it within one time step, it comes to
    rest. A particle resting on a wall, and pressed against it by a force $F$, is supported: the wall cancels the normal
    part $N \cdot F$, and friction $-k_f\,|N \cdot F|\,v_t$ opposes the tangential motion. (With the sign printed in the
    source, it would accelerate.)
    """

    left: float = static(0.0, allowed=WITHIN, help="coordinate x of the left side")
    bottom: float = static(0.0, allowed=WITHIN, help="coordinate y of the lower side")
    right: float = static(1.0, allowed=WITHIN, help="coordinate x of the right side")
    top: float = static(1.0, allowed=WITHIN, help="coordinate y of the upper side")
    open: tuple[Side, ...] = static((), help="the sides without a wall")
    restitution: float = number(0.5, 0, 1, help="ratio of the speeds after and before a collision")
    friction: float = static(0.1, allowed=NOT_NEGATIVE, unit="s/length", help="friction coefficient $k_f$ of the walls")

    def validate(self) -> None:
        sides = (self.left, self.bottom, self.right, self.top)
        wide = self.left < self.right and self.bottom < self.top
        check(wide, "left, bottom, right, top", sides, "a box, left < right and bottom < top")

    @property
    def spans(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The extent of the box along x and along y."""
        return (self.left, self.right), (self.bottom, self.top)

    def contains(self, x: float, y: float) -> bool:
        """Whether a point is within the box or on its edge."""
        return self.left <= x <= self.right and self.bottom <= y <= self.top

    def passed(self, position: Components) -> Bool[Array, ""]:
        """Whether a particle is beyond a wall."""
        beyond = [
            (solid[0] & (at < low)) | (solid[1] & (at > high))
            for (low, high), solid, at in zip(self.spans, self._solid(), position, strict=True)
        ]
        return beyond[0] | beyond[1]

    def resting(self, position: Components, velocity: Components) -> tuple[Flags, Flags]:
        """For each axis, whether a particle is on its lower and on its upper wall, and not moving away from it."""
        on = [
            (solid[0] & (at <= span[0]) & (speed <= 0), solid[1] & (at >= span[1]) & (speed >= 0))
            for span, solid, at, speed in zip(self.spans, self._solid(), position, velocity, strict=True)
        ]
        return on[0], on[1]

    def bear(self, force: Components, velocity: Components, resting: tuple[Flags, Flags]) -> Components:
        """The remaining force on a particle that is `resting`: without the supported part, with friction."""
        borne = [(low & (part < 0)) | (high & (part > 0)) for part, (low, high) in zip(force, resting, strict=True)]
        pressed = [jnp.where(held, jnp.abs(part), 0.0) for part, held in zip(force, borne, strict=True)]
        left = [jnp.where(held, 0.0, part) for part, held in zip(force, borne, strict=True)]
        # pressure along one axis causes friction along the other
        return (left[0] - self.friction * pressed[1] * velocity[0], left[1] - self.friction * pressed[0] * velocity[1])

    def collide(
        self, position: Components, velocity: Components, gain: Components
    ) -> tuple[Components, Components, tuple[Flags, Flags]]:
        """Position and velocity after collisions, for a time step in which force changes the velocity by `gain`; and
        for each axis whether the lower and the upper side were reached, whether walls or open."""
        places = []
        speeds = []
        reached = []
        for (low, high), solid, at, speed, more in zip(
            self.spans, self._solid(), position, velocity, gain, strict=True
        ):
            below = solid[0] & (at < low)
            above = solid[1] & (at > high)
            # a rebound that ends within the time step does not count
            weak = self.restitution * jnp.abs(speed) <= jnp.sign(speed) * more
            thrown = jnp.where(weak, 0.0, -self.restitution * speed)
            reached.append((at <= low, at >= high))
            places.append(jnp.where(below, low, jnp.where(above, high, at)))
            speeds.append(jnp.where((below & (speed < 0)) | (above & (speed > 0)), thrown, speed))
        return (places[0], places[1]), (speeds[0], speeds[1]), (reached[0], reached[1])

    def _solid(self) -> tuple[tuple[bool, bool], tuple[bool, bool]]:
        left, bottom, right, top = (side not in self.open for side in SIDES)
        return (left, right), (bottom, top)


Number = Float[Array, ""]


@dataclasses.dataclass(frozen=True)
class CircularField(Settings):
    r"""The force $f = k_1 r\,\hat t + k_2 (r^* - r)\,\hat r$ at the distance $r$ from a centre (figure A.2 of the
    thesis).

    $\hat r$ points outwards, and $\hat t$ clockwise if y points up. At the centre itself $\hat r$ is the x axis.

    As printed in the source, the first term turns anticlockwise, and the second lacks the centre; both are corrected
    here.
    """

    tangential: float = static(
        0.0, allowed=WITHIN, unit="1/s²", help="strength $k_1$ of the tangential term for a mass of 1; 0 for none"
    )
    radial: float = static(
        0.0, allowed=NOT_NEGATIVE, unit="1/s²", help="strength $k_2$ of the radial term for a mass of 1; 0 for none"
    )
    radius: float = number(
        0.25, 0, 1e6, open_low=True, open_high=True, help="radius $r^*$, towards which the second term pushes"
    )
    centre: tuple[float, float] = static((0.5, 0.5), allowed=WITHIN, help="x and y of the centre of the field")

    @property
    def acts(self) -> bool:
        """Whether there is any force at all."""
        return self.tangential != 0 or self.radial != 0

    def force(self, x: Number, y: Number) -> tuple[Number, Number]:
        """The force on a particle at x, y."""
        away_x = x - self.centre[0]
        away_y = y - self.centre[1]
        distance = self.distance(x, y)
        safe = jnp.where(distance == 0, 1.0, distance)
        outwards = jnp.where(distance == 0, 1.0, away_x / safe), away_y / safe
        push = self.radial * (self.radius - distance)
        return self.tangential * away_y + push * outwards[0], push * outwards[1] - self.tangential * away_x

    def distance(self, x: Number, y: Number) -> Number:
        """Distance from the centre."""
        return jnp.sqrt((x - self.centre[0]) ** 2 + (y - self.centre[1]) ** 2)
