"""A particle falls through regions of reward, and is pushed to the sides (section 6.3 of the thesis)."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from jaxtyping import Array, Bool, Float

from motorgrad._errors import check, choice
from motorgrad.tasks._particle_task import ParticleTask
from motorgrad.tasks._regions import LAYOUTS, Region, check_region, region_reward
from motorgrad.worlds import ParticleState

FLOOR = 1  # among the sides of a box


@dataclasses.dataclass(frozen=True)
class FallingParticle(ParticleTask):
    """Steer a falling particle through rewarded regions and round penalised ones.

    Observed: the position; the velocity is hidden. Actions: each unit pushes to its side or does not. Reward: the sum
    of Gaussian regions at the position at the end of the decision. An episode ends at the floor.

    **Arguments:** `units`, `forces`, `observe_velocity`, `observation_noise`, `time_limit`, `physics` and `start`, as
    of every task on a particle, and

    - `layout`: which regions: `"R1"`, `"R2"` or `"R3"`.
    - `regions`: in place of a layout, regions of five numbers each: amplitude, x and y of the centre, widths along x
      and y.
    """

    name: ClassVar[str] = "particle"
    episodic: ClassVar[bool] = True
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "tiles", "copies": 2},
        "decay": 0.95,
        "learning_rate": {"centre": 2e-4, "log_width": 8e-4},
    }

    layout: Literal["R1", "R2", "R3"] = "R1"
    regions: tuple[Region, ...] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("layout", self.layout, LAYOUTS)
        check(len(self.places) > 0, "regions", self.places, "None or at least one region")
        if self.regions is not None:
            for number, region in enumerate(self.regions):
                check_region(f"regions[{number}]", region, self.physics.walls)

    @property
    def places(self) -> tuple[Region, ...]:
        """The regions: those given, or the layout's."""
        return LAYOUTS[self.layout] if self.regions is None else self.regions

    def reward(
        self, memory: Any, state: ParticleState, action: Float[Array, " units"]
    ) -> tuple[Any, Float[Array, ""], Bool[Array, ""]]:
        return memory, region_reward(self.places, state.position), state.reached[FLOOR]
