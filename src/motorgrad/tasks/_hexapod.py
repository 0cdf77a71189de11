"""The hexapod's task: walk fast (section 5.3.4 of the thesis), with 24 muscles or with four synergies of them."""

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from motorgrad._errors import check, choice
from motorgrad.bodies import (
    LEGS,
    TRIPODS,
    Body,
    BodyState,
    HexapodReading,
    OnTerrain,
    Terrain,
    measure_gait,
    read_hexapod,
)
from motorgrad.bodies import Hexapod as HexapodBody
from motorgrad.tasks._hexapod_learner import BATCH, MUSCLE_LEARNER
from motorgrad.tasks._hexapod_mirror import hexapod_mirror
from motorgrad.tasks._mirror import Mirror
from motorgrad.tasks._synergies import synergy_matrix
from motorgrad.tasks._task import Reading
from motorgrad.tasks._walking_task import WalkingTask, overturned

Sense = Literal["lateral", "current", "contact", "yaw", "course"]
SENSES = get_args(Sense)
SPAN = 20.0  # s, of a net displacement
SECOND = 1.0  # s, of a stall
STALL = 0.3  # m/s, the mean speed of a second below which it is one
TOUCH = 0.5  # N
SETTLING = 2.0  # s, of an evaluation's start that are no part of its gait
MOST_LAG = 1_000
LEVEL = Terrain(difficulty=0.0)

TRIPOD_SYNERGIES = tuple(
    " ".join(f"{muscle}_{leg}" for muscle in muscles for leg in tripod)
    for tripod in TRIPODS
    for muscles in (("protractor", "levator"), ("retractor", "depressor"))
)
"""Swing (lift and protract) and stance (depress and retract) of the first tripod, then of the second."""


class March(NamedTuple):
    """What the hexapod's task remembers within an episode.

    - `decisions`: made so far, −1 before the first observation.
    - `past` (lag, 6): what was observed of the lateral angles at the last decisions, newest first.
    - `yaw`: the smoothed yaw rate, rad/s; `course`: the heading at the start of the present course, rad.
    - `origin` (2,): where the present span began, m; `run`: the sum of the speeds of the present second, m/s.
    - `net` and `stalled`: of the span and of the second that ended last.
    """

    decisions: Int[Array, ""]
    past: Float[Array, "lag 6"]
    yaw: Float[Array, ""]
    course: Float[Array, ""]
    origin: Float[Array, " 2"]
    run: Float[Array, ""]
    net: Float[Array, ""]
    stalled: Float[Array, ""]


@dataclasses.dataclass(frozen=True)
class Hexapod(WalkingTask):
    """Walk as fast as possible, on 24 muscles that fire independently.

    Observed: the six lateral angles over `angle_scale`, and what else `observes` names. Actions: each muscle fires or
    does not; with `synergies`, each unit drives several muscles. Reward: `reward_scale` × the velocity (m/s) of the
    middle section along its heading, or as `paid` says. An episode ends when the trunk overturns.

    **Arguments:**

    - `body`: the hexapod (`motorgrad.bodies.Hexapod`), driven by muscles.
    - `terrain`: the ground (`motorgrad.bodies.Terrain`), a level plane without end at difficulty 0.
    - `synergies`: for each unit the groups of muscles that it drives, names or patterns such as `levator_*`, apart by
      spaces; by default every muscle has a unit of its own.
    - `observes`: `"lateral"`, the six lateral angles of `lag` decisions ago; `"current"`, those of now; `"contact"`,
      +1 for every foot that is on the ground and -1 for the others; `"yaw"`, the smoothed yaw rate in rad/s;
      `"course"`, the heading against the present course's in rad. In this order.
    - `lag` (decisions): by which `"lateral"` is late; 0 in the thesis.
    - `angle_scale` (degrees): the lateral angle that is observed as 1.
    - `yaw_smoothing`: the share of the newest yaw rate in the smoothed one, in (0, 1].
    - `paid`: velocity along the `"heading"`; along the `"course"`, the heading at the start of a course; or along the
      world's `"x"`.
    - `course` (decisions): the length of a course, of which the heading is kept; for one with each of a learner's
      batches, the size of a batch.
    - `reward_scale`: reward per m/s.
    - `action_period`: simulated seconds from one decision to the next, a multiple of the body's time step.
    - `time_limit`: simulated seconds after which an episode is cut; `None` for a task that only an overturned trunk
      interrupts.
    """

    name: ClassVar[str] = "hexapod"
    reports: ClassVar[tuple[str, ...]] = ("speed", "net", "stalls", "falls")
    episodic: ClassVar[bool] = True
    learner: ClassVar[Mapping[str, Any]] = MUSCLE_LEARNER

    body: HexapodBody = dataclasses.field(default_factory=HexapodBody)
    terrain: Terrain = LEVEL
    synergies: tuple[str, ...] | None = None
    observes: tuple[Sense, ...] = SENSES
    lag: int = 1
    angle_scale: float = 30.0
    yaw_smoothing: float = 0.1
    paid: Literal["heading", "course", "x"] = "course"
    course: int = BATCH
    reward_scale: float = 4.0
    action_period: float = 0.02
    time_limit: float | None = None

    def __post_init__(self) -> None:
        self.check_walking()
        check(len(self.observes) > 0, "observes", self.observes, f"at least one of {', '.join(SENSES)}")
        for sense in self.observes:
            choice("observes", sense, SENSES)
            check(self.observes.count(sense) == 1, "observes", self.observes, "different senses")
        choice("paid", self.paid, ("heading", "course", "x"))
        for name, least, most in (("lag", 0, MOST_LAG), ("course", 1, 2**31 - 1)):
            value = getattr(self, name)
            whole = isinstance(value, int) and not isinstance(value, bool) and least <= value <= most
            check(whole, name, value, f"a whole number of decisions from {least} to {most:,}")
        check(0.01 <= self.angle_scale <= 90, "angle_scale", self.angle_scale, "an angle from 0.01 to 90 degrees")
        check(0 < self.yaw_smoothing <= 1, "yaw_smoothing", self.yaw_smoothing, "in (0, 1]")
        if self.synergies is not None:
            synergy_matrix(self.synergies, self.body.groups)

    @property
    def dynamics(self) -> Body:
        return OnTerrain(self.body, self.terrain) if self.terrain.difficulty > 0 else self.body

    @property
    def drives(self) -> np.ndarray | None:
        return None if self.synergies is None else self._drives

    @functools.cached_property
    def _drives(self) -> np.ndarray:
        return synergy_matrix(self.synergies or (), self.body.groups)

    @property
    def observation_size(self) -> int:
        return len(self.observation_range)

    @property
    def observation_names(self) -> tuple[str, ...]:
        legs = [leg.replace("_", " ") for leg in LEGS]
        words = {"lateral": "earlier angle" if self.lag else "angle", "current": "present angle", "contact": "contact"}
        named = {sense: [f"{word} {leg}" for leg in legs] for sense, word in words.items()}
        return tuple(name for sense in self._seen for name in named.get(sense, [sense]))

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...]:
        """Of the lateral angles the joints' range, of the yaw rate and the course what a walk that curves has."""
        lateral = self.lateral_range(self.angle_scale)
        ranges = {"lateral": lateral, "current": lateral, "contact": [(-1.0, 1.0)] * 6}
        return tuple(each for sense in self._seen for each in ranges.get(sense, [(-1.0, 1.0)]))

    @property
    def mirror(self) -> Mirror | None:
        """Legs swap their sides, turns their signs; the ground does not matter. `None` where a synergy has no image."""
        return hexapod_mirror(self._seen, self.body.groups, self.drives)

    @property
    def _seen(self) -> list[str]:
        return [sense for sense in SENSES if sense in self.observes]

    def init(self, uniforms: Float[Array, " 0"]) -> March:
        zero = jnp.zeros(())
        past = jnp.zeros((self.lag, len(LEGS)))
        return March(jnp.full((), -1, jnp.int32), past, zero, zero, jnp.zeros(2), zero, zero, zero)

    def observe(
        self, memory: March, state: BodyState, uniforms: Float[Array, " 0"]
    ) -> tuple[March, Float[Array, " inputs"]]:
        reading = read_hexapod(state)
        made = memory.decisions + 1
        now = reading.lateral / math.radians(self.angle_scale)
        line = jnp.concatenate([now[None], memory.past])
        line = jnp.where(made == 0, now, line)  # before the start it stood still
        yaw = memory.yaw + self.yaw_smoothing * (reading.yaw_rate - memory.yaw)
        course = jnp.where(made % self.course == 0, reading.heading, memory.course)
        origin = jnp.where(made % self._span == 0, reading.position[:2], memory.origin)
        away = reading.heading - course
        seen = {
            "lateral": line[-1],
            "current": now,
            "contact": jnp.where(reading.contact > TOUCH, 1.0, -1.0),
            "yaw": yaw[None],
            "course": jnp.arctan2(jnp.sin(away), jnp.cos(away))[None],
        }
        after = memory._replace(decisions=made, past=line[:-1], yaw=yaw, course=course, origin=origin)
        return after, jnp.concatenate([seen[sense] for sense in self._seen])

    def reward(
        self, memory: March, state: BodyState, action: Float[Array, " units"]
    ) -> tuple[March, Float[Array, ""], Bool[Array, ""]]:
        reading, velocity = read_hexapod(state), state.sensors["velocity"]
        along = {
            "heading": reading.speed,
            "course": velocity[0] * jnp.cos(memory.course) + velocity[1] * jnp.sin(memory.course),
            "x": velocity[0],
        }
        made, run = memory.decisions + 1, memory.run + reading.speed
        second = self._decisions(SECOND)
        over = made % second == 0
        after = memory._replace(
            run=jnp.where(over, 0.0, run),
            stalled=jnp.where(over, (run / second < STALL) * 1.0, memory.stalled),
            net=jnp.linalg.norm(reading.position[:2] - memory.origin) / (self._span * self.period),
        )
        return after, self.reward_scale * along[self.paid], overturned(reading)

    def readings(self, memory: March, state: BodyState) -> dict[str, Reading]:
        """`speed`: along the heading, m/s. `net`: the net displacement over each 20 s of an episode, or over an episode
        of a shorter `time_limit`, divided by that time, m/s; where the trunk overturns before it is over, the
        displacement until then, divided by the whole. `stalls`: the part of an episode's whole seconds in which the
        mean speed is below 0.3 m/s. `falls`: how often the trunk overturns in a second."""
        reading = read_hexapod(state)
        return {
            **self.walked(reading),
            "net": (memory.net, overturned(reading) | (memory.decisions % self._span == 0)),
            "stalls": (memory.stalled, memory.decisions % self._decisions(SECOND) == 0),
        }

    def measures(self, recorded: BodyState) -> dict[str, np.ndarray]:
        """The gait after the first two seconds: its class, `gait`, and the other measures of
        `motorgrad.bodies.Gait` but for the speeds, which `readings` have."""
        reading = read_hexapod(recorded)
        since = self._decisions(SETTLING)
        if reading.lateral.shape[1] < since + self._decisions(SECOND):
            return {}
        late = HexapodReading(*(np.swapaxes(part, 0, 1)[since:] for part in reading))
        found = measure_gait(late, self.period)._asdict()
        return {"gait": found.pop("kind"), **{name: found[name] for name in found if name not in ("speed", "net")}}

    @property
    def _span(self) -> int:
        """Decisions of a net displacement."""
        return self._decisions(min(SPAN, self.time_limit or SPAN))

    def _decisions(self, seconds: float) -> int:
        return max(1, round(seconds / self.period))


@dataclasses.dataclass(frozen=True)
class HexapodSynergy(Hexapod):
    """Walk as fast as possible, on four units: swing and stance of each tripod of legs.

    As in the thesis, it observes the six lateral angles without a lag, is paid for velocity along the heading, and
    learns by OLGARB. Everything else is as in `Hexapod`.

    **Arguments:** those of `Hexapod`, and

    - `synergies`: for each unit the groups of muscles that it drives; by default swing (lift and protract) and stance
      (depress and retract) of the first tripod, then of the second.
    """

    name: ClassVar[str] = "hexapod-synergy"
    learner: ClassVar[Mapping[str, Any]] = {"policy": "hyperplanes", "decay": 0.97, "learning_rate": 1e-3}

    synergies: tuple[str, ...] = TRIPOD_SYNERGIES
    observes: tuple[Sense, ...] = ("lateral",)
    lag: int = 0
    paid: Literal["heading", "course", "x"] = "heading"
