"""What the tasks on a particle have in common: its place is seen, and every unit switches a force on or off."""

import abc
import dataclasses
import functools
import math
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from motorgrad._errors import check
from motorgrad._random import normals
from motorgrad.tasks._task import Task
from motorgrad.worlds import Particle, ParticlePhysics, ParticleStart, ParticleState

MOST = 10_000  # units
FASTEST = 0.5  # to either side: the usual speeds of the thesis's particle, for the range of what is observed


@dataclasses.dataclass(frozen=True)
class ParticleTask(Task):
    """A particle that units push.

    **Arguments:**

    - `units`: actions, each a force on the particle, from 1 to 10,000.
    - `forces` (x, y): of the units, dealt out in turn: the first unit has the first, and after the last it begins
      again.
    - `observe_velocity`: whether the velocity is observed beside the position.
    - `observation_noise`: deviation of the normal noise on every observed number; 0 for none.
    - `time_limit`: decisions after which an episode is cut; `None` or 0 for never.
    - `physics`: mass, gravity, drag, walls, field, noise, time step (`motorgrad.worlds.ParticlePhysics`).
    - `start`: where an episode begins (`motorgrad.worlds.ParticleStart`).
    """

    units: int = 8
    forces: tuple[tuple[float, float], ...] = ((-0.4, 0.0), (0.4, 0.0))
    observe_velocity: bool = False
    observation_noise: float = 0.0
    time_limit: int | None = None
    physics: ParticlePhysics = dataclasses.field(default_factory=ParticlePhysics)
    start: ParticleStart = dataclasses.field(default_factory=ParticleStart)

    def __post_init__(self) -> None:
        check(isinstance(self.units, int) and 1 <= self.units <= MOST, "units", self.units, f"from 1 to {MOST}")
        check(len(self.forces) > 0, "forces", self.forces, "at least one")
        check(0 <= self.observation_noise < 1e6, "observation_noise", self.observation_noise, "from 0 to 1e6")
        whole = self.time_limit is None or (isinstance(self.time_limit, int) and 0 <= self.time_limit < 2**31)
        check(whole, "time_limit", self.time_limit, "None, or from 0 (for never) to 2147483647 decisions")
        self.dynamics  # noqa: B018 (making it refuses what cannot be)

    @property
    def dynamics(self) -> Particle:
        return _world(self.forces, self.units, self.physics, self.start)

    @property
    def observation_size(self) -> int:
        return 4 if self.observe_velocity else 2

    @property
    def observation_names(self) -> tuple[str, ...]:
        return ("x", "y", "x velocity", "y velocity")[: self.observation_size]

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...]:
        walls = self.physics.walls
        place = ((walls.left, walls.right), (walls.bottom, walls.top))
        return place + ((-FASTEST, FASTEST),) * 2 if self.observe_velocity else place

    @property
    def action_size(self) -> int:
        return self.units

    @property
    def takes(self) -> tuple[str, ...]:
        """Zeros and ones, or real numbers: an action multiplies its unit's force, which a negative one turns round."""
        return ("binary", "graded")

    @property
    def period(self) -> float:
        return self.physics.period

    @property
    def episode_limit(self) -> int | None:
        return self.time_limit or None

    @property
    def uniforms(self) -> int:  # type: ignore[override]  # pyright: ignore[reportIncompatibleVariableOverride]
        """One for the noise of each observed number."""
        return self.observation_size if self.observation_noise else 0

    def observe(
        self, memory: Any, state: ParticleState, uniforms: Float[Array, " uniforms"]
    ) -> tuple[Any, Float[Array, " observation_size"]]:
        seen = jnp.concatenate([state.position, state.velocity]) if self.observe_velocity else state.position
        return memory, seen + self.observation_noise * normals(uniforms) if self.observation_noise else seen

    @abc.abstractmethod
    def reward(
        self, memory: Any, state: ParticleState, action: Float[Array, " units"]
    ) -> tuple[Any, Float[Array, ""], Bool[Array, ""] | bool]: ...


@functools.cache  # tasks are equal by their numbers; so are their worlds
def _world(
    forces: tuple[tuple[float, float], ...], units: int, physics: ParticlePhysics, start: ParticleStart
) -> Particle:
    return Particle(tuple(forces[unit % len(forces)] for unit in range(units)), physics, start)


def around(strength: float, directions: int) -> tuple[tuple[float, float], ...]:
    """Forces of one strength in evenly spaced directions, anticlockwise from the right."""
    turns = [2 * math.pi * n / directions for n in range(directions)]
    return tuple(
        (round(strength * math.cos(turn), 12) + 0.0, round(strength * math.sin(turn), 12) + 0.0) for turn in turns
    )
