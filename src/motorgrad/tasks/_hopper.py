"""The hopper's task: jump high with as few muscles as possible (section 5.2 of the thesis)."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from motorgrad._arrays import AnyArray
from motorgrad._errors import check
from motorgrad.bodies import BodyBatch, BodyState, PushBatch, actuators_of
from motorgrad.bodies import Hopper as HopperBody
from motorgrad.schema import count, inner, number, static
from motorgrad.tasks._host_task import BodyTask
from motorgrad.tasks._task import Flag, Metric, Scalar

MAX_KNEE_VELOCITY = 50.0  # rad/s, for the observation range


class HopperMemory(NamedTuple):
    """The memory of the hopper's task: the greatest foot `height` of the current flight, its `first` apex (0 before
    it), and the greatest height of a flight that has just `landed` (else 0); the present `gust` (N), 0 on the ground,
    `None` in a task without any."""

    height: Scalar
    first: Scalar
    landed: Scalar
    gust: Scalar | None = None


@dataclasses.dataclass(frozen=True)
class Hopper(BodyTask):
    """Hop as high as possible.

    Observed: foot contact (±1), knee angle relative to `centre` in rad, knee velocity × `velocity_scale` (rad/s), and
    `noise_inputs` random numbers. Actions: the flexor pair and the extensor pair, or units that drive these. Reward:
    `reward_scale` × the height (m) of a hop, a flight above `hop_height`, minus `penalty` for each active muscle per
    decision. In every flight, a sideways force of up to `gust` may push the foot of a body that can lean.
    """

    name: ClassVar[str] = "hopper"
    metric_names: ClassVar[tuple[str, ...]] = ("apex",)
    metric_units: ClassVar[Mapping[str, str]] = {"apex": "m"}
    # With the thesis's decay of 0.98, two thirds of a push are forgotten within half a second, about the duration of a
    # flight rewarded at landing. With 0.995 learning is almost three times as fast (measured in docs/tasks/hopper.md).
    learner: ClassVar[Mapping[str, Any]] = {"policy": "hyperplanes", "decay": 0.995, "learning_rate": 5e-4}

    body: HopperBody = inner(
        factory=HopperBody,
        help="the hopper (`motorgrad.bodies.Hopper`): masses, lengths, muscles, `lateral` constraint, `muscle_model`",
    )
    reward_type: Literal["landing", "apex"] = static(
        "landing",
        help='`"landing"` rewards the greatest foot height of a flight when it ends; `"apex"` rewards the '
        "flight's first apex when it is reached, which is sooner after the push and learned sooner, "
        "but may be less than the flight was worth",
    )
    reward_scale: float = number(100.0, help="reward per metre of hopping height")
    penalty: float = number(0.1, 0, help="cost of an active muscle per decision")
    hop_height: float = number(0.03, 0, open_low=True, unit="m", help="the least height of a flight that counts")
    observe_contact: bool = static(True, help="whether to observe foot contact in addition to the knee")
    centre: float = number(
        90.0, 0, 180, unit="degrees", help="the interior knee angle that is observed as 0; 0 gives the raw angle"
    )
    velocity_scale: float = number(0.02, help="scales the knee's velocity to the range of the other inputs")
    noise_inputs: int = count(
        0,
        0,
        1000,
        help="number of further inputs that tell nothing: independent random numbers from −1 to 1 at every decision",
    )
    gust: float = number(
        0.0,
        0,
        1e4,
        unit="N",
        help="greatest sideways force on the foot while it is in the air, drawn anew for every flight, to either side; "
        "for a body that can lean",
    )
    action_period: float = 0.01
    time_limit: float | None = None
    units: int | None = count(
        None,
        1,
        10_000,
        help="number of actions, assigned in turn to the groups of muscles: the first drives the flexors, the "
        "second the extensors, the third the flexors again. A group is active while any of its units "
        "fires. By default one per group",
    )

    def validate(self) -> None:
        super().validate()
        groups = len(self.body.groups)
        enough = self.units is None or self.units >= groups
        check(enough, "units", self.units, f"None, or at least one for each of the {groups} groups of muscles")
        leans = self.body.lateral == "spring"
        check(leans or not self.gust, "gust", self.gust, "0 for a body that cannot lean: it has no lateral spring")

    def batch(self, seeds: Sequence[int], threads: int = 0) -> BodyBatch:
        if not self.gust:
            return super().batch(seeds, threads)
        self.check_times()
        return PushBatch(self.body, len(seeds), self.substeps, threads, part="foot")

    @property
    def uniforms(self) -> int:  # type: ignore[override]  # pyright: ignore[reportIncompatibleVariableOverride]
        """One for each input of noise, then one for gusts, if any."""
        return self.noise_inputs + (1 if self.gust else 0)

    @property
    def observation_size(self) -> int:
        return (3 if self.observe_contact else 2) + self.noise_inputs

    @property
    def observation_names(self) -> tuple[str, ...]:
        noise = (f"noise {number + 1}" for number in range(self.noise_inputs))
        return (*(("foot contact",) if self.observe_contact else ()), "knee angle", "knee velocity", *noise)

    @property
    def observation_units(self) -> tuple[str, ...]:
        knee = ("rad", "rad/s" if self.velocity_scale == 1 else "")
        return (*(("1",) if self.observe_contact else ()), *knee, *("1",) * self.noise_inputs)

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...]:
        """For the velocity, the range of learned hops, about ±50 rad/s."""
        low, high = (float(np.deg2rad(angle - self.centre)) for angle in self.body.knee_range)
        fast = max(MAX_KNEE_VELOCITY * abs(self.velocity_scale), 1e-6)
        contact = ((-1.0, 1.0),) if self.observe_contact else ()
        return (*contact, (low, high), (-fast, fast), *((-1.0, 1.0),) * self.noise_inputs)

    @functools.cached_property
    def drives(self) -> np.ndarray | None:
        groups = len(self.body.groups)
        return None if self.units is None else np.eye(groups, dtype=np.float32)[np.arange(self.units) % groups]

    @functools.cached_property
    def group_sizes(self) -> np.ndarray:
        """Number of actuators in each group, `(groups,)`."""
        groups = [each.group for each in actuators_of(self.body)]
        return np.array([groups.count(group) for group in self.body.groups], np.float32)

    def control(self, action: Float[AnyArray, "... action_size"], memory: PyTree = None) -> Float[AnyArray, "... size"]:
        """The activation of each group of muscles, then the gust, if any."""
        muscles = super().control(action)
        if not self.gust:
            return muscles
        return jnp.concatenate([jnp.asarray(muscles), jnp.asarray(memory.gust)[..., None]], axis=-1)

    def init(self, uniforms: Float[Array, " 0"]) -> HopperMemory:
        return HopperMemory(*(jnp.zeros(()),) * 3, gust=jnp.zeros(()) if self.gust else None)

    def observe(
        self, memory: HopperMemory, state: BodyState, uniforms: Float[Array, " uniforms"]
    ) -> tuple[HopperMemory, Float[Array, " inputs"]]:
        down = state.sensors["foot_contact"] > 0
        if self.gust:
            assert memory.gust is not None
            drawn = self.gust * (2.0 * uniforms[-1] - 1.0)
            # 0 in the air means that the flight has just begun
            lasting = jnp.where(memory.gust == 0, drawn, memory.gust)
            memory = memory._replace(gust=jnp.where(down, 0.0, lasting))
        contact = jnp.where(down, 1.0, -1.0)
        angle = state.sensors["knee_angle"] + np.deg2rad(90.0 - self.centre)
        knee = [angle, self.velocity_scale * state.sensors["knee_velocity"]]
        sensed = jnp.stack([contact, *knee] if self.observe_contact else knee)
        noise = 2.0 * uniforms[: self.noise_inputs] - 1.0
        return memory, jnp.concatenate([sensed, noise]) if self.noise_inputs else sensed

    def reward(
        self, memory: HopperMemory, state: BodyState, action: Float[Array, " units"]
    ) -> tuple[HopperMemory, Scalar, Flag]:
        now = state.sensors["foot_height"]
        down = state.sensors["foot_contact"] > 0
        height = jnp.maximum(memory.height, now)
        landed = jnp.where(down & (height > self.hop_height), height, 0.0)
        # The first apex has passed when the foot is below its greatest height for the first time in this flight.
        over = ~down & (now < memory.height) & (memory.height > self.hop_height) & (memory.first == 0)
        reward = landed if self.reward_type == "landing" else jnp.where(over, memory.height, 0.0)
        first = jnp.where(down, 0.0, jnp.where(over, memory.height, memory.first))
        cost = self.penalty * jnp.sum(super().control(action) * self.group_sizes)
        after = memory._replace(height=jnp.where(down, 0.0, height), first=first, landed=landed)
        return after, self.reward_scale * reward - cost, False

    def metrics(self, memory: HopperMemory, state: BodyState) -> dict[str, Metric]:
        """`apex`: the greatest foot height (m) of a flight that has just ended."""
        return {"apex": (memory.landed, memory.landed > 0)}
