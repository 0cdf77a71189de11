"""What moves a particle beside the forces of actions, and how its motion is integrated (appendix A.3 of the thesis)."""

import dataclasses
from collections.abc import Callable
from typing import TypeVar

import jax
import numpy as np

from motorgrad._errors import check
from motorgrad.worlds._circular_field import CircularField
from motorgrad.worlds._walls import Flags, Pair, Walls

MOST = 10_000  # steps of integration in a decision
STABLE = 2.78  # the reach of Runge and Kutta's method of fourth order along the negative axis

T = TypeVar("T")
Motion = tuple[Pair, Pair]
"""Position and velocity."""


@dataclasses.dataclass(frozen=True)
class ParticlePhysics:
    r"""What moves a particle beside the forces of actions.

    $m\ddot x = m g - k_d \dot x + f(x) + \ldots$, integrated by Runge and Kutta's method of fourth order.

    **Arguments:**

    - `mass`: of the particle, positive.
    - `gravity`: acceleration, x and y.
    - `drag`: $k_d$, force by speed, at least 0.
    - `noise`: deviation of a random force in each axis, drawn anew at every time step; 0 for none.
    - `timestep` (s): of the integration.
    - `substeps`: time steps for which an action is held.
    - `walls`: the box (`motorgrad.worlds.Walls`).
    - `field`: a field of force (`motorgrad.worlds.CircularField`); by default none.

    **Raises:** `ValueError` naming the field and what it may be; for a circular field in which nothing could orbit.
    """

    mass: float = 1.0
    gravity: tuple[float, float] = (0.0, -0.25)
    drag: float = 1.0
    noise: float = 0.0
    timestep: float = 0.1
    substeps: int = 2
    walls: Walls = dataclasses.field(default_factory=Walls)
    field: CircularField = dataclasses.field(default_factory=CircularField)

    def __post_init__(self) -> None:
        for name in ("mass", "timestep"):
            check(1e-6 < getattr(self, name) < 1e6, name, getattr(self, name), "between 1e-6 and 1e6")
        check(np.abs(self.gravity).max() < 1e6, "gravity", self.gravity, "two numbers between -1e6 and 1e6")
        for name in ("drag", "noise"):
            check(0 <= getattr(self, name) < 1e6, name, getattr(self, name), "from 0 to 1e6")
        whole = isinstance(self.substeps, int) and 1 <= self.substeps <= MOST
        check(whole, "substeps", self.substeps, f"from 1 to {MOST}")
        most = STABLE * self.mass / max(self.drag, 1e-12)
        check(self.timestep < most, "timestep", self.timestep, f"below {most:.4g}, where drag is integrated stably")
        bent = self.mass * self.field.tangential**2
        if self.field.tangential:
            words = "above mass × tangential² / drag²: the orbit's radius would have no end"
            check(self.field.radial * self.drag**2 > bent, "field.radial", self.field.radial, words)

    @property
    def orbit_radius(self) -> float:
        r"""Of the orbit in the circular field without gravity, walls and forces:
        $k_2 r^* / (k_2 - m k_1^2 / k_d^2)$."""
        field = self.field
        check(field.radial > 0, "field.radial", field.radial, "positive, for there to be an orbit")
        bent = self.mass * (field.tangential / self.drag) ** 2 if field.tangential else 0.0
        return field.radial * field.radius / (field.radial - bent)

    @property
    def period(self) -> float:
        """Seconds for which an action is held."""
        return self.timestep * self.substeps

    def step(self, motion: Motion, push: Pair) -> tuple[Motion, tuple[Flags, Flags]]:
        """One time step under a constant `push`: the motion afterwards, and the sides that were reached."""
        resting = self.walls.resting(*motion)

        def rate(motion: Motion) -> Motion:
            fx, fy = self.walls.bear(self._force(motion, push), motion[1], resting)
            return motion[1], (fx / self.mass, fy / self.mass)

        moved = runge_kutta(rate, motion, self.timestep)
        fx, fy = self._force(moved, push)
        part = self.timestep / self.mass
        position, velocity, reached = self.walls.collide(*moved, (part * fx, part * fy))
        return (position, velocity), reached

    def _force(self, motion: Motion, push: Pair) -> Pair:
        (x, y), (vx, vy) = motion
        fx = push[0] + self.mass * self.gravity[0] - self.drag * vx
        fy = push[1] + self.mass * self.gravity[1] - self.drag * vy
        if not self.field.acts:
            return fx, fy
        field = self.field.force(x, y)
        return fx + field[0], fy + field[1]


def runge_kutta(rate: Callable[[T], T], state: T, timestep: float) -> T:
    """The state, any pytree, after one time step at these rates of change, to fourth order.

    The stages lie at the time step's half and end; as printed in appendix A.3 they would lie at 1/2 and 1 second.
    """

    def ahead(time: float, slope: T) -> T:
        return jax.tree.map(lambda at, per: at + time * per, state, slope)

    first = rate(state)
    second = rate(ahead(timestep / 2, first))
    third = rate(ahead(timestep / 2, second))
    last = rate(ahead(timestep, third))
    mean = jax.tree.map(lambda a, b, c, d: (a + 2 * b + 2 * c + d) / 6, first, second, third, last)
    return ahead(timestep, mean)
