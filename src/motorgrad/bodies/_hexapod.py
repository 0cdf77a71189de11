"""The hexapod: three sections, six legs of three segments, and 24 muscles or twelve servos."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

import mujoco
import numpy as np

from motorgrad._errors import check
from motorgrad.bodies._body import START, add_muscles
from motorgrad.bodies._hexapod_numbers import HexapodNumbers, Leg, Section
from motorgrad.bodies._hexapod_parts import skeleton, standing_angle, standing_height, start
from motorgrad.bodies._hexapod_sensors import LEGS
from motorgrad.bodies._muscle import Attachment, Muscle, Wrap, groups_of
from motorgrad.bodies._servo import Servo, add_servos
from motorgrad.bodies._wrapping import wrapped_length


@dataclasses.dataclass(frozen=True)
class Hexapod(HexapodNumbers):
    """A six-legged body whose trunk bends a little (thesis, section 5.3.1).

    Three sections stand behind one another. Each carries two legs of three segments: the coxa turns laterally, the
    femur vertically, the foot only gives way. Every leg has four muscles, each a group of its own, so that an action is
    24 numbers; with `drive="servos"` it is twelve velocities. x points forward, y to the left, z up.

    **Arguments:**

    - `front`: the first section with its legs (`Section`, `Leg`).
    - `middle`: the second section with its legs.
    - `rear`: the third section with its legs.
    - `spacing` (m): from the centre of a section to the next one's.
    - `spine`: the two joints between the sections, each in the middle of its gap.
    - `spine_axis`: "pitch" lets the front and the rear rise and sink, "yaw" lets them turn sideways.
    - `drive`: "muscles", or "servos" that turn lateral and vertical joints at desired velocities.
    - `servo_gain` (N m s/rad): torque of a servo per rad/s that its joint is too slow.
    - `lateral_torque` (N m): greatest torque of a lateral servo.
    - `vertical_torque` (N m): greatest torque of a vertical servo.
    - `timestep` (s): of the physics.
    - `muscle_model`: "thesis" (exact law, needs the callback) or "native" (MuJoCo's own muscle, an approximation).

    **Names in the model:** bodies `front`, `middle` (the root), `rear`, and for each leg of `LEGS`, such as
    `left_front`, bodies `coxa_left_front`, `femur_…`, `foot_…`, joints `lateral_…` (positive forward), `vertical_…`
    (positive up), `ankle_…`; joints `spine_front` and `spine_rear` (positive when that end rises, or turns left);
    muscles `protractor_…`, `retractor_…`, `levator_…`, `depressor_…`; servos `lateral_…`, `vertical_…`.

    **Sensors:** read them by meaning with `read_hexapod`.

    **Raises:** `ValueError` naming the field and what it may be.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        height = standing_height(self)
        for name, section in self.sections.items():
            least, greatest = section.leg.vertical.range
            angle = math.degrees(standing_angle(section.leg, height))
            allowed = (
                f"such that the foot reaches the floor {height:.3g} m below the hip between {least:g} and {greatest:g}°"
            )
            check(least <= angle <= greatest, f"{name}.leg", f"standing at {angle:.3g}°", allowed)

    @property
    def muscles(self) -> tuple[Muscle, ...]:
        """All protractors in the order of `LEGS`, then retractors, levators, depressors; none of a body with servos."""
        return tuple(self._muscles()) if self.drive == "muscles" else ()

    @property
    def servos(self) -> tuple[Servo, ...]:
        """The six lateral servos in the order of `LEGS`, then the six vertical ones; none of a body with muscles."""
        if self.drive == "muscles":
            return ()
        torques = {"lateral": self.lateral_torque, "vertical": self.vertical_torque}
        joints = [(f"{freedom}_{leg}", torque) for freedom, torque in torques.items() for leg in LEGS]
        return tuple(Servo(joint, joint, joint, self.servo_gain, torque) for joint, torque in joints)

    @property
    def groups(self) -> tuple[str, ...]:
        """Every muscle or servo by itself."""
        return groups_of(self.muscles) or tuple(servo.group for servo in self.servos)

    @property
    def sensor_components(self) -> Mapping[str, int]:
        """None: vectors are read whole."""
        return MappingProxyType({})

    @property
    def length(self) -> float:
        """Of the trunk, in m: what "body lengths per second" are counted in."""
        return 2.0 * self.spacing + (self.front.length + self.rear.length) / 2.0

    @property
    def mass(self) -> float:
        """Of all parts together, in kg."""
        legs = (s.leg for s in self.sections.values())
        return sum(s.mass for s in self.sections.values()) + 2.0 * sum(
            leg.coxa.mass + leg.femur.mass + leg.foot.mass for leg in legs
        )

    def each(self, change: Callable[[Section], Section]) -> "Hexapod":
        """The hexapod with a change made to all three sections."""
        return dataclasses.replace(self, **{name: change(section) for name, section in self.sections.items()})

    def spec(self) -> mujoco.MjSpec:
        """A fresh, editable `mujoco.MjSpec` of the hexapod, standing on its feet."""
        spec = skeleton(self)
        if self.muscles:
            add_muscles(spec, self.muscles, self.muscle_model)
        add_servos(spec, self.servos)
        spec.add_key(name=START, qpos=self._start)
        return spec

    @property
    def _start(self) -> np.ndarray:
        return start(self, skeleton(self).compile())

    def _muscles(self) -> Iterator[Muscle]:
        for kind in ("protractor", "retractor"):
            yield from (self._lateral(kind, leg) for leg in LEGS)
        for kind in ("levator", "depressor"):
            yield from (self._vertical(kind, leg) for leg in LEGS)

    def _lateral(self, kind: str, name: str) -> Muscle:
        side, section_name, section, leg = self._of(name)
        pair, splay = leg.lateral_muscles, math.radians(leg.splay)
        ahead = pair.base if kind == "protractor" else -pair.base
        # square to the resting leg, which points sideways and `splay` forward
        x, outward = ahead * math.cos(splay), section.width / 2.0 - ahead * math.sin(splay)
        between = math.pi / 2.0 - math.copysign(1.0, ahead) * leg.lateral.middle
        return Muscle(
            name=f"{kind}_{name}",
            group=f"{kind}_{name}",
            origin=Attachment(section_name, (x, outward if side == "left" else -outward, 0.0)),
            insertion=Attachment(f"coxa_{name}", (pair.reach, 0.0, 0.0)),
            strength=getattr(pair, kind),
            rest_length=_third_side(pair.base, pair.reach, between),
            damping=pair.damping,
            shape=pair.shape,
        )

    def _vertical(self, kind: str, name: str) -> Muscle:
        _, _, _, leg = self._of(name)
        pair, coxa, middle = leg.vertical_muscles, leg.coxa.length, leg.vertical.middle
        levator = kind == "levator"
        if levator:
            above = math.atan2(pair.height, coxa)
            rest = _third_side(math.hypot(coxa, pair.height), pair.distance, math.pi - middle - above)
        else:
            rest = float(wrapped_length(math.pi - middle, coxa, pair.distance, pair.radius))
        return Muscle(
            name=f"{kind}_{name}",
            group=f"{kind}_{name}",
            origin=Attachment(f"coxa_{name}", (0.0, 0.0, pair.height if levator else 0.0)),
            insertion=Attachment(f"femur_{name}", (pair.distance, 0.0, 0.0)),
            strength=getattr(pair, kind),
            rest_length=rest,
            damping=pair.damping,
            shape=pair.shape,
            wrap=None if levator else Wrap(f"capsule_{name}", f"below_{name}"),
        )

    def _of(self, name: str) -> tuple[str, str, Section, Leg]:
        """Side, section's name, section and leg of a leg's name."""
        side, _, where = name.partition("_")
        return side, where, self.sections[where], self.sections[where].leg


def _third_side(one: float, other: float, angle: float) -> float:
    """Of a triangle with two sides and the angle in rad between them."""
    return math.sqrt(one * one + other * other - 2.0 * one * other * math.cos(angle))
