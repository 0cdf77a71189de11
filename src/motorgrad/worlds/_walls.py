"""The walls of a box: what they bear, what they rub, and how they throw back (appendix A.3 of the thesis)."""

import dataclasses
from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from motorgrad._errors import check, choice

Side = Literal["left", "bottom", "right", "top"]
SIDES: tuple[Side, ...] = ("left", "bottom", "right", "top")

Pair = tuple[Float[Array, ""], Float[Array, ""]]
"""Of x and y. As numbers by themselves they compile to much quicker code than as an array."""
Flags = tuple[Bool[Array, ""], Bool[Array, ""]]


@dataclasses.dataclass(frozen=True)
class Walls:
    r"""A box of up to four walls.

    A particle beyond a wall is put back on it. If it still flies outwards, it is thrown back with `restitution` × its
    normal speed; if that is so slow that the force which presses it would turn it within one time step, it comes to
    rest. A particle that rests on a wall and is pressed against it by a force $F$ is borne: the wall cancels the normal
    part $N \cdot F$, and rubs with $-k_f\,|N \cdot F|\,v_t$ against the motion along it. (The sign printed in the
    source would accelerate.)

    **Arguments:**

    - `left`: x of the left side.
    - `bottom`: y of the lower side.
    - `right`: x of the right side.
    - `top`: y of the upper side.
    - `open`: the sides that have no wall.
    - `restitution`: speed after a collision by the speed before, from 0 to 1.
    - `friction` (s/length): $k_f$, at least 0.
    """

    left: float = 0.0
    bottom: float = 0.0
    right: float = 1.0
    top: float = 1.0
    open: tuple[Side, ...] = ()
    restitution: float = 0.5
    friction: float = 0.1

    def __post_init__(self) -> None:
        wide = -1e6 < self.left < self.right < 1e6 and -1e6 < self.bottom < self.top < 1e6
        sides = (self.left, self.bottom, self.right, self.top)
        check(wide, "left, bottom, right, top", sides, "a box, left < right and bottom < top, within 1e6")
        for side in self.open:
            choice("open", side, SIDES)
        check(0 <= self.restitution <= 1, "restitution", self.restitution, "from 0 to 1")
        check(0 <= self.friction < 1e6, "friction", self.friction, "from 0 to 1e6")

    @property
    def spans(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """From where to where the box reaches along x, and along y."""
        return (self.left, self.right), (self.bottom, self.top)

    def contains(self, x: float, y: float) -> bool:
        """Whether a point is within the box or on its edge."""
        return self.left <= x <= self.right and self.bottom <= y <= self.top

    def resting(self, position: Pair, velocity: Pair) -> tuple[Flags, Flags]:
        """For each axis, whether a particle is on its lower and on its upper wall, and not about to leave it."""
        on = [
            (solid[0] & (at <= span[0]) & (speed <= 0), solid[1] & (at >= span[1]) & (speed >= 0))
            for span, solid, at, speed in zip(self.spans, self._solid(), position, velocity, strict=True)
        ]
        return on[0], on[1]

    def bear(self, force: Pair, velocity: Pair, resting: tuple[Flags, Flags]) -> Pair:
        """What is left of a force on a particle that is `resting` so, with what rubs."""
        borne = [(low & (part < 0)) | (high & (part > 0)) for part, (low, high) in zip(force, resting, strict=True)]
        pressed = [jnp.where(held, jnp.abs(part), 0.0) for part, held in zip(force, borne, strict=True)]
        left = [jnp.where(held, 0.0, part) for part, held in zip(force, borne, strict=True)]
        # what presses along one axis rubs along the other
        return (
            left[0] - self.friction * pressed[1] * velocity[0],
            left[1] - self.friction * pressed[0] * velocity[1],
        )

    def collide(self, position: Pair, velocity: Pair, gain: Pair) -> tuple[Pair, Pair, tuple[Flags, Flags]]:
        """After a time step in which force changes the velocity by `gain`: position, velocity, and for each axis
        whether the lower and the upper side were reached, be they walls or open."""
        places, speeds, reached = [], [], []
        for (low, high), solid, at, speed, more in zip(
            self.spans, self._solid(), position, velocity, gain, strict=True
        ):
            below, above = solid[0] & (at < low), solid[1] & (at > high)
            # a rebound that is over within the step is none
            weak = self.restitution * jnp.abs(speed) <= jnp.sign(speed) * more
            thrown = jnp.where(weak, 0.0, -self.restitution * speed)
            reached.append((at <= low, at >= high))
            places.append(jnp.where(below, low, jnp.where(above, high, at)))
            speeds.append(jnp.where((below & (speed < 0)) | (above & (speed > 0)), thrown, speed))
        return (places[0], places[1]), (speeds[0], speeds[1]), (reached[0], reached[1])

    def _solid(self) -> tuple[tuple[bool, bool], tuple[bool, bool]]:
        left, bottom, right, top = (side not in self.open for side in SIDES)
        return (left, right), (bottom, top)
