"""A particle in the plane, pushed by forces that are on or off (section 6.3 and appendix A.3 of the thesis)."""

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from motorgrad._errors import check
from motorgrad._random import normals
from motorgrad.worlds._particle_physics import ParticlePhysics
from motorgrad.worlds._world import World

MOST = 10_000  # forces
FEW = 1_024  # forces that are added one after the other; beyond, a product of matrices is faster
UNROLLED = 4  # steps of integration that are compiled one after the other; more run in a loop

Pair = Float[Array, " 2"]
Span = tuple[float, float]


class ParticleState(NamedTuple):
    """Where a particle is and how it moves; and which sides of the box it reached in the last step of the world: left,
    bottom, right, top."""

    position: Pair
    velocity: Pair
    reached: Bool[Array, " 4"]


@dataclasses.dataclass(frozen=True)
class ParticleStart:
    """Where an episode begins: every number is drawn by itself from U[low, high].

    **Arguments:** low and high of each; both the same for a number that is fixed.

    - `x`: where it begins, from left to right.
    - `y`: where it begins, from below upwards.
    - `velocity_x`: speed to the right, per second.
    - `velocity_y`: speed upwards, per second.
    """

    x: Span = (0.0, 1.0)
    y: Span = (0.9, 1.0)
    velocity_x: Span = (0.0, 0.0)
    velocity_y: Span = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name, (low, high) in self._spans().items():
            check(-1e6 < low <= high < 1e6, name, (low, high), "low <= high, within 1e6")

    @property
    def uniforms(self) -> int:
        """How many of the numbers are random."""
        return sum(low < high for low, high in self._spans().values())

    def draw(self, uniforms: Float[Array, " uniforms"]) -> ParticleState:
        """The state in which an episode begins."""
        numbers = iter(uniforms)
        drawn = [
            low + (high - low) * next(numbers) if low < high else jnp.asarray(low, uniforms.dtype)
            for low, high in self._spans().values()
        ]
        return ParticleState(jnp.stack(drawn[:2]), jnp.stack(drawn[2:]), jnp.zeros(4, bool))

    def _spans(self) -> dict[str, Span]:
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}


@dataclasses.dataclass(frozen=True)
class Particle(World):
    """A particle, and the forces that actions switch on.

    **Arguments:**

    - `forces` (x, y): one for each action. Actions multiply them, so they may be graded too.
    - `physics`: what else moves the particle (`motorgrad.worlds.ParticlePhysics`).
    - `start`: where an episode begins (`motorgrad.worlds.ParticleStart`).

    **Raises:** `ValueError` naming what is wrong; for a start beyond a wall.
    """

    forces: tuple[tuple[float, float], ...]
    physics: ParticlePhysics = dataclasses.field(default_factory=ParticlePhysics)
    start: ParticleStart = dataclasses.field(default_factory=ParticleStart)

    def __post_init__(self) -> None:
        check(1 <= len(self.forces) <= MOST, "number of forces", len(self.forces), f"from 1 to {MOST}")
        pairs = np.asarray(self.forces, float)
        shaped = pairs.shape == (len(self.forces), 2) and np.abs(pairs).max() < 1e6
        check(shaped, "forces", self.forces, "pairs of numbers between -1e6 and 1e6")
        walls, start = self.physics.walls, self.start
        for name, (low, high), ends in (
            ("start.x", start.x, (walls.left, walls.right)),
            ("start.y", start.y, (walls.bottom, walls.top)),
        ):
            check(ends[0] <= low and high <= ends[1], name, (low, high), f"within the box, {ends[0]:g} … {ends[1]:g}")

    @property
    def uniforms(self) -> int:  # type: ignore[override]  # pyright: ignore[reportIncompatibleVariableOverride]
        """Two for the noise of each time step."""
        return 2 * self.physics.substeps if self.physics.noise else 0

    @property
    def reset_uniforms(self) -> int:  # type: ignore[override]  # pyright: ignore[reportIncompatibleVariableOverride]
        """One for each random number of the start."""
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
        gusts = physics.noise * normals(uniforms).reshape(-1, 2) if physics.noise else None

        def integrate(carry: Any, gust: Float[Array, " 2"] | None) -> tuple[Any, None]:
            motion, before = carry
            pushed = push if gust is None else (push[0] + gust[0], push[1] + gust[1])
            motion, reached = physics.step(motion, pushed)
            return (motion, jax.tree.map(jnp.logical_or, before, reached)), None

        no = jnp.zeros((), bool)
        start = ((tuple(state.position), tuple(state.velocity)), ((no, no), (no, no)))
        steps = physics.substeps
        (motion, reached), _ = jax.lax.scan(
            integrate, start, gusts, length=steps, unroll=steps if steps <= UNROLLED else 1
        )
        (left, right), (bottom, top) = reached
        return ParticleState(jnp.stack(motion[0]), jnp.stack(motion[1]), jnp.stack([left, bottom, right, top]))
