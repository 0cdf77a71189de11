"""A particle finds its way to a goal past obstacles: a flow field is learnt (section 6.5.4 of the thesis)."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from motorgrad._errors import check
from motorgrad.tasks._particle_task import ParticleTask, around
from motorgrad.tasks._regions import Region, check_region, region_reward, squared_distance
from motorgrad.tasks._task import Reading
from motorgrad.worlds import ParticlePhysics, ParticleStart, ParticleState


@dataclasses.dataclass(frozen=True)
class ParticleNavigation(ParticleTask):
    """Reach the goal, soon, and keep away from the obstacles.

    Observed: the position; the velocity is hidden. Actions: each unit pushes in its direction or does not. Reward: the
    sum of the obstacles' Gaussian regions at the position at the end of each decision, and once, where the particle
    comes within one width of the goal's centre, the goal's amplitude. The episode ends there; the time limit cuts it.

    **Arguments:** `units`, `forces`, `observe_velocity`, `observation_noise`, `time_limit`, `physics` and `start`, as
    of every task on a particle, and

    - `goal`: a region of five numbers: amplitude, x and y of the centre, widths along x and y.
    - `obstacles`: regions of that form; their amplitudes negative.
    """

    name: ClassVar[str] = "particle-navigation"
    episodic: ClassVar[bool] = True
    reports: ClassVar[tuple[str, ...]] = ("arrival", "cost")
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "tiles", "copies": 4, "p_max": 0.5},
        "decay": 0.95,
        "learning_rate": {"centre": 2e-4, "log_width": 8e-4},
    }

    units: int = 64
    forces: tuple[tuple[float, float], ...] = around(0.4, 4)
    time_limit: int = 200  # TOML has no word for none: 0 is never
    physics: ParticlePhysics = dataclasses.field(default_factory=lambda: ParticlePhysics(gravity=(0.0, 0.0)))
    start: ParticleStart = dataclasses.field(default_factory=lambda: ParticleStart(x=(0.0, 0.2), y=(0.0, 1.0)))
    goal: Region = (10.0, 0.9, 0.5, 0.08, 0.08)
    obstacles: tuple[Region, ...] = ((-2.0, 0.5, 0.5, 0.1, 0.15),)

    def __post_init__(self) -> None:
        super().__post_init__()
        walls = self.physics.walls
        check_region("goal", self.goal, walls)
        check(self.goal[0] > 0, "goal amplitude", self.goal[0], "positive")
        for number, region in enumerate(self.obstacles):
            check_region(f"obstacles[{number}]", region, walls)
            check(region[0] < 0, f"obstacles[{number}] amplitude", region[0], "negative")

    def arrived(self, position: Float[Array, " 2"]) -> Bool[Array, ""]:
        """Whether the particle is within one width of the goal."""
        return squared_distance(jnp.asarray(self.goal, position.dtype)[None], position)[0] <= 1.0

    def init(self, uniforms: Float[Array, " 0"]) -> Int[Array, ""]:
        """Decisions since the episode began."""
        return jnp.zeros((), jnp.int32)

    def reward(
        self, memory: Int[Array, ""], state: ParticleState, action: Float[Array, " units"]
    ) -> tuple[Int[Array, ""], Float[Array, ""], Bool[Array, ""]]:
        arrived = self.arrived(state.position)
        paid = region_reward(self.obstacles, state.position) + jnp.where(arrived, self.goal[0], 0.0)
        return memory + 1, paid, arrived

    def readings(self, memory: Int[Array, ""], state: ParticleState) -> dict[str, Reading]:
        """`arrival`: decisions until the goal was reached, where it was. `cost`: what the obstacles took."""
        return {
            "arrival": (memory.astype(state.position.dtype), self.arrived(state.position)),
            "cost": (-region_reward(self.obstacles, state.position), True),
        }
