"""The hexapod walks by a clock, up and down slopes: the period of the stride is learned (section 5.4.1 of the
thesis)."""

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._arrays import AnyArray
from motorgrad._errors import check
from motorgrad.bodies import BodyState, SlopeBatch, TripodClock, read_hexapod
from motorgrad.schema import Range, inner, number, static
from motorgrad.tasks._task import Actions, Flag, Metric, Scalar
from motorgrad.tasks.hexapod._synergies import synergy_matrix
from motorgrad.tasks.hexapod._walking import TRIPOD_SYNERGIES, WalkingTask, overturned


class StrideMemory(NamedTuple):
    """The memory: the clock's `phase` and the last chosen `period` (s); the ground's `slope` (rad) and for how many
    decisions it is `left`; the last measured `heading` (rad) and smoothed `pitch` (rad)."""

    phase: Scalar
    period: Scalar
    slope: Scalar
    left: Int[Array, ""]
    heading: Scalar
    pitch: Scalar


@dataclasses.dataclass(frozen=True)
class HexapodStride(WalkingTask):
    """Walk as fast as possible by an open-loop clock whose period is the action, over rising and falling ground.

    Observed: the smoothed pitch of the trunk against gravity, divided by `pitch_scale`. Action: a real number a, which
    sets the clock's frequency to (1 + a) / `start`, within the limits of the period. The clock runs at this rate until
    the next decision, so no action is ignored, and a stride's frequency is the mean of those chosen during it. Reward:
    `reward_scale` × the velocity (m/s) of the middle section along its heading. An episode ends when the trunk
    overturns.

    The ground is a plane that rises or falls in the direction of the body's heading, with a new slope for every
    stretch.
    """

    name: ClassVar[str] = "hexapod-stride"
    actions: ClassVar[Actions] = "continuous"
    clips_actions: ClassVar[bool] = True
    metric_names: ClassVar[tuple[str, ...]] = ("speed", "period", "falls")
    metric_units: ClassVar[Mapping[str, str]] = {**WalkingTask.metric_units, "period": "s"}
    uniforms: ClassVar[int] = 1
    init_uniforms: ClassVar[int] = 1
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "graded-hyperplanes", "deviation": 0.8},
        "decay": 0.98,
        "baseline": {"kind": "linear", "rate": 1e-3},
        "learning_rate": {"weights": 3e-5, "bias": 3e-5, "log_deviation": 0.0},
    }

    clock: TripodClock = inner(
        factory=TripodClock, help="converts the phase of a stride to swing and stance (`motorgrad.bodies.TripodClock`)"
    )
    slopes: tuple[float, ...] = static(
        (-10.0, -5.0, 0.0, 5.0, 10.0),
        allowed=Range(-45, 45),
        unit="degrees",
        help="from which each stretch draws one at random, positive uphill",
    )
    stretch: float = number(4.0, unit="s", help="duration of a slope")
    start: float = number(0.3, unit="s", help="the period for the action 0")
    shortest: float = number(0.08, 0, open_low=True, unit="s", help="the least period")
    longest: float = number(0.8, 0, open_low=True, unit="s", help="the greatest period")
    pitch_scale: float = number(10.0, 0.01, 90, unit="degrees", help="the pitch that is observed as 1")
    smoothing: float = number(0.05, 0, 1, open_low=True, help="the weight of the newest pitch in the smoothed one")
    reward_scale: float = number(4.0, help="reward per m/s of velocity")
    action_period: float = 0.01
    time_limit: float | None = None

    def validate(self) -> None:
        super().validate()
        check(self.slopes, "slopes", self.slopes, "at least one")
        least = 2 * self.action_period
        check(least <= self.shortest, "shortest", self.shortest, f"at least two decisions, {least:g} s")
        self.check_limits(self.shortest, self.longest, start=self.start)
        decisions = self.stretch / self.action_period
        check(1 <= decisions < 2**31, "stretch", self.stretch, "at least one decision, and finite")

    def batch(self, seeds: Sequence[int], threads: int = 0) -> SlopeBatch:
        return SlopeBatch(self.body, len(seeds), self.substeps, threads)

    @functools.cached_property
    def drives(self) -> np.ndarray:
        return synergy_matrix(TRIPOD_SYNERGIES, self.body.groups)

    @property
    def observation_size(self) -> int:
        return 1

    @property
    def observation_names(self) -> tuple[str, ...]:
        return ("pitch",)

    @property
    def observation_units(self) -> tuple[str, ...]:
        return ("1",) * self.observation_size

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...]:
        return ((min(self.slopes) / self.pitch_scale - 0.5, max(self.slopes) / self.pitch_scale + 0.5),)

    @property
    def action_size(self) -> int:
        return 1

    @property
    def action_range(self) -> tuple[tuple[float, float], ...]:
        """From the greatest period to the least."""
        return ((self.start / self.longest - 1, self.start / self.shortest - 1),)

    def period_of(self, action: Float[AnyArray, "... 1"]) -> Float[Array, "..."]:
        """The period in s for an action (..., 1), (...)."""
        return self.start / jnp.clip(1.0 + action[..., 0], self.start / self.longest, self.start / self.shortest)

    def control(self, action: Float[AnyArray, "... 1"], memory: PyTree = None) -> Float[AnyArray, "... controls"]:
        """The activation of each muscle, then the slope and the direction in which the ground rises."""
        muscles = super().control(self.clock.activation(jnp.asarray(memory.phase)), memory)
        return jnp.concatenate([muscles, jnp.stack([memory.slope, memory.heading], axis=-1)], axis=-1)

    def init(self, uniforms: Float[Array, " 1"]) -> StrideMemory:
        """The clock starts at a random phase, on level ground."""
        zero = jnp.zeros(())
        return StrideMemory(uniforms[0], jnp.full((), self.start), zero, jnp.zeros((), jnp.int32), zero, zero)

    def observe(
        self, memory: StrideMemory, state: BodyState, uniforms: Float[Array, " 1"]
    ) -> tuple[StrideMemory, Array]:
        slopes = jnp.radians(jnp.asarray(self.slopes))
        drawn = slopes[jnp.minimum((uniforms[0] * len(self.slopes)).astype(jnp.int32), len(self.slopes) - 1)]
        over = memory.left <= 0
        slope = jnp.where(over, drawn, memory.slope)
        left = jnp.where(over, round(self.stretch / self.period), memory.left) - 1
        felt = jnp.arcsin(jnp.clip(state.sensors["forward"][2], -1.0, 1.0)) + slope
        pitch = memory.pitch + self.smoothing * (felt - memory.pitch)
        after = memory._replace(slope=slope, left=left, pitch=pitch, heading=read_hexapod(state).heading)
        return after, pitch[None] / math.radians(self.pitch_scale)

    def reward(
        self, memory: StrideMemory, state: BodyState, action: Float[Array, " 1"]
    ) -> tuple[StrideMemory, Scalar, Flag]:
        reading = read_hexapod(state)
        period = self.period_of(action)
        after = memory._replace(phase=self.clock.advance(memory.phase, period, self.period), period=period)
        return after, self.reward_scale * reading.speed, overturned(reading)

    def metrics(self, memory: StrideMemory, state: BodyState) -> dict[str, Metric]:
        """`speed`: along the heading on the ground, m/s. `period`: as chosen at each decision, s. `falls`: how often
        the trunk overturns per second."""
        return {**self.walking_metrics(read_hexapod(state)), "period": (memory.period, True)}
