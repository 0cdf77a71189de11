"""A particle in the plane, pushed by forces that are on or off (section 6.3 and appendix A.3 of the thesis)."""

import dataclasses
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from motorgrad._errors import check
from motorgrad._random import normals
from motorgrad.schema import Range, Settings, count, inner, static
from motorgrad.worlds._particle_forces import NOT_NEGATIVE, POSITIVE, WITHIN, CircularField, Components, Flags, Walls
from motorgrad.worlds._world import World, runge_kutta

MAX_FORCES = 10_000
SAME = (1.0, 1.0)
FACTORS = Range(0.01, 100.0)
STABLE = 2.78  # stability limit of the fourth-order Runge–Kutta method on the negative real axis
FEW = 1_024  # forces summed elementwise; beyond, a matrix product is faster
UNROLLED = 4  # integration steps that are unrolled; more run in a loop
HALVINGS = 20  # of a time step, by which the time of a collision is found to a millionth of it
COLLISIONS = 2  # in a time step whose times are found, as in a corner; after further ones the particle is put back
Motion = tuple[Components, Components]
"""Position and velocity."""
Moving = tuple[Motion, tuple[Flags, Flags]]
"""These, and the sides that were reached."""
Pair = Float[Array, " 2"]
Span = tuple[float, float]


class ParticleFactors(NamedTuple):
    """Of an episode, by what the particle's mass, gravity, drag and the forces of actions are multiplied."""

    mass: Any
    gravity: Any
    drag: Any
    force: Any


@dataclasses.dataclass(frozen=True)
class ParticlePhysics(Settings):
    r"""Everything that moves a particle except the forces of actions.

    $m\ddot x = m g - k_d \dot x + f(x) + \ldots$, integrated by the fourth-order Runge–Kutta method.

    **Raises:** `ValueError` naming the field and what it may be; also for a circular field without a stable orbit.
    """

    mass: float = static(1.0, allowed=POSITIVE, help="mass of the particle")
    gravity: tuple[float, float] = static((0.0, -0.25), allowed=WITHIN, help="acceleration of gravity, along x and y")
    drag: float = static(1.0, allowed=NOT_NEGATIVE, help="drag coefficient $k_d$, the force per speed")
    noise: float = static(
        0.0,
        allowed=NOT_NEGATIVE,
        help="standard deviation of a random force per axis, drawn at every time step; 0 for none",
    )
    timestep: float = static(0.1, allowed=POSITIVE, unit="s", help="time step of the integration")
    substeps: int = count(2, 1, 10_000, help="time steps per decision, during which the action is held")
    walls: Walls = inner(factory=Walls, help="the box (`motorgrad.worlds.Walls`)")
    field: CircularField = inner(
        factory=CircularField, help="a field of force (`motorgrad.worlds.CircularField`); by default none"
    )
    collisions: Literal["reposition", "bisection"] = static(
        "reposition",
        help='what is done with a particle that is beyond a wall after a time step. `"reposition"`: it is put on the '
        'wall; `"bisection"`: the step is taken back, the time of the collision is found by halving, and the rest of '
        "the step follows the rebound. It takes some 20 times as long",
    )

    def validate(self) -> None:
        most = STABLE * self.mass / max(self.drag, 1e-12)
        check(self.timestep < most, "timestep", self.timestep, f"below {most:.4g}, where drag is integrated stably")
        bent = self.mass * self.field.tangential**2
        if self.field.tangential:
            words = "above mass × tangential² / drag²: the orbit's radius would be unbounded"
            check(self.field.radial * self.drag**2 > bent, "field.radial", self.field.radial, words)

    @property
    def orbit_radius(self) -> float:
        """Radius of the orbit in the circular field without gravity, walls and forces: $k_2 r^* / (k_2 - m k_1^2 /
        k_d^2)$."""
        field = self.field
        check(field.radial > 0, "field.radial", field.radial, "positive, for there to be an orbit")
        bent = self.mass * (field.tangential / self.drag) ** 2 if field.tangential else 0.0
        return field.radial * field.radius / (field.radial - bent)

    @property
    def period(self) -> float:
        """Seconds for which an action is held."""
        return self.timestep * self.substeps

    def step(
        self, motion: Motion, push: Components, factors: ParticleFactors | None = None
    ) -> tuple[Motion, tuple[Flags, Flags]]:
        """One time step under a constant `push`: the new motion, and the sides that were reached. Mass, gravity
        and drag are multiplied by their `factors`, if there are any."""
        if self.collisions == "reposition":
            return self._collided(self._moved(motion, push, factors, self.timestep), push, factors)
        left: Any = jnp.asarray(self.timestep, jnp.result_type(motion[0][0]))
        no = jnp.zeros((), bool)
        reached = ((no, no), (no, no))
        for _ in range(COLLISIONS):
            before = self._until_collision(motion, push, factors, left)
            motion, sides = self._collided(self._moved(motion, push, factors, before), push, factors)
            reached = jax.tree.map(jnp.logical_or, reached, sides)
            left = left - before
        motion, sides = self._collided(self._moved(motion, push, factors, left), push, factors)
        return motion, jax.tree.map(jnp.logical_or, reached, sides)

    def _mass(self, factors: ParticleFactors | None) -> Any:
        return self.mass if factors is None else self.mass * factors.mass

    def _moved(self, motion: Motion, push: Components, factors: ParticleFactors | None, time: Any) -> Motion:
        """The motion after a `time` in s without collisions."""
        resting = self.walls.resting(*motion)
        mass = self._mass(factors)

        def rate(motion: Motion) -> Motion:
            fx, fy = self.walls.bear(self._force(motion, push, factors), motion[1], resting)
            return motion[1], (fx / mass, fy / mass)

        return runge_kutta(rate, motion, time)

    def _collided(
        self, moved: Motion, push: Components, factors: ParticleFactors | None
    ) -> tuple[Motion, tuple[Flags, Flags]]:
        """The motion after a collision, if there is any, and the sides that were reached."""
        fx, fy = self._force(moved, push, factors)
        part = self.timestep / self._mass(factors)
        position, velocity, reached = self.walls.collide(*moved, (part * fx, part * fy))
        return (position, velocity), reached

    def _until_collision(
        self, motion: Motion, push: Components, factors: ParticleFactors | None, longest: Float[Array, ""]
    ) -> Float[Array, ""]:
        """The time in s until just after the particle passes a wall, or the `longest` one."""

        def passed(time: Float[Array, ""]) -> Bool[Array, ""]:
            return self.walls.passed(self._moved(motion, push, factors, time)[0])

        def halve(_: int, span: tuple[Array, Array]) -> tuple[Array, Array]:
            low, high = span
            middle = 0.5 * (low + high)
            beyond = passed(middle)
            return jnp.where(beyond, low, middle), jnp.where(beyond, middle, high)

        _, after = jax.lax.fori_loop(0, HALVINGS, halve, (jnp.zeros_like(longest), longest))
        return jnp.where(passed(longest), after, longest)

    def _force(self, motion: Motion, push: Components, factors: ParticleFactors | None = None) -> Components:
        (x, y), (vx, vy) = motion
        if factors is None:
            fx = push[0] + self.mass * self.gravity[0] - self.drag * vx
            fy = push[1] + self.mass * self.gravity[1] - self.drag * vy
        else:
            weight = factors.mass * factors.gravity * self.mass
            drag = factors.drag * self.drag
            fx = push[0] + weight * self.gravity[0] - drag * vx
            fy = push[1] + weight * self.gravity[1] - drag * vy
        if not self.field.acts:
            return fx, fy
        field = self.field.force(x, y)
        return fx + field[0], fy + field[1]


class ParticleState(NamedTuple):
    """Position and velocity of a particle, which sides of the box it `reached` in the last step of the world: left,
    bottom, right, top; and the `factors` of the episode's physics, `None` where these are the same in all."""

    position: Pair
    velocity: Pair
    reached: Bool[Array, " 4"]
    factors: ParticleFactors | None = None


@dataclasses.dataclass(frozen=True)
class ParticleStart(Settings):
    """The initial state of an episode: every number is drawn independently from U[low, high], and fixed where both are
    equal. The factors multiply what the physics says for the whole episode, so that a learner meets worlds from a
    distribution."""

    x: Span = static((0.0, 1.0), allowed=WITHIN, help="low and high of the position from left to right")
    y: Span = static((0.9, 1.0), allowed=WITHIN, help="low and high of the position upwards")
    velocity_x: Span = static((0.0, 0.0), allowed=WITHIN, help="low and high of the speed to the right, per second")
    velocity_y: Span = static((0.0, 0.0), allowed=WITHIN, help="low and high of the speed upwards, per second")
    mass: Span = static(SAME, allowed=FACTORS, help="low and high of a factor of the mass")
    gravity: Span = static(SAME, allowed=FACTORS, help="low and high of a factor of gravity")
    drag: Span = static(SAME, allowed=FACTORS, help="low and high of a factor of the drag")
    force: Span = static(SAME, allowed=FACTORS, help="low and high of a factor of the forces of actions")

    def validate(self) -> None:
        for name, (low, high) in self._spans().items():
            check(low <= high, name, (low, high), "low <= high")

    @property
    def uniforms(self) -> int:
        """How many of the numbers are random."""
        return sum(low < high for low, high in self._spans().values())

    def draw(self, uniforms: Float[Array, " uniforms"]) -> ParticleState:
        """Draw an initial state."""
        numbers = iter(uniforms)
        drawn = [
            low + (high - low) * next(numbers) if low < high else jnp.asarray(low, uniforms.dtype)
            for low, high in self._spans().values()
        ]
        factors = None if self.factors_of_one else ParticleFactors(*drawn[4:])
        return ParticleState(jnp.stack(drawn[:2]), jnp.stack(drawn[2:4]), jnp.zeros(4, bool), factors)

    @property
    def factors_of_one(self) -> bool:
        """Whether the physics are the same in all episodes."""
        return all(getattr(self, name) == SAME for name in ParticleFactors._fields)

    def _spans(self) -> dict[str, Span]:
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}


@dataclasses.dataclass(frozen=True)
class Particle(Settings, World):
    """A particle, and the forces that actions switch on.

    **Raises:** `ValueError` naming the invalid number; also for a start beyond a wall.
    """

    forces: tuple[tuple[float, float], ...] = static(
        allowed=WITHIN, help="x and y of one per action. Actions multiply them, so they may be continuous too"
    )
    physics: ParticlePhysics = inner(
        factory=ParticlePhysics, help="everything else that moves the particle (`motorgrad.worlds.ParticlePhysics`)"
    )
    start: ParticleStart = inner(
        factory=ParticleStart, help="the initial state of an episode (`motorgrad.worlds.ParticleStart`)"
    )

    def validate(self) -> None:
        check(1 <= len(self.forces) <= MAX_FORCES, "number of forces", len(self.forces), f"from 1 to {MAX_FORCES}")
        walls, start = self.physics.walls, self.start
        for name, (low, high), ends in (
            ("start.x", start.x, (walls.left, walls.right)),
            ("start.y", start.y, (walls.bottom, walls.top)),
        ):
            check(ends[0] <= low and high <= ends[1], name, (low, high), f"within the box, {ends[0]:g} … {ends[1]:g}")
        if not start.factors_of_one:  # the physics must be possible at both ends of what is drawn
            for mass, drag in zip(start.mass, reversed(start.drag), strict=True):
                dataclasses.replace(self.physics, mass=mass * self.physics.mass, drag=drag * self.physics.drag)

    @property
    def uniforms(self) -> int:  # type: ignore[override]  # pyright: ignore[reportIncompatibleVariableOverride]
        """How many random numbers a step takes: two for the noise of each time step."""
        return 2 * self.physics.substeps if self.physics.noise else 0

    @property
    def reset_uniforms(self) -> int:  # type: ignore[override]  # pyright: ignore[reportIncompatibleVariableOverride]
        """How many random numbers a start takes."""
        return self.start.uniforms

    def reset(self, uniforms: Float[Array, " reset_uniforms"]) -> ParticleState:
        return self.start.draw(uniforms)

    def step(
        self, state: ParticleState, action: Float[Array, " forces"], uniforms: Float[Array, " uniforms"]
    ) -> ParticleState:
        physics = self.physics
        forces = jnp.asarray(self.forces, jnp.promote_types(action.dtype, jnp.float32))
        if len(self.forces) > FEW:
            push = tuple(forces.T @ action)
        else:
            push = jnp.sum(action * forces[:, 0]), jnp.sum(action * forces[:, 1])
        if state.factors is not None:
            push = (state.factors.force * push[0], state.factors.force * push[1])
        gusts = physics.noise * normals(uniforms).reshape(-1, 2) if physics.noise else None

        def integrate(carry: Moving, gust: Float[Array, " 2"] | None) -> tuple[Moving, None]:
            motion, before = carry
            pushed = push if gust is None else (push[0] + gust[0], push[1] + gust[1])
            motion, reached = physics.step(motion, pushed, state.factors)
            return (motion, jax.tree.map(jnp.logical_or, before, reached)), None

        no = jnp.zeros((), bool)
        start = ((tuple(state.position), tuple(state.velocity)), ((no, no), (no, no)))
        steps = physics.substeps
        (motion, reached), _ = jax.lax.scan(
            integrate, start, gusts, length=steps, unroll=steps if steps <= UNROLLED else 1
        )
        (left, right), (bottom, top) = reached
        sides = jnp.stack([left, bottom, right, top])
        return ParticleState(jnp.stack(motion[0]), jnp.stack(motion[1]), sides, state.factors)
