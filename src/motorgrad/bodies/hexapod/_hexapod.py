"""The hexapod: three sections, six legs of three segments, and 24 muscles or twelve servos."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Literal

import mujoco
import numpy as np

from motorgrad._errors import check
from motorgrad.bodies._body import START, about, add_geom, add_muscles, add_scenery
from motorgrad.bodies.hexapod._numbers import Drive, Hinge, LateralPair, Leg, Section, Segment, VerticalPair
from motorgrad.bodies.hexapod._sensors import LEGS, add_hexapod_sensors
from motorgrad.bodies.muscles._muscle import Attachment, Muscle, Servo, Wrap, add_servos, groups_of
from motorgrad.bodies.muscles._wrapping import wrapped_length
from motorgrad.schema import Settings, inner, number, static

SIDES = ("left", "right")
_BONE = (0.90, 0.87, 0.80, 1.0)
_FOOT = (0.36, 0.38, 0.44, 1.0)
_TRUNK = (0.27, 0.30, 0.36, 1.0)
_CAPSULE = (0.95, 0.95, 0.98, 0.35)
_STOP = ((0.005, 1.0), (0.98, 0.999, 0.001))  # softer stops let legs exceed their range by ten degrees
_CONTACT = (0.02, 1.0)  # stiffer feet bounce, and stand on two legs of three
_MARGIN = 0.01  # m, by which a touch sensor's volume exceeds the geom
_SECTION = Section()
_SPINE = Hinge((-7.5, 7.5), stiffness=20.0, damping=0.5)


@dataclasses.dataclass(frozen=True)
class Hexapod(Settings):
    """A six-legged body with a slightly flexible trunk (thesis, section 5.3.1).

    Three sections form the trunk, one behind the other. Each carries two legs of three segments: the coxa turns
    laterally, the femur vertically, and the foot is passively sprung. Every leg has four muscles, each a group of its
    own, so an action has 24 numbers; with `drive="servos"` it has twelve velocities. x points forward, y to the left, z
    up.

    **Names in the model:** bodies `front`, `middle` (the root), `rear`, and for each leg of `LEGS`, such as
    `left_front`, bodies `coxa_left_front`, `femur_…`, `foot_…`, joints `lateral_…` (positive forward), `vertical_…`
    (positive up), `ankle_…`; joints `spine_front` and `spine_rear` (positive when that end rises, or turns left);
    muscles `protractor_…`, `retractor_…`, `levator_…`, `depressor_…`; servos `lateral_…`, `vertical_…`.

    **Sensors:** `read_hexapod` returns them by meaning.
    """

    front: Section = inner(_SECTION, help="the first section with its legs (`Section`, `Leg`)")
    middle: Section = inner(_SECTION, help="the second section with its legs")
    rear: Section = inner(_SECTION, help="the third section with its legs")
    spacing: float = number(
        0.26, 0, open_low=True, unit="m", help="distance between the centres of neighbouring sections"
    )
    spine: Hinge = inner(_SPINE, help="the two joints between the sections, each in the middle of its gap")
    spine_axis: Literal["pitch", "yaw"] = static(
        "pitch", help='"pitch" lets front and rear rise and sink, "yaw" lets them turn sideways'
    )
    drive: Drive = static(
        "muscles", help='"muscles", or "servos" that turn lateral and vertical joints at desired velocities'
    )
    servo_gain: float = number(
        20.0, 0, open_low=True, unit="N m s/rad", help="torque of a servo per rad/s of velocity error"
    )
    lateral_torque: float = number(6.0, 0, open_low=True, unit="N m", help="greatest torque of a lateral servo")
    vertical_torque: float = number(12.0, 0, open_low=True, unit="N m", help="greatest torque of a vertical servo")
    timestep: float = number(0.0025, 0, open_low=True, unit="s", help="time step of the physics")
    muscle_model: Literal["thesis", "native"] = static(
        "thesis", help='"thesis" (exact law, needs the callback) or "native" (MuJoCo\'s own muscle, an approximation)'
    )

    def validate(self) -> None:
        least = (self.middle.length + max(self.front.length, self.rear.length)) / 2.0
        check(self.spacing >= least, "spacing", self.spacing, f"at least {least:g} m, so that no sections overlap")
        height = _standing_height(self)
        for name, section in self.sections.items():
            least, greatest = section.leg.vertical.range
            angle = math.degrees(_standing_angle(section.leg, height))
            allowed = (
                f"such that the foot reaches the floor {height:.3g} m below the hip between {least:g} and {greatest:g}°"
            )
            check(least <= angle <= greatest, f"{name}.leg", f"standing at {angle:.3g}°", allowed)

    @property
    def sections(self) -> dict[str, Section]:
        """The three sections by name, front to rear."""
        return {"front": self.front, "middle": self.middle, "rear": self.rear}

    @property
    def muscles(self) -> tuple[Muscle, ...]:
        """All protractors in the order of `LEGS`, then retractors, levators and depressors; empty for a body with
        servos."""
        return tuple(self._muscles()) if self.drive == "muscles" else ()

    @property
    def servos(self) -> tuple[Servo, ...]:
        """The six lateral servos in the order of `LEGS`, then the six vertical ones; empty for a body with muscles."""
        if self.drive == "muscles":
            return ()
        torques = {"lateral": self.lateral_torque, "vertical": self.vertical_torque}
        joints = [(f"{freedom}_{leg}", torque) for freedom, torque in torques.items() for leg in LEGS]
        return tuple(Servo(joint, joint, joint, self.servo_gain, torque) for joint, torque in joints)

    @property
    def groups(self) -> tuple[str, ...]:
        """Every muscle or servo is a group of its own."""
        return groups_of(self.muscles) or tuple(servo.group for servo in self.servos)

    @property
    def sensor_components(self) -> Mapping[str, int]:
        """Empty: vector sensors are read whole."""
        return MappingProxyType({})

    @property
    def length(self) -> float:
        """Length of the trunk in m, the unit of "body lengths per second"."""
        return 2.0 * self.spacing + (self.front.length + self.rear.length) / 2.0

    @property
    def mass(self) -> float:
        """Total mass in kg."""
        legs = (s.leg for s in self.sections.values())
        return sum(s.mass for s in self.sections.values()) + 2.0 * sum(
            leg.coxa.mass + leg.femur.mass + leg.foot.mass for leg in legs
        )

    def map_sections(self, change: Callable[[Section], Section]) -> "Hexapod":
        """Apply a change to all three sections.

        ```python
        heavier = body.map_sections(lambda section: dataclasses.replace(section, mass=2.0))
        ```
        """
        return dataclasses.replace(self, **{name: change(section) for name, section in self.sections.items()})

    def spec(self) -> mujoco.MjSpec:
        """A new, editable `mujoco.MjSpec` of the hexapod, standing on its feet."""
        spec = _skeleton(self)
        if self.muscles:
            add_muscles(spec, self.muscles, self.muscle_model)
        add_servos(spec, self.servos)
        spec.add_key(name=START, qpos=_start_pose(self, _skeleton(self).compile()))
        return spec

    def _muscles(self) -> Iterator[Muscle]:
        for kind in ("protractor", "retractor"):
            yield from (self._lateral(kind, leg) for leg in LEGS)
        for kind in ("levator", "depressor"):
            yield from (self._vertical(kind, leg) for leg in LEGS)

    def _lateral(self, kind: str, name: str) -> Muscle:
        side, section_name, section, leg = self._of(name)
        pair = leg.lateral_muscles
        splay = math.radians(leg.splay)
        ahead = pair.base if kind == "protractor" else -pair.base
        # perpendicular to the resting leg, which points sideways and `splay` forward
        x = ahead * math.cos(splay)
        outward = section.width / 2.0 - ahead * math.sin(splay)
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
        """Side, section name, section and leg for a leg's name."""
        side, _, where = name.partition("_")
        return side, where, self.sections[where], self.sections[where].leg


_FRONT = Leg(
    coxa=Segment(0.05, 0.04, 0.014),
    femur=Segment(0.11, 0.07, 0.011),
    foot=Segment(0.15, 0.05, 0.011),
    vertical=Hinge((-25.0, 45.0)),
    splay=35.0,
    friction=0.4,
    lateral_muscles=LateralPair(protractor=100.0, retractor=80.0, base=0.08, reach=0.05),
    vertical_muscles=VerticalPair(levator=220.0, depressor=180.0, radius=0.04, distance=0.09, height=0.05),
)
_MIDDLE = Leg(friction=1.2)
_REAR = Leg(
    coxa=Segment(0.07, 0.08, 0.018),
    femur=Segment(0.18, 0.14, 0.014),
    foot=Segment(0.20, 0.08, 0.013),
    vertical=Hinge((-5.0, 60.0)),
    splay=-35.0,
    friction=1.6,
    lateral_muscles=LateralPair(protractor=120.0, retractor=180.0, base=0.10, reach=0.07),
    vertical_muscles=VerticalPair(levator=260.0, depressor=320.0, radius=0.05, distance=0.15, height=0.07),
)


def biomimetic_hexapod(drive: Drive = "muscles") -> Hexapod:
    """The hexapod of section 5.4.1 and figure 5.9 of the thesis, whose legs have different roles, as an insect's do.

    The front legs are short, reach forward and have low friction, so that they do not interrupt the stride when they
    touch the ground early. The rear legs are long, point backward, push strongly and have high friction, so that they
    do not slip. The middle legs are those of the plain hexapod, with a little more friction. The trunk widens to the
    rear. The thesis gives no numbers; these are ours.

    **Arguments:**

    - `drive`: "muscles" or "servos".
    """
    return Hexapod(
        front=Section(0.20, 0.20, 0.08, 1.0, _FRONT),
        middle=Section(0.22, 0.26, 0.09, 1.5, _MIDDLE),
        rear=Section(0.26, 0.28, 0.09, 1.8, _REAR),
        drive=drive,
    )


def _third_side(one: float, other: float, angle: float) -> float:
    """Third side of a triangle with two sides and the angle in rad between them."""
    return math.sqrt(one * one + other * other - 2.0 * one * other * math.cos(angle))


def _standing_height(hexapod: Hexapod) -> float:
    """Height in m of the hips above the floor when the middle legs stand with level femurs."""
    leg = hexapod.middle.leg
    return leg.foot.length * math.sin(math.radians(leg.knee)) + leg.foot.radius


def _standing_angle(leg: Leg, height: float) -> float:
    """The vertical angle in rad at which a foot just touches the floor `height` m below its hip; NaN if it cannot reach
    it.

    The tip lies `femur sin φ + foot sin(φ − knee)` above the joint, which is a single sine of φ.
    """
    knee = math.radians(leg.knee)
    along = leg.femur.length + leg.foot.length * math.cos(knee)
    down = leg.foot.length * math.sin(knee)
    share = (height - leg.foot.radius) / math.hypot(along, down)
    return math.atan2(down, along) - math.asin(share) if abs(share) <= 1.0 else math.nan


def _start_pose(hexapod: Hexapod, model: mujoco.MjModel) -> np.ndarray:
    """Positions (nq,) of the start pose: trunk level, legs at rest laterally, every foot on the floor."""
    position = np.array(model.qpos0)
    height = _standing_height(hexapod)
    for name, section in hexapod.sections.items():
        for side in SIDES:
            position[model.joint(f"vertical_{side}_{name}").qposadr[0]] = _standing_angle(section.leg, height)
    return position


def _skeleton(hexapod: Hexapod) -> mujoco.MjSpec:
    """The hexapod without muscles and keyframe, with level trunk and femurs."""
    spec = mujoco.MjSpec()
    spec.modelname = "hexapod"
    spec.compiler.degree = False
    spec.option.timestep = hexapod.timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    middle = spec.worldbody.add_body(name="middle", pos=(0.0, 0.0, _standing_height(hexapod)))
    middle.add_freejoint(name="trunk")
    _add_section(middle, "middle", hexapod.middle)
    for name, section, sign in (("front", hexapod.front, 1.0), ("rear", hexapod.rear, -1.0)):
        # the joint lies in the middle of the gap between the two boxes
        gap = (hexapod.spacing + (hexapod.middle.length - section.length) / 2.0) / 2.0
        body = middle.add_body(name=name, pos=(sign * hexapod.spacing, 0.0, 0.0))
        axis = (0.0, -sign, 0.0) if hexapod.spine_axis == "pitch" else (0.0, 0.0, sign)
        joint = _add_hinge(body, f"spine_{name}", axis, hexapod.spine)
        joint.pos = (sign * (gap - hexapod.spacing), 0.0, 0.0)
        _add_section(body, name, section)
    middle.add_site(name="trunk", size=(0.01, 0.01, 0.01), group=4)
    add_scenery(spec, rail=None, target="middle")
    add_hexapod_sensors(spec)
    return spec


def _add_section(body: mujoco.MjsBody, name: str, section: Section) -> None:
    size = np.array((section.length, section.width, section.height)) / 2.0
    belly = add_geom(body, name, mujoco.mjtGeom.mjGEOM_BOX, size, (0, 0, 0), section.mass, _TRUNK)
    belly.contype = 1
    belly.priority = 1
    belly.solref = _CONTACT
    touch = body.add_site(name=f"belly_{name}", type=mujoco.mjtGeom.mjGEOM_BOX, group=4)
    touch.size = size + _MARGIN
    for side in SIDES:
        _add_leg(body, f"{side}_{name}", section)


def _add_leg(body: mujoco.MjsBody, name: str, section: Section) -> None:
    """Add coxa, femur and foot. In each frame x runs along the bone and z up; the right leg mirrors the left one."""
    leg = section.leg
    left = name.startswith("left")
    hip = section.width / 2.0
    turn = math.radians(90.0 - leg.splay)
    coxa = body.add_body(name=f"coxa_{name}", pos=(0.0, hip if left else -hip, 0.0))
    coxa.quat = about((0, 0, 1), turn if left else -turn)
    _add_hinge(coxa, f"lateral_{name}", (0.0, 0.0, -1.0 if left else 1.0), leg.lateral)
    _add_bone(coxa, f"coxa_{name}", leg.coxa, _BONE)
    femur = coxa.add_body(name=f"femur_{name}", pos=(leg.coxa.length, 0.0, 0.0))
    _add_hinge(femur, f"vertical_{name}", (0.0, -1.0, 0.0), leg.vertical)
    _add_bone(femur, f"femur_{name}", leg.femur, _BONE)
    _add_capsule(coxa, name, leg)
    foot = femur.add_body(name=f"foot_{name}", pos=(leg.femur.length, 0.0, 0.0))
    foot.quat = about((0, 1, 0), math.radians(leg.knee))
    _add_hinge(foot, f"ankle_{name}", (0.0, -1.0, 0.0), leg.ankle)
    sole = _add_bone(foot, f"foot_{name}", leg.foot, _FOOT)
    # MuJoCo uses the greater of two frictions, unless one geom has priority
    sole.contype = 1
    sole.priority = 1
    sole.friction[0] = leg.friction
    sole.solref = _CONTACT
    touch = foot.add_site(name=f"foot_{name}", type=mujoco.mjtGeom.mjGEOM_CAPSULE, group=4)
    touch.pos = sole.pos
    touch.quat = sole.quat
    touch.size = np.add(sole.size, (_MARGIN, _MARGIN, 0.0))


def _add_capsule(coxa: mujoco.MjsBody, name: str, leg: Leg) -> None:
    """Add the vertical joint's capsule, and the site below it that tells MuJoCo which way the depressor passes.

    The capsule is a cylinder about the joint's axis, not a sphere. With femur and coxa in line, a path around a sphere
    has no unique plane, and MuJoCo led it around the side. The site is at the middle of the arc for the most lifted
    femur, as in the hopper's most flexed knee.
    """
    joint = np.array((leg.coxa.length, 0.0, 0.0))
    radius = leg.vertical_muscles.radius
    size = (radius, leg.femur.radius, 0.0)
    capsule = add_geom(coxa, f"capsule_{name}", mujoco.mjtGeom.mjGEOM_CYLINDER, size, joint, 0.0, _CAPSULE)
    capsule.quat = about((1, 0, 0), math.pi / 2.0)
    half = math.radians(leg.vertical.range[1]) / 2.0
    below = joint + 1.5 * radius * np.array((math.sin(half), 0.0, -math.cos(half)))
    coxa.add_site(name=f"below_{name}", pos=below, size=(0.004, 0.004, 0.004), group=4)


def _add_hinge(body: mujoco.MjsBody, name: str, axis: tuple, hinge: Hinge) -> mujoco.MjsJoint:
    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, armature=hinge.armature)
    joint.damping[0], joint.stiffness[0] = hinge.damping, hinge.stiffness
    joint.limited = True
    joint.range = [math.radians(angle) for angle in hinge.range]
    joint.solref_limit, joint.solimp_limit[:3] = _STOP
    return joint


def _add_bone(body: mujoco.MjsBody, name: str, segment: Segment, colour: Sequence[float]) -> mujoco.MjsGeom:
    half = segment.length / 2.0
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE
    size = (segment.radius, half, 0.0)
    bone = add_geom(body, name, kind, size, (half, 0.0, 0.0), segment.mass, colour)
    bone.quat = about((0, 1, 0), math.pi / 2.0)
    return bone
