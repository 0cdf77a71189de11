"""The falling particle, seen through powers of its position: for global policies with curved boundaries."""

import dataclasses
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad.tasks import FallingParticle
from motorgrad.worlds import ParticleState


@dataclasses.dataclass(frozen=True)
class Powers(FallingParticle):
    """The falling particle whose position is observed as $u, v, u^2, uv, v^2$, with $u = 2x - 1$ and $v = 2y - 1$.

    A hyperplane in these is a conic in the plane: a line, a circle, or a hyperbola. Everything else is as in
    `FallingParticle`.
    """

    name: ClassVar[str] = "particle-powers"

    @property
    def observation_size(self) -> int:
        return 5

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...]:
        return ((-1.0, 1.0),) * 2 + ((0.0, 1.0), (-1.0, 1.0), (0.0, 1.0))

    def observe(
        self, memory: Any, state: ParticleState, uniforms: Float[Array, " uniforms"]
    ) -> tuple[Any, Float[Array, " observation_size"]]:
        memory, seen = FallingParticle.observe(self, memory, state, uniforms)
        u, v = 2 * seen[0] - 1, 2 * seen[1] - 1
        return memory, jnp.stack([u, v, u * u, u * v, v * v])
