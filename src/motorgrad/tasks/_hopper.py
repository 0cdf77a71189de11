"""The hopper's task: jump high, with as few muscles as that takes (section 5.2 of the thesis)."""

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from motorgrad._errors import check, choice
from motorgrad.bodies import BodyState
from motorgrad.bodies import Hopper as HopperBody
from motorgrad.tasks._task import Reading
from motorgrad.tasks._timed_body_task import TimedBodyTask

MOST = 10_000  # units
FASTEST = 50.0  # rad/s


class Flight(NamedTuple):
    """What the hopper's task remembers: the flight's greatest foot height so far, its first apex (0 before it), and the
    greatest height of a flight that has just ended (else 0)."""

    height: Float[Array, ""]
    first: Float[Array, ""]
    landed: Float[Array, ""]


@dataclasses.dataclass(frozen=True)
class Hopper(TimedBodyTask):
    """Hop as high as possible.

    Observed: foot contact (±1), knee angle about `centre` in rad, knee velocity × `velocity_scale` (rad/s).
    Actions: the flexor pair, the extensor pair, or units that drive these. Reward: `reward_scale` × the height (m) of a
    hop, a flight above `hop_height`, minus `penalty` for each active muscle at each decision.

    **Arguments:**

    - `body`: the hopper (`motorgrad.bodies.Hopper`): masses, lengths, muscles, `lateral` constraint, `muscle_model`.
    - `paid`: `"landing"` pays the flight's greatest foot height when it is over; `"apex"` pays its first apex when that
      is reached, which is sooner after the push and learnt sooner, but may pay less than the flight was worth.
    - `reward_scale`: reward per metre.
    - `penalty`: cost of a muscle that is active for one decision.
    - `hop_height`: in metres; a lower flight does not count.
    - `observe_contact`: whether foot contact is observed beside the knee.
    - `centre`: the interior knee angle, in degrees, that is observed as 0; 0 gives the raw angle.
    - `velocity_scale`: brings the knee's velocity into the range of the other inputs.
    - `action_period`: simulated seconds from one decision to the next, a multiple of the body's time step.
    - `time_limit`: simulated seconds after which an episode is cut; `None` for a continuing task.
    - `units`: actions, dealt out in turn over the groups of muscles: the first drives the flexors, the second the
      extensors, the third the flexors again. A group is active while any of its units fires. By default one for each.
    """

    name: ClassVar[str] = "hopper"
    reports: ClassVar[tuple[str, ...]] = ("apex",)
    # The thesis's decay of 0.98 forgets two thirds of a push within half a second, about the flight that `"landing"`
    # waits for; 0.995 remembers it, and learns almost three times as fast (docs/tasks/hopper.md has both measured).
    learner: ClassVar[Mapping[str, Any]] = {"policy": "hyperplanes", "decay": 0.995, "learning_rate": 5e-4}

    body: HopperBody = dataclasses.field(default_factory=HopperBody)
    paid: Literal["landing", "apex"] = "landing"
    reward_scale: float = 100.0
    penalty: float = 0.1
    hop_height: float = 0.03
    observe_contact: bool = True
    centre: float = 90.0
    velocity_scale: float = 0.02
    action_period: float = 0.01
    time_limit: float | None = None
    units: int | None = None

    def __post_init__(self) -> None:
        choice("paid", self.paid, ("landing", "apex"))
        for name in ("reward_scale", "velocity_scale"):
            check(math.isfinite(getattr(self, name)), name, getattr(self, name), "a finite number")
        check(0 < self.hop_height < math.inf, "hop_height", self.hop_height, "a positive height in m")
        check(0 <= self.centre <= 180, "centre", self.centre, "an angle in 0 … 180 degrees")
        check(0 <= self.penalty < math.inf, "penalty", self.penalty, "a finite number of at least 0")
        self.check_times()
        groups = len(self.body.groups)
        enough = self.units is None or (isinstance(self.units, int) and groups <= self.units <= MOST)
        check(enough, "units", self.units, f"None, or from one for each of the {groups} groups of muscles to {MOST:,}")

    @property
    def dynamics(self) -> HopperBody:
        return self.body

    @property
    def observation_size(self) -> int:
        return 3 if self.observe_contact else 2

    @property
    def observation_names(self) -> tuple[str, ...]:
        knee = ("knee angle", "knee velocity")
        return ("foot contact", *knee) if self.observe_contact else knee

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...]:
        """Of the velocity the range that learnt hops have: some 50 rad/s to either side."""
        low, high = (float(np.deg2rad(angle - self.centre)) for angle in self.body.knee_range)
        fast = max(FASTEST * abs(self.velocity_scale), 1e-6)
        knee = (low, high), (-fast, fast)
        return ((-1.0, 1.0), *knee) if self.observe_contact else knee

    @property
    def drives(self) -> np.ndarray | None:
        return None if self.units is None else self._drives

    @functools.cached_property
    def _drives(self) -> np.ndarray:
        groups = len(self.body.groups)
        return np.eye(groups, dtype=np.float32)[np.arange(self.units or groups) % groups]

    @functools.cached_property
    def _muscles_per_group(self) -> np.ndarray:
        groups = [muscle.group for muscle in self.body.muscles]
        return np.array([groups.count(group) for group in self.body.groups], np.float32)

    def init(self, uniforms: Float[Array, " 0"]) -> Flight:
        return Flight(*(jnp.zeros(()),) * 3)

    def observe(
        self, memory: Flight, state: BodyState, uniforms: Float[Array, " 0"]
    ) -> tuple[Flight, Float[Array, " inputs"]]:
        contact = jnp.where(state.sensors["foot_contact"] > 0, 1.0, -1.0)
        angle = state.sensors["knee_angle"] + np.deg2rad(90.0 - self.centre)
        knee = [angle, self.velocity_scale * state.sensors["knee_velocity"]]
        return memory, jnp.stack([contact, *knee] if self.observe_contact else knee)

    def reward(
        self, memory: Flight, state: BodyState, action: Float[Array, " units"]
    ) -> tuple[Flight, Float[Array, ""], Bool[Array, ""] | bool]:
        now = state.sensors["foot_height"]
        down = state.sensors["foot_contact"] > 0
        height = jnp.maximum(memory.height, now)
        landed = jnp.where(down & (height > self.hop_height), height, 0.0)
        # The first apex is over once the foot is below where it has been, for the first time in this flight.
        over = ~down & (now < memory.height) & (memory.height > self.hop_height) & (memory.first == 0)
        paid = landed if self.paid == "landing" else jnp.where(over, memory.height, 0.0)
        first = jnp.where(down, 0.0, jnp.where(over, memory.height, memory.first))
        cost = self.penalty * jnp.sum(self.control(action, memory) * self._muscles_per_group)
        return Flight(jnp.where(down, 0.0, height), first, landed), self.reward_scale * paid - cost, False

    def readings(self, memory: Flight, state: BodyState) -> dict[str, Reading]:
        """`apex`: the greatest foot height (m) of the flight that has just ended in a landing."""
        return {"apex": (memory.landed, memory.landed > 0)}
