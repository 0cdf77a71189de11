"""The hexapod walks in steps, motor primitives: when each begins, and how long its parts last, is learnt (section 5.4.1
of the thesis)."""

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from motorgrad._errors import check
from motorgrad.bodies import LEGS, TRIPODS, BodyState, read_hexapod
from motorgrad.bodies import Hexapod as HexapodBody
from motorgrad.tasks._hexapod import TRIPOD_SYNERGIES
from motorgrad.tasks._synergies import synergy_matrix
from motorgrad.tasks._task import Actions, Reading
from motorgrad.tasks._walking_task import WalkingTask, overturned

STANDING = tuple(" ".join(f"depressor_{leg}" for leg in tripod) for tripod in TRIPODS)
STEPS = len(TRIPODS)
PARTS = 2  # of a step: swing and stance
ROUNDING = 5e-4  # s, in sums of decisions


class Steps(NamedTuple):
    """What the task remembers of the two tripods' steps: since when each is under way, `elapsed` (2,), and how long its
    parts last, `lasting` (2, parts), in s; `begun` (2,), whether one began at the last decision."""

    elapsed: Float[Array, " 2"]
    lasting: Float[Array, "2 2"]
    begun: Bool[Array, " 2"]


@dataclasses.dataclass(frozen=True)
class HexapodPrimitive(WalkingTask):
    """Walk as fast as possible by steps of the two tripods: a step is a swing and then a stance, each of a length that
    is chosen when it begins. A tripod whose step is over stands, until the next one begins.

    Observed: for each tripod 1 where a step can begin and 0 while one is under way; then the six lateral angles over
    `angle_scale`. Actions: for each tripod whether a step begins (above one half; it counts only where one can); then
    for each the real numbers that make its swing and its stance last `swing` × exp(a) and `stance` × exp(a), within
    limits. Reward: `reward_scale` × the velocity (m/s) of the middle section along its heading. An episode ends when
    the trunk overturns. The policy for it is `motorgrad.policies.Primitives`; other policies of real numbers will do.

    **Arguments:**

    - `body`: the hexapod (`motorgrad.bodies.Hexapod`), driven by muscles.
    - `swing` (s): how long a swing lasts for the action 0.
    - `stance` (s): how long a stance lasts for the action 0.
    - `shortest` (s): the least length of either.
    - `longest` (s): the greatest length of either.
    - `angle_scale` (degrees): the lateral angle that is observed as 1.
    - `reward_scale`: reward per m/s.
    - `action_period`: simulated seconds from one decision to the next, a multiple of the body's time step.
    - `time_limit`: simulated seconds after which an episode is cut; `None` for a task that only an overturned trunk
      interrupts.
    """

    name: ClassVar[str] = "hexapod-primitive"
    actions: ClassVar[Actions] = "graded"
    reports: ClassVar[tuple[str, ...]] = ("speed", "begins", "falls")
    episodic: ClassVar[bool] = True
    learner: ClassVar[Mapping[str, Any]] = {
        "policy": {"kind": "primitives", "deviation": 0.5},
        "decay": 0.97,
        "learning_rate": {"weights": 2e-3, "bias": 2e-3, "slope": 0.0, "level": 5e-4, "log_deviation": 0.0},
    }

    body: HexapodBody = dataclasses.field(default_factory=HexapodBody)
    swing: float = 0.2
    stance: float = 0.2
    shortest: float = 0.02
    longest: float = 1.0
    angle_scale: float = 30.0
    reward_scale: float = 4.0
    action_period: float = 0.02
    time_limit: float | None = None

    def __post_init__(self) -> None:
        self.check_walking()
        self.check_limits(self.shortest, self.longest, swing=self.swing, stance=self.stance)
        check(0.01 <= self.angle_scale <= 90, "angle_scale", self.angle_scale, "an angle from 0.01 to 90 degrees")

    @property
    def drives(self) -> np.ndarray:
        return self._drives

    @functools.cached_property
    def _drives(self) -> np.ndarray:
        """Swing and stance of each tripod, then their standing."""
        return synergy_matrix((*TRIPOD_SYNERGIES, *STANDING), self.body.groups)

    @property
    def observation_size(self) -> int:
        return STEPS + len(LEGS)

    @property
    def observation_names(self) -> tuple[str, ...]:
        over = [f"step {step} over" for step in range(STEPS)]
        return (*over, *(f"angle {leg.replace('_', ' ')}" for leg in LEGS))

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...]:
        return ((0.0, 1.0),) * STEPS + tuple(self.lateral_range(self.angle_scale))

    @property
    def action_size(self) -> int:
        return STEPS * (1 + PARTS)

    @property
    def action_range(self) -> tuple[tuple[float, float], ...]:
        """Of what begins 0 and 1; of how long swing and stance last from the least to the greatest."""
        lasts = [tuple(math.log(end / usual) for end in (self.shortest, self.longest)) for usual in self._usual]
        return (*((0.0, 1.0),) * STEPS, *((low, high) for _ in range(STEPS) for low, high in lasts))

    @property
    def _usual(self) -> tuple[float, float]:
        return self.swing, self.stance

    def lasting(self, action: Any) -> Any:
        """How long swing and stance of each tripod's step last by an action (..., 6), in s, (..., 2, 2)."""
        usual = jnp.asarray(self._usual)
        low, high = (jnp.log(end / usual) for end in (self.shortest, self.longest))
        chosen = action[..., STEPS:].reshape(*action.shape[:-1], STEPS, PARTS)
        return usual * jnp.exp(jnp.clip(chosen, low, high))

    def _begin(self, memory: Any, action: Any) -> Steps:
        """The steps under way once an action has begun some."""
        begun = (action[..., :STEPS] > 0.5) & _over(memory)
        lasting = jnp.where(begun[..., None], self.lasting(action), memory.lasting)
        return Steps(jnp.where(begun, 0.0, memory.elapsed), lasting, begun)

    def control(self, action: Any, memory: Any = None) -> Any:
        steps = self._begin(memory, jnp.asarray(action))
        swings = steps.elapsed + ROUNDING < steps.lasting[..., 0]
        stands = _over(steps)
        parts = jnp.stack([swings, ~swings & ~stands], axis=-1).reshape(*stands.shape[:-1], STEPS * PARTS)
        return super().control(jnp.concatenate([parts, stands], axis=-1) * 1.0, memory)

    def init(self, uniforms: Float[Array, " 0"]) -> Steps:
        """Both tripods stand, and can step."""
        return Steps(jnp.zeros(STEPS), jnp.zeros((STEPS, PARTS)), jnp.zeros(STEPS, bool))

    def observe(self, memory: Steps, state: BodyState, uniforms: Float[Array, " 0"]) -> tuple[Steps, Array]:
        angles = read_hexapod(state).lateral / math.radians(self.angle_scale)
        return memory, jnp.concatenate([_over(memory) * 1.0, angles])

    def reward(
        self, memory: Steps, state: BodyState, action: Float[Array, " 6"]
    ) -> tuple[Steps, Float[Array, ""], Bool[Array, ""]]:
        reading, steps = read_hexapod(state), self._begin(memory, action)
        after = steps._replace(elapsed=steps.elapsed + self.period)
        return after, self.reward_scale * reading.speed, overturned(reading)

    def readings(self, memory: Steps, state: BodyState) -> dict[str, Reading]:
        """`speed`: along the heading, m/s. `begins`: how many steps a tripod begins in a second. `falls`: how often the
        trunk overturns in a second."""
        return {**self.walked(read_hexapod(state)), "begins": (jnp.mean(memory.begun) / self.period, True)}


def _over(steps: Any) -> Any:
    """Where no step is under way."""
    return steps.elapsed + ROUNDING >= jnp.sum(steps.lasting, axis=-1)
