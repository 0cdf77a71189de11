"""A field of force that drives round a centre and towards a radius (appendix A.3 of the thesis, figure A.2)."""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check

Number = Float[Array, ""]


@dataclasses.dataclass(frozen=True)
class CircularField:
    r"""The force $f = k_1 r\,\hat t + k_2 (r^* - r)\,\hat r$ at the distance $r$ from a centre.

    $\hat r$ points outwards, $\hat t$ clockwise where y points up. At the centre itself $\hat r$ is the x axis.

    As printed in the source, the first part turns anticlockwise and the second lacks the centre; both are mended here.

    **Arguments:**

    - `tangential` (1/s² for a mass of 1): $k_1$; 0 for none.
    - `radial` (1/s² for a mass of 1): $k_2$, at least 0; 0 for none.
    - `radius`: $r^*$, towards which the second part pushes.
    - `centre` (x, y): the place round which it drives.
    """

    tangential: float = 0.0
    radial: float = 0.0
    radius: float = 0.25
    centre: tuple[float, float] = (0.5, 0.5)

    def __post_init__(self) -> None:
        check(abs(self.tangential) < 1e6, "tangential", self.tangential, "a number between -1e6 and 1e6")
        check(0 <= self.radial < 1e6, "radial", self.radial, "from 0 to 1e6")
        check(0 < self.radius < 1e6, "radius", self.radius, "positive, below 1e6")
        check(np.abs(self.centre).max() < 1e6, "centre", self.centre, "two numbers between -1e6 and 1e6")

    @property
    def acts(self) -> bool:
        """Whether there is any force at all."""
        return self.tangential != 0 or self.radial != 0

    def force(self, x: Number, y: Number) -> tuple[Number, Number]:
        """The force on a particle at x, y."""
        away_x, away_y, distance = x - self.centre[0], y - self.centre[1], self.distance(x, y)
        safe = jnp.where(distance == 0, 1.0, distance)
        outwards = jnp.where(distance == 0, 1.0, away_x / safe), away_y / safe
        push = self.radial * (self.radius - distance)
        return self.tangential * away_y + push * outwards[0], push * outwards[1] - self.tangential * away_x

    def distance(self, x: Number, y: Number) -> Number:
        """From the centre."""
        return jnp.sqrt((x - self.centre[0]) ** 2 + (y - self.centre[1]) ** 2)
