"""A particle goes round and round, and is pushed outwards or inwards (section 6.4.4 of the thesis)."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from jaxtyping import Array, Float

from motorgrad._errors import choice
from motorgrad.tasks._particle_task import ParticleTask, around
from motorgrad.tasks._task import Reading
from motorgrad.worlds import CircularField, ParticlePhysics, ParticleStart, ParticleState


@dataclasses.dataclass(frozen=True)
class ParticleOrbit(ParticleTask):
    """Widen or narrow the orbit of a particle in a circular field of force, without episodes.

    Observed: the position; the velocity is hidden. Actions: each unit pushes in its direction or does not. Reward: the
    distance from the field's centre, or minus that.

    **Arguments:** `units`, `forces`, `observe_velocity`, `observation_noise`, `time_limit`, `physics` and `start`, as
    of every task on a particle, and

    - `wanted`: `"wide"` rewards the radius, `"narrow"` penalises it.
    """

    name: ClassVar[str] = "particle-orbit"
    reports: ClassVar[tuple[str, ...]] = ("radius",)
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
    wanted: Literal["wide", "narrow"] = "wide"

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("wanted", self.wanted, ("wide", "narrow"))

    def reward(
        self, memory: Any, state: ParticleState, action: Float[Array, " units"]
    ) -> tuple[Any, Float[Array, ""], bool]:
        radius = self.physics.field.distance(*state.position)
        return memory, radius if self.wanted == "wide" else -radius, False

    def readings(self, memory: Any, state: ParticleState) -> dict[str, Reading]:
        """`radius`: the distance from the field's centre."""
        return {"radius": (self.physics.field.distance(*state.position), True)}
