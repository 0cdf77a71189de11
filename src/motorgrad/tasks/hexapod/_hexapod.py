"""The hexapod's task: walk fast (section 5.3.4 of the thesis), with 24 muscles or with four synergies."""

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from motorgrad._errors import check
from motorgrad._natural import natural_actor_critic
from motorgrad._running import counted_round
from motorgrad.bodies import (
    LEGS,
    Body,
    BodyState,
    HexapodReading,
    OnTerrain,
    Terrain,
    measure_gait,
    read_hexapod,
    read_trunk,
)
from motorgrad.schema import count, inner, number, static
from motorgrad.tasks._task import Flag, Metric, Mirror, Scalar
from motorgrad.tasks.hexapod._synergies import synergy_matrix
from motorgrad.tasks.hexapod._walking import TRIPOD_SYNERGIES, WalkingTask, hexapod_mirror, overturned

Sense = Literal["lateral", "current", "contact", "yaw", "course", "vertical", "velocity", "trunk"]
SENSES = get_args(Sense)
JOINT_VELOCITY = 10.0  # rad/s, observed as 1
TRUNK_SCALES = (0.2, 0.2, 2.0, 1.0, 0.5, 3.0, 3.0, 3.0)
"""What is observed as 1: sines of pitch and roll; velocities forward, to the left and up in m/s; rotations in rad/s."""
SPAN = 20.0  # s, over which a net displacement is measured
MAX_COUNTED_DECISIONS = 2**30 - 1  # twice as many fit into 32 bits
SECOND = 1.0  # s, over which a stall is measured
STALL = 0.3  # m/s, the mean speed below which a second counts as a stall
TOUCH = 0.5  # N
SETTLING = 2.0  # s, excluded from the gait at the start of an evaluation
LEVEL = Terrain(difficulty=0.0)
BATCH = 160  # decisions per update of the parameters
UPDATES = 1200  # updates after which annealing ends
MUSCLE_LEARNER: Mapping[str, Any] = natural_actor_critic(
    "hyperplanes",
    batch=BATCH,
    updates=UPDATES,
    discount=0.97,
    decay=0.97 * 0.95,
    memory=20,
    features={"squares": True, "actions": True},
    damping=0.01,
    kl=(0.03, 0.003),
    entropy=0.05,
)


class HexapodMemory(NamedTuple):
    """The memory of the hexapod's task within an episode.

    - `decisions`: made so far, −1 before the first observation; after 10⁹, some whole courses less.
    - `past` (lag, 6): lateral angles observed at the last decisions, newest first.
    - `yaw`: the smoothed yaw rate, rad/s; `course`: the heading at the start of the current course, rad.
    - `origin` (2,): where the current span started, m; `run`: the sum of speeds in the current second, m/s.
    - `net` and `stalled`: of the last completed span and second.
    """

    decisions: Int[Array, ""]
    past: Float[Array, "lag 6"]
    yaw: Scalar
    course: Scalar
    origin: Float[Array, " 2"]
    run: Scalar
    net: Scalar
    stalled: Scalar


@dataclasses.dataclass(frozen=True)
class Hexapod(WalkingTask):
    """Walk as fast as possible, with 24 muscles that fire independently.

    Observed: the six lateral angles divided by `angle_scale`, and the other senses in `observes`. Actions: each muscle
    fires or not; with `synergies`, each unit drives several muscles. Reward: `reward_scale` × the velocity (m/s) of the
    middle section along the direction that `reward_type` names. An episode ends when the trunk overturns.
    """

    name: ClassVar[str] = "hexapod"
    metric_names: ClassVar[tuple[str, ...]] = ("speed", "net", "stalls", "falls")
    metric_units: ClassVar[Mapping[str, str]] = {**WalkingTask.metric_units, "net": "m/s", "stalls": "1"}
    learner: ClassVar[Mapping[str, Any]] = MUSCLE_LEARNER

    terrain: Terrain = inner(
        LEVEL, help="the ground (`motorgrad.bodies.Terrain`), an infinite level plane at difficulty 0"
    )
    synergies: tuple[str, ...] | None = static(
        None,
        help="for each unit the groups of muscles that it drives, names or patterns such as `levator_*`, "
        "separated by spaces; by default every muscle has its own unit",
    )
    observes: tuple[Sense, ...] = static(
        ("lateral", "current", "contact", "yaw", "course"),
        help='`"lateral"`, the six lateral angles of `lag` decisions ago; `"current"`, the present ones; '
        '`"contact"`, +1 for every foot on the ground and -1 for the others; `"yaw"`, the smoothed '
        'yaw rate in rad/s; `"course"`, the heading relative to the course\'s in rad; `"vertical"`, '
        'the six vertical angles; `"velocity"`, the six lateral and six vertical velocities, divided '
        'by 10 rad/s; `"trunk"`, the motion of the middle section: the sines of its pitch and roll, '
        "divided by 0.2, its velocity forward, to the left and up, divided by 2, 1 and 0.5 m/s, and "
        "its rates of rotation about these axes, divided by 3 rad/s. They are always in this order",
    )
    lag: int = count(1, 0, 1_000, unit="decisions", help='delay of the observation `"lateral"`; 0 in the thesis')
    angle_scale: float = number(30.0, 0.01, 90, unit="degrees", help="the angle of a joint that is observed as 1")
    yaw_smoothing: float = number(
        0.1, 0, 1, open_low=True, help="the weight of the newest yaw rate in the smoothed one"
    )
    reward_type: Literal["heading", "course", "x"] = static(
        "course",
        help='the direction of the rewarded velocity: the `"heading"`; the `"course"`, that is the heading'
        ' at the start of a course; or the world\'s `"x"` axis',
    )
    course: int = count(
        BATCH,
        1,
        unit="decisions",
        help="the length of a course; the batch size of the learner gives a new course per batch",
    )
    reward_scale: float = number(4.0, help="reward per m/s of velocity")
    action_period: float = 0.02
    time_limit: float | None = None

    def validate(self) -> None:
        super().validate()
        check(self.observes, "observes", self.observes, f"at least one of {', '.join(SENSES)}")
        check(len(set(self.observes)) == len(self.observes), "observes", self.observes, "different senses")
        self.drives  # noqa: B018 (raises for unknown synergies)

    @property
    def dynamics(self) -> Body:
        return OnTerrain(self.body, self.terrain) if self.terrain.difficulty > 0 else self.body

    @functools.cached_property
    def drives(self) -> np.ndarray | None:
        return None if self.synergies is None else synergy_matrix(self.synergies, self.body.groups)

    @property
    def observation_size(self) -> int:
        return len(self.observation_range)

    @property
    def observation_names(self) -> tuple[str, ...]:
        legs = [leg.replace("_", " ") for leg in LEGS]
        words = {
            "lateral": "earlier angle" if self.lag else "angle",
            "current": "present angle",
            "contact": "contact",
            "vertical": "vertical angle",
        }
        named = {sense: [f"{word} {leg}" for leg in legs] for sense, word in words.items()}
        named["velocity"] = [f"{kind} velocity {leg}" for kind in ("lateral", "vertical") for leg in legs]
        named["trunk"] = ["pitch", "roll", *(f"velocity {way}" for way in ("forward", "left", "up"))]
        named["trunk"] += [f"{kind} rate" for kind in ("roll", "pitch", "trunk's yaw")]
        return tuple(name for sense in self._seen for name in named.get(sense, [sense]))

    @property
    def observation_units(self) -> tuple[str, ...]:
        return tuple({"yaw": "rad/s", "course": "rad"}.get(name, "1") for name in self.observation_names)

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...]:
        """For angles of joints their range; for everything else the range of a walk that curves."""
        lateral, vertical = (self.joint_range(freedom, self.angle_scale) for freedom in ("lateral", "vertical"))
        angles = {"lateral": lateral, "current": lateral, "vertical": vertical}
        counts = {"contact": 6, "velocity": 12, "trunk": 8}
        return tuple(each for sense in self._seen for each in angles.get(sense, [(-1.0, 1.0)] * counts.get(sense, 1)))

    @property
    def mirror(self) -> Mirror | None:
        """Legs swap sides, turns change their sign; the ground is ignored. `None` if a synergy has no mirror image."""
        return hexapod_mirror(self._seen, self.body.groups, self.drives)

    @property
    def _seen(self) -> list[str]:
        return [sense for sense in SENSES if sense in self.observes]

    def init(self, uniforms: Float[Array, " 0"]) -> HexapodMemory:
        zero = jnp.zeros(())
        past = jnp.zeros((self.lag, len(LEGS)))
        return HexapodMemory(jnp.full((), -1, jnp.int32), past, zero, zero, jnp.zeros(2), zero, zero, zero)

    def observe(
        self, memory: HexapodMemory, state: BodyState, uniforms: Float[Array, " 0"]
    ) -> tuple[HexapodMemory, Float[Array, " inputs"]]:
        reading = read_hexapod(state)
        made = counted_round(memory.decisions + 1, self._round)
        scale = math.radians(self.angle_scale)
        now = reading.lateral / scale
        line = jnp.concatenate([now[None], memory.past])
        line = jnp.where(made == 0, now, line)  # the delay line starts full of the first observation
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
            "vertical": reading.vertical / scale,
            "velocity": jnp.concatenate([reading.lateral_velocity, reading.vertical_velocity]) / JOINT_VELOCITY,
            "trunk": jnp.concatenate(read_trunk(state)) / jnp.array(TRUNK_SCALES),
        }
        after = memory._replace(decisions=made, past=line[:-1], yaw=yaw, course=course, origin=origin)
        return after, jnp.concatenate([seen[sense] for sense in self._seen])

    def reward(
        self, memory: HexapodMemory, state: BodyState, action: Float[Array, " units"]
    ) -> tuple[HexapodMemory, Scalar, Flag]:
        reading = read_hexapod(state)
        velocity = state.sensors["velocity"]
        along = {
            "heading": reading.speed,
            "course": velocity[0] * jnp.cos(memory.course) + velocity[1] * jnp.sin(memory.course),
            "x": velocity[0],
        }
        made = memory.decisions + 1
        run = memory.run + reading.speed
        second = self._decisions(SECOND)
        over = made % second == 0
        after = memory._replace(
            run=jnp.where(over, 0.0, run),
            stalled=jnp.where(over, (run / second < STALL) * 1.0, memory.stalled),
            net=jnp.linalg.norm(reading.position[:2] - memory.origin) / (self._span * self.period),
        )
        return after, self.reward_scale * along[self.reward_type], overturned(reading)

    def metrics(self, memory: HexapodMemory, state: BodyState) -> dict[str, Metric]:
        """Speed, net displacement, stalls and falls.

        - `speed`: along the heading, m/s.
        - `net`: the net displacement over each 20 s of an episode, or over an episode with a shorter `time_limit`,
          divided by that time, m/s. If the trunk overturns earlier, the displacement until then, divided by the full
          time.
        - `stalls`: the fraction of whole seconds in which the mean speed is below 0.3 m/s.
        - `falls`: how often the trunk overturns per second.
        """
        reading = read_hexapod(state)
        return {
            **self.walking_metrics(reading),
            "net": (memory.net, overturned(reading) | (memory.decisions % self._span == 0)),
            "stalls": (memory.stalled, memory.decisions % self._decisions(SECOND) == 0),
        }

    def motion_metrics(self, motion: BodyState) -> dict[str, np.ndarray]:
        """The gait after the first two seconds: its class, `gait`, and the other measures of `motorgrad.bodies.Gait`,
        except the speeds, which are metrics."""
        reading = read_hexapod(motion)
        since = self._decisions(SETTLING)
        if reading.lateral.shape[1] < since + self._decisions(SECOND):
            return {}
        late = HexapodReading(*(np.swapaxes(part, 0, 1)[since:] for part in reading))
        found = measure_gait(late, self.period)._asdict()
        return {"gait": found.pop("kind"), **{name: found[name] for name in found if name not in ("speed", "net")}}

    @property
    def _span(self) -> int:
        """Decisions per net displacement."""
        return self._decisions(min(SPAN, self.time_limit or SPAN))

    @property
    def _round(self) -> int:
        """Decisions that their count may omit: a whole number of courses, spans and seconds. Where courses are too long
        for that, one in 10⁹ decisions is longer or shorter."""
        often = math.lcm(self._span, self._decisions(SECOND))
        whole = math.lcm(often, self.course)
        return MAX_COUNTED_DECISIONS // whole * whole or MAX_COUNTED_DECISIONS // often * often

    def _decisions(self, seconds: float) -> int:
        return max(1, round(seconds / self.period))


@dataclasses.dataclass(frozen=True)
class HexapodSynergy(Hexapod):
    """Walk as fast as possible, with four units: swing and stance of each tripod of legs.

    As in the thesis, it observes the six lateral angles without a lag, is rewarded for velocity along the heading, and
    learns by OLGARB. Everything else is as in `Hexapod`.
    """

    name: ClassVar[str] = "hexapod-synergy"
    learner: ClassVar[Mapping[str, Any]] = {"policy": "hyperplanes", "decay": 0.97, "learning_rate": 1e-3}

    synergies: tuple[str, ...] = static(
        TRIPOD_SYNERGIES,
        help="for each unit the groups of muscles that it drives; by default swing (lift and protract) and "
        "stance (depress and retract) of the first tripod, then of the second",
    )
    observes: tuple[Sense, ...] = ("lateral",)
    lag: int = 0
    reward_type: Literal["heading", "course", "x"] = "heading"


@dataclasses.dataclass(frozen=True)
class HexapodProprioception(Hexapod):
    """Walk as fast as possible, with 24 muscles that fire independently, and with all senses of joints and trunk.

    Its learner has units that act for left and right (`motorgrad.policies.Mirrored`), and is designed for 200,000
    decisions. Everything else is as in `Hexapod`.
    """

    name: ClassVar[str] = "hexapod-proprioception"
    learner: ClassVar[Mapping[str, Any]] = natural_actor_critic(
        {"kind": "mirrored", "features": {"nonlinear": 64}},
        batch=BATCH,
        updates=1250,
        discount=0.97,
        decay=0.97 * 0.95,
        memory=20,
        features={"squares": True, "actions": True},
        damping=0.01,
        kl=(0.06, 0.006),
        entropy=0.02,
    )

    observes: tuple[Sense, ...] = ("current", "contact", "yaw", "course", "vertical", "velocity", "trunk")
    time_limit: float | None = number(
        8.0,
        unit="s",
        help="simulated time after which an episode is cut, so that the hexapod practises setting off; `None` for one "
        "long walk",
    )
