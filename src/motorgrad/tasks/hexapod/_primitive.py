"""The hexapod walks in steps, as motor primitives: the start of each step and the duration of its phases are learned
(section 5.4.1 of the thesis)."""

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from motorgrad._arrays import AnyArray
from motorgrad.bodies import LEGS, TRIPODS, BodyState, read_hexapod
from motorgrad.schema import number
from motorgrad.tasks._task import Actions, Flag, Metric, Scalar
from motorgrad.tasks.hexapod._synergies import synergy_matrix
from motorgrad.tasks.hexapod._walking import TRIPOD_SYNERGIES, WalkingTask, overturned

STANDING = tuple(" ".join(f"depressor_{leg}" for leg in tripod) for tripod in TRIPODS)
STEPS = len(TRIPODS)
PARTS = 2  # of a step: swing and stance
ROUNDING = 5e-4  # s, tolerance for sums of decision periods


class PrimitiveMemory(NamedTuple):
    """The memory of both tripods' steps: the time since each started, `elapsed` (2,), and the durations of its phases,
    `lasting` (2, phases), in s; `begun` (2,), whether one started at the last decision."""

    elapsed: Float[Array, " 2"]
    lasting: Float[Array, "2 2"]
    begun: Bool[Array, " 2"]


@dataclasses.dataclass(frozen=True)
class HexapodPrimitive(WalkingTask):
    """Walk as fast as possible by steps of the two tripods. A step is a swing followed by a stance, with durations
    chosen when it starts. After its step, a tripod stands until the next one starts.

    Observed: for each tripod, 1 if a step can start and 0 during one; then the six lateral angles divided by
    `angle_scale`. Actions: for each tripod, whether a step starts (above one half; effective only if one can start);
    then for each tripod the real numbers a that set the durations of its swing and its stance to `swing` × exp(a) and
    `stance` × exp(a), within limits. Reward: `reward_scale` × the velocity (m/s) of the middle section along its
    heading. An episode ends when the trunk overturns. The policy for it is `motorgrad.policies.Primitives`; other
    policies of real numbers work too.
    """

    name: ClassVar[str] = "hexapod-primitive"
    actions: ClassVar[Actions] = "continuous"
    clips_actions: ClassVar[bool] = True
    metric_names: ClassVar[tuple[str, ...]] = ("speed", "begins", "falls")
    metric_units: ClassVar[Mapping[str, str]] = {**WalkingTask.metric_units, "begins": "1/s"}
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "primitives", "deviation": 0.5},
        "decay": 0.97,
        "learning_rate": {
            "precondition.weights": 2e-3,
            "precondition.bias": 2e-3,
            "movement.weights": 0.0,
            "movement.bias": 5e-4,
            "log_deviation": 0.0,
        },
    }

    swing: float = number(0.2, unit="s", help="duration of a swing for the action 0")
    stance: float = number(0.2, unit="s", help="duration of a stance for the action 0")
    shortest: float = number(0.02, 0, open_low=True, unit="s", help="the least duration of a swing or a stance")
    longest: float = number(1.0, 0, open_low=True, unit="s", help="the greatest duration of a swing or a stance")
    angle_scale: float = number(30.0, 0.01, 90, unit="degrees", help="the lateral angle that is observed as 1")
    reward_scale: float = number(4.0, help="reward per m/s of velocity")
    action_period: float = 0.02
    time_limit: float | None = None

    def validate(self) -> None:
        super().validate()
        self.check_limits(self.shortest, self.longest, swing=self.swing, stance=self.stance)

    @functools.cached_property
    def drives(self) -> np.ndarray:
        """Swing and stance of each tripod, then standing of each."""
        return synergy_matrix((*TRIPOD_SYNERGIES, *STANDING), self.body.groups)

    @property
    def observation_size(self) -> int:
        return STEPS + len(LEGS)

    @property
    def observation_names(self) -> tuple[str, ...]:
        over = [f"step {step} over" for step in range(STEPS)]
        return (*over, *(f"angle {leg.replace('_', ' ')}" for leg in LEGS))

    @property
    def observation_units(self) -> tuple[str, ...]:
        return ("1",) * self.observation_size

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...]:
        return ((0.0, 1.0),) * STEPS + tuple(self.joint_range("lateral", self.angle_scale))

    @property
    def action_size(self) -> int:
        return STEPS * (1 + PARTS)

    @property
    def action_range(self) -> tuple[tuple[float, float], ...]:
        """0 and 1 for the start of a step; the logarithms of the least and greatest relative durations."""
        lasts = [tuple(math.log(end / usual) for end in (self.shortest, self.longest)) for usual in self._usual]
        return (*((0.0, 1.0),) * STEPS, *((low, high) for _ in range(STEPS) for low, high in lasts))

    @property
    def _usual(self) -> tuple[float, float]:
        return self.swing, self.stance

    def lasting(self, action: Float[AnyArray, "... 6"]) -> Float[Array, "... 2 2"]:
        """The durations of swing and stance of each tripod's step for an action (..., 6), in s, (..., 2, 2)."""
        usual = jnp.asarray(self._usual)
        low, high = (jnp.log(end / usual) for end in (self.shortest, self.longest))
        chosen = action[..., STEPS:].reshape(*action.shape[:-1], STEPS, PARTS)
        return usual * jnp.exp(jnp.clip(chosen, low, high))

    def _begin(self, memory: PrimitiveMemory, action: Float[Array, "... 6"]) -> PrimitiveMemory:
        """The steps under way after an action has started some."""
        begun = (action[..., :STEPS] > 0.5) & _steps_over(memory)
        lasting = jnp.where(begun[..., None], self.lasting(action), memory.lasting)
        return PrimitiveMemory(jnp.where(begun, 0.0, memory.elapsed), lasting, begun)

    def control(self, action: Float[AnyArray, "... 6"], memory: PyTree = None) -> Float[AnyArray, "... groups"]:
        steps = self._begin(memory, jnp.asarray(action))
        swings = steps.elapsed + ROUNDING < steps.lasting[..., 0]
        stands = _steps_over(steps)
        parts = jnp.stack([swings, ~swings & ~stands], axis=-1).reshape(*stands.shape[:-1], STEPS * PARTS)
        return super().control(jnp.concatenate([parts, stands], axis=-1) * 1.0, memory)

    def init(self, uniforms: Float[Array, " 0"]) -> PrimitiveMemory:
        """Both tripods stand and can start a step."""
        return PrimitiveMemory(jnp.zeros(STEPS), jnp.zeros((STEPS, PARTS)), jnp.zeros(STEPS, bool))

    def observe(
        self, memory: PrimitiveMemory, state: BodyState, uniforms: Float[Array, " 0"]
    ) -> tuple[PrimitiveMemory, Array]:
        angles = read_hexapod(state).lateral / math.radians(self.angle_scale)
        return memory, jnp.concatenate([_steps_over(memory) * 1.0, angles])

    def reward(
        self, memory: PrimitiveMemory, state: BodyState, action: Float[Array, " 6"]
    ) -> tuple[PrimitiveMemory, Scalar, Flag]:
        reading = read_hexapod(state)
        steps = self._begin(memory, action)
        after = steps._replace(elapsed=steps.elapsed + self.period)
        return after, self.reward_scale * reading.speed, overturned(reading)

    def metrics(self, memory: PrimitiveMemory, state: BodyState) -> dict[str, Metric]:
        """`speed`: along the heading, m/s. `begins`: steps started per second and tripod. `falls`: how often the trunk
        overturns per second."""
        return {**self.walking_metrics(read_hexapod(state)), "begins": (jnp.mean(memory.begun) / self.period, True)}


def _steps_over(steps: PrimitiveMemory) -> Bool[Array, "... tripods"]:
    """Which tripods have no step under way."""
    return steps.elapsed + ROUNDING >= jnp.sum(steps.lasting, axis=-1)
