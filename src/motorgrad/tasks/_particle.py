"""Tasks on a particle in the plane: falling through regions, navigation and orbits (chapter 6 of the thesis)."""

import abc
import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._errors import check
from motorgrad._random import normals
from motorgrad._running import counted_on
from motorgrad.schema import count, inner, number, static
from motorgrad.tasks._task import Flag, Metric, Scalar, Task
from motorgrad.worlds import CircularField, Particle, ParticlePhysics, ParticleStart, ParticleState, Walls

MAX_USUAL_SPEED = 0.5  # per second, of the thesis's particle, for the observation range
FLOOR = 1  # index among the sides of a box
Region = tuple[float, float, float, float, float]
"""Amplitude; x and y of the centre; width (standard deviation) along x and along y."""
LAYOUTS: dict[str, tuple[Region, ...]] = {
    "R1": (
        (1.0, 0.25, 0.55, 0.12, 0.12),
        (-1.0, 0.2, 0.2, 0.15, 0.1),
        (1.0, 0.75, 0.25, 0.12, 0.12),
        (-1.0, 0.7, 0.6, 0.12, 0.12),
    ),
    "R2": (
        (1.0, 0.5, 0.65, 0.1, 0.1),
        (-1.0, 0.5, 0.3, 0.12, 0.12),
        (1.0, 0.15, 0.15, 0.12, 0.12),
        (1.0, 0.85, 0.15, 0.12, 0.12),
    ),
    "R3": (
        (1.0, 0.2, 0.75, 0.1, 0.1),
        (-1.0, 0.5, 0.75, 0.12, 0.1),
        (1.0, 0.8, 0.5, 0.1, 0.1),
        (-1.0, 0.4, 0.5, 0.12, 0.1),
        (1.0, 0.2, 0.2, 0.1, 0.1),
        (-1.0, 0.6, 0.2, 0.12, 0.1),
    ),
}
"""Layouts of the falling particle by name, for the unit square."""


@dataclasses.dataclass(frozen=True)
class ParticleTask(Task):
    """A particle that units push."""

    units: int = count(8, 1, 10_000, help="number of actions, each a force on the particle")
    forces: tuple[tuple[float, float], ...] = static(
        ((-0.4, 0.0), (0.4, 0.0)), help="x and y of the forces of the units, assigned in turn and repeated"
    )
    observe_velocity: bool = static(False, help="whether to observe the velocity in addition to the position")
    observation_noise: float = number(
        0.0, 0, 1e6, open_high=True, help="standard deviation of normal noise on every observed number; 0 for none"
    )
    time_limit: int | None = count(
        None, unit="decisions", help="length at which an episode is cut; `None` or 0 for never"
    )
    physics: ParticlePhysics = inner(
        factory=ParticlePhysics,
        help="mass, gravity, drag, walls, field, noise, time step (`motorgrad.worlds.ParticlePhysics`)",
    )
    start: ParticleStart = inner(
        factory=ParticleStart, help="where an episode starts (`motorgrad.worlds.ParticleStart`)"
    )

    def validate(self) -> None:
        super().validate()
        check(self.forces, "forces", self.forces, "at least one")
        self.dynamics  # noqa: B018 (raises for invalid settings)

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
        return place + ((-MAX_USUAL_SPEED, MAX_USUAL_SPEED),) * 2 if self.observe_velocity else place

    @property
    def action_size(self) -> int:
        return self.units

    @property
    def accepted_actions(self) -> tuple[str, ...]:
        """Zeros and ones, or real numbers: an action multiplies its unit's force, and a negative one reverses it."""
        return ("binary", "continuous")

    @property
    def period(self) -> float:
        return self.physics.period

    @property
    def episode_limit(self) -> int | None:
        return self.time_limit or None

    @property
    def uniforms(self) -> int:  # type: ignore[override]  # pyright: ignore[reportIncompatibleVariableOverride]
        """One per observed number, for its noise."""
        return self.observation_size if self.observation_noise else 0

    def observe(
        self, memory: PyTree, state: ParticleState, uniforms: Float[Array, " uniforms"]
    ) -> tuple[PyTree, Float[Array, " observation_size"]]:
        seen = jnp.concatenate([state.position, state.velocity]) if self.observe_velocity else state.position
        return memory, seen + self.observation_noise * normals(uniforms) if self.observation_noise else seen

    @abc.abstractmethod
    def reward(
        self, memory: PyTree, state: ParticleState, action: Float[Array, " units"]
    ) -> tuple[PyTree, Scalar, Flag]: ...


def around(strength: float, directions: int) -> tuple[tuple[float, float], ...]:
    """Forces of equal strength in evenly spaced directions, anticlockwise from the right."""
    turns = [2 * math.pi * n / directions for n in range(directions)]
    return tuple(
        (round(strength * math.cos(turn), 12) + 0.0, round(strength * math.sin(turn), 12) + 0.0) for turn in turns
    )


@dataclasses.dataclass(frozen=True)
class FallingParticle(ParticleTask):
    """Steer a falling particle through rewarded regions and around penalised ones (section 6.3 of the thesis).

    Observed: the position; the velocity is hidden. Actions: each unit pushes to its side or does not. Reward: the sum
    of Gaussian regions at the position at the end of the decision, minus `penalty` for each unit that fires. An episode
    ends at the floor.
    """

    name: ClassVar[str] = "particle"
    episodic: ClassVar[bool] = True
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "tiles", "copies": 2},
        "decay": 0.95,
        "learning_rate": {"centre": 2e-4, "log_width": 8e-4},
    }

    layout: Literal["R1", "R2", "R3"] = static("R1", help="which regions")
    regions: tuple[Region, ...] | None = static(
        None,
        help="instead of a layout, regions of five numbers each: amplitude, x and y of the centre, widths "
        "along x and y",
    )
    penalty: float = number(
        0.0,
        0,
        1e6,
        open_high=True,
        help="cost of a unit that fires, per decision; times the size of continuous actions",
    )

    def validate(self) -> None:
        super().validate()
        check(self.places, "regions", self.places, "None or at least one region")
        for place, region in enumerate(self.regions or ()):
            check_region(f"regions[{place}]", region, self.physics.walls)

    @property
    def places(self) -> tuple[Region, ...]:
        """The given regions, or the layout's."""
        return LAYOUTS[self.layout] if self.regions is None else self.regions

    def reward(
        self, memory: PyTree, state: ParticleState, action: Float[Array, " units"]
    ) -> tuple[PyTree, Scalar, Flag]:
        cost = self.penalty * jnp.sum(jnp.abs(action))
        return memory, region_reward(self.places, state.position) - cost, state.reached[FLOOR]


@dataclasses.dataclass(frozen=True)
class ParticleNavigation(ParticleTask):
    """Reach the goal quickly, and avoid the obstacles; the policy learns a flow field (section 6.5.4 of the thesis).

    Observed: the position; the velocity is hidden. Actions: each unit pushes in its direction or does not. Reward: the
    sum of the obstacles' Gaussian regions at the position at the end of each decision, and once, when the particle
    comes within one width of the goal's centre, the goal's amplitude. The episode ends there, or is cut at the time
    limit.
    """

    name: ClassVar[str] = "particle-navigation"
    episodic: ClassVar[bool] = True
    metric_names: ClassVar[tuple[str, ...]] = ("arrival", "cost")
    metric_units: ClassVar[Mapping[str, str]] = {"arrival": "decisions"}
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "tiles", "copies": 4, "p_max": 0.5},
        "decay": 0.95,
        "learning_rate": {"centre": 2e-4, "log_width": 8e-4},
    }

    units: int = 64
    forces: tuple[tuple[float, float], ...] = around(0.4, 4)
    time_limit: int = 200  # TOML has no null, so 0 means never
    physics: ParticlePhysics = dataclasses.field(default_factory=lambda: ParticlePhysics(gravity=(0.0, 0.0)))
    start: ParticleStart = dataclasses.field(default_factory=lambda: ParticleStart(x=(0.0, 0.2), y=(0.0, 1.0)))
    goal_region: Region = static(
        (10.0, 0.9, 0.5, 0.08, 0.08),
        help="a region of five numbers: amplitude, x and y of the centre, widths along x and y",
    )
    obstacles: tuple[Region, ...] = static(
        ((-2.0, 0.5, 0.5, 0.1, 0.15),), help="regions in the same form, with negative amplitudes"
    )

    def validate(self) -> None:
        super().validate()
        walls = self.physics.walls
        check_region("goal_region", self.goal_region, walls)
        check(self.goal_region[0] > 0, "goal_region amplitude", self.goal_region[0], "positive")
        for place, region in enumerate(self.obstacles):
            check_region(f"obstacles[{place}]", region, walls)
            check(region[0] < 0, f"obstacles[{place}] amplitude", region[0], "negative")

    def arrived(self, position: Float[Array, " 2"]) -> Flag:
        """Whether the particle is within one width of the goal."""
        return squared_distance(jnp.asarray(self.goal_region, position.dtype)[None], position)[0] <= 1.0

    def init(self, uniforms: Float[Array, " 0"]) -> Int[Array, ""]:
        """Decisions since the start of the episode."""
        return jnp.zeros((), jnp.int32)

    def reward(
        self, memory: Int[Array, ""], state: ParticleState, action: Float[Array, " units"]
    ) -> tuple[Int[Array, ""], Scalar, Flag]:
        arrived = self.arrived(state.position)
        reward = region_reward(self.obstacles, state.position) + jnp.where(arrived, self.goal_region[0], 0.0)
        return counted_on(memory), reward, arrived

    def metrics(self, memory: Int[Array, ""], state: ParticleState) -> dict[str, Metric]:
        """`arrival`: decisions until the goal was reached, if it was. `cost`: the penalty of the obstacles."""
        return {
            "arrival": (memory.astype(state.position.dtype), self.arrived(state.position)),
            "cost": (-region_reward(self.obstacles, state.position), True),
        }


@dataclasses.dataclass(frozen=True)
class ParticleOrbit(ParticleTask):
    """Widen or narrow the orbit of a particle in a circular field of force, without episodes (section 6.4.4 of the
    thesis).

    Observed: the position; the velocity is hidden. Actions: each unit pushes in its direction or does not. Reward: plus
    or minus the distance from the field's centre.
    """

    name: ClassVar[str] = "particle-orbit"
    metric_names: ClassVar[tuple[str, ...]] = ("radius",)
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": "tiles",
        "decay": 0.98,
        "learning_rate": {"centre": 2e-4, "log_width": 8e-4},
    }

    units: int = 16
    forces: tuple[tuple[float, float], ...] = around(0.1, 8)
    physics: ParticlePhysics = dataclasses.field(
        default_factory=lambda: ParticlePhysics(gravity=(0.0, 0.0), field=CircularField(tangential=0.5, radial=1.0))
    )
    start: ParticleStart = dataclasses.field(default_factory=lambda: ParticleStart(y=(0.0, 1.0)))
    wanted: Literal["wide", "narrow"] = static("wide", help='`"wide"` rewards the radius, `"narrow"` penalises it')

    def reward(
        self, memory: PyTree, state: ParticleState, action: Float[Array, " units"]
    ) -> tuple[PyTree, Scalar, bool]:
        radius = self.physics.field.distance(*state.position)
        return memory, radius if self.wanted == "wide" else -radius, False

    def metrics(self, memory: PyTree, state: ParticleState) -> dict[str, Metric]:
        """`radius`: the distance from the field's centre."""
        return {"radius": (self.physics.field.distance(*state.position), True)}


def region_reward(regions: Sequence[Region], position: Float[Array, " 2"]) -> Scalar:
    r"""A sum of axis-aligned Gaussians at a position: $\sum_k A_k \exp\left(-\tfrac12 \lVert (x - c_k)/w_k
    \rVert^2\right)$."""
    numbers = jnp.asarray(regions, position.dtype).reshape(-1, 5)
    return jnp.sum(numbers[:, 0] * jnp.exp(-0.5 * squared_distance(numbers, position)))


def squared_distance(regions: Float[Array, "regions 5"], position: Float[Array, " 2"]) -> Float[Array, " regions"]:
    """The squared distance from the centre of each region, in units of its widths."""
    return jnp.sum(((position - regions[:, 1:3]) / regions[:, 3:]) ** 2, axis=-1)


def check_region(name: str, region: Region, walls: Walls) -> None:
    """Refuse a region without extent, or with its centre outside the box."""
    _, x, y, *widths = region
    box = f"within the box, x from {walls.left:g} to {walls.right:g} and y from {walls.bottom:g} to {walls.top:g}"
    check(walls.contains(x, y), f"{name} centre", (x, y), box)
    check(min(widths) > 0, f"{name} widths", tuple(widths), "positive")


@functools.cache  # equal tasks share a world
def _world(
    forces: tuple[tuple[float, float], ...], units: int, physics: ParticlePhysics, start: ParticleStart
) -> Particle:
    return Particle(tuple(forces[unit % len(forces)] for unit in range(units)), physics, start)
