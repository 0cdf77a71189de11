"""The arm: a lower arm with a load in the hand, hanging from a fixed upper arm and bent by one straight flexor.

The thesis's upper arm is "held by a harness at right angles", and its figure 4.5 is not at hand. Two readings are
possible: at right angles to the ground, or to the lower arm, which hangs. More of the text agrees with the first, the
vertical upper arm, so it is the default:

- Section 4.3.2 says that the torque is greater than zero because the muscle's ends are offset. Of a straight lower arm
  that is so: the moment arm is the offset, 2 cm. At a right angle it is 12 cm, and 11 cm without any offset.
- It says that the mechanical advantage is least at full extension, and passes through a right angle of the joint. Only
  from a vertical upper arm does the elbow start at full extension.
- It says that too little force fails to lift the load. Below a vertical upper arm, less and less force holds the load
  once the elbow is bent by some 55°, so that a load is lifted to the top or to less than half of it; below a horizontal
  one, every force lifts in proportion.
- Section 4.4 says that a large pool that sees only large loads falls silent. With a reward for height, that follows
  from a lift that is all or nothing, and does not from one in proportion.

That the advantage is least at full flexion, too, is true of neither: with both ends half way along bones of equal
length, the moment arm of a straight muscle is greatest there.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, get_args

import mujoco
import numpy as np

from motorgrad._errors import check
from motorgrad.bodies._body import START, add_geom, add_muscles, add_scenery, add_sensors
from motorgrad.bodies.muscles._muscle import Attachment, Muscle, groups_of
from motorgrad.schema import Settings, number, static

Posture = Literal["vertical", "horizontal"]
"""How the upper arm is held."""
POSTURES: tuple[Posture, ...] = get_args(Posture)
HANGING: Mapping[Posture, float] = MappingProxyType({"vertical": 180.0, "horizontal": 90.0})
"""Degrees between the bones when the lower arm hangs."""
STRENGTH: Mapping[Posture, float] = MappingProxyType({"vertical": 371.6, "horizontal": 164.6})
"""Force in N that just lifts 14 kg to the top."""
GRAVITY = 9.81
MAX_TIMESTEP = 0.01  # s; flexions are accurate to 5e-4 rad with it, and to 2e-2 with ten times that
_WAY = 2001  # flexions at which the greatest force on the way is looked for: it is exact to 1e-6
_BONE = (0.90, 0.87, 0.80, 1.0)
_LOAD = (0.27, 0.30, 0.36, 1.0)
_HARNESS = (0.55, 0.58, 0.62, 1.0)


@dataclasses.dataclass(frozen=True)
class Arm(Settings):
    """An arm with one degree of freedom that lifts a load (thesis, section 4.3.2 and figure 4.5).

    A harness holds the upper arm, vertical or horizontal: the thesis's "at right angles" can be read as either. The
    lower arm hangs from the elbow, with the load in its hand. One flexor bends it upwards: a straight line from the
    middle of one bone to the middle of the other. Both ends are offset from the bones towards the inside of the elbow,
    so that the muscle never pulls along a bone. Its force does not depend on its length. The lower arm bends towards
    −x, z points up, and the plane is y = 0.

    Below a vertical upper arm the elbow bends from 180°, where the muscle's moment arm is only the offset. Once it is
    bent by some 55°, less and less force holds the load, so the arm snaps: a force lifts the load to the top, or less
    than half of that. Below a horizontal one it bends from 90°, where the moment arm is already four fifths of its
    greatest, and the load is lifted the higher, the greater the force.

    **Names in the model:** bodies `upper_arm`, `lower_arm` (frame at the elbow, −z along the bone when it hangs); joint
    `elbow`, 0 when the lower arm hangs, positive when bent; tendon and actuator `flexor`; site `hand`.

    **Sensors:** `flexion` (rad from hanging), `flexion_velocity` (rad/s), `hand_height` (m above the floor).
    """

    load: float = number(5.0, 0, unit="kg", help="mass in the hand")
    bone_length: float = number(0.3, 0, open_low=True, unit="m", help="length of each of the two bones")
    lower_mass: float = number(1.0, 0, open_low=True, unit="kg", help="mass of the lower arm, evenly distributed")
    strength: float | None = number(
        None,
        0,
        open_low=True,
        unit="N",
        help="the muscle's force at full activation. By default just enough to lift 14 kg to the top with bones, "
        "offset and stop as they are by default: 371.6 N with a vertical upper arm, 164.6 N with a horizontal one",
    )
    offset: float = number(0.02, 0, unit="m", help="distance of the muscle's ends from the bones")
    least_angle: float = number(
        20.0,
        unit="degrees",
        help="the interior angle of the elbow at the stop, less than where it hangs. The muscle's ends would "
        "meet at 2 atan(2 `offset` / `bone_length`), and the stop must come before",
    )
    joint_damping: float = number(0.02, 0, unit="N m s/rad", help="damping of the elbow")
    elbow_height: float = number(0.6, 0, open_low=True, unit="m", help="height above the floor, which nothing touches")
    timestep: float = number(0.001, 0, MAX_TIMESTEP, open_low=True, unit="s", help="time step of the physics")
    posture: Posture = static(
        "vertical",
        help="how the upper arm is held. More of the thesis's text agrees with vertical: the torque above zero only "
        "because of the offset, full extension, loads that are lifted or not, and large pools that fall silent "
        "(section 4.4)",
    )

    def validate(self) -> None:
        meet = math.degrees(2.0 * math.atan(2.0 * self.offset / self.bone_length))
        allowed = f"between {meet:.4g} degrees, where the muscle's ends would meet, and {self.hanging:g} degrees"
        check(meet < self.least_angle < self.hanging, "least_angle", self.least_angle, allowed)

    @property
    def full_force(self) -> float:
        """The muscle's force in N at full activation: `strength`, or its default for the posture."""
        return STRENGTH[self.posture] if self.strength is None else self.strength

    @property
    def hanging(self) -> float:
        """The interior angle of the elbow in degrees when the lower arm hangs: 180 or 90."""
        return HANGING[self.posture]

    @property
    def muscles(self) -> tuple[Muscle, ...]:
        """The flexor."""
        half = self.bone_length / 2.0
        origin = (-self.offset, 0.0, half) if self.posture == "vertical" else (-half, 0.0, -self.offset)
        return (
            Muscle(
                name="flexor",
                group="flexor",
                origin=Attachment("upper_arm", origin),
                insertion=Attachment("lower_arm", (-self.offset, 0.0, -half)),
                strength=self.full_force,
                rest_length=float(self.muscle_length(0.0)),
                damping=0.0,
                shape=math.inf,
            ),
        )

    @property
    def groups(self) -> tuple[str, ...]:
        """("flexor",)."""
        return groups_of(self.muscles)

    @property
    def sensor_components(self) -> Mapping[str, int]:
        """The hand's height is the z component of a position sensor."""
        return MappingProxyType({"hand_height": 2})

    @property
    def most_flexion(self) -> float:
        """The flexion at the stop, in rad."""
        return math.radians(self.hanging - self.least_angle)

    def muscle_length(self, flexion: float | np.ndarray) -> float | np.ndarray:
        """Length of the muscle in m at a flexion in rad."""
        return 2.0 * self._reach * np.sin(self._between(flexion) / 2.0)

    def moment_arm(self, flexion: float | np.ndarray) -> float | np.ndarray:
        """Moment arm of the muscle about the elbow in m: minus the derivative of `muscle_length`."""
        return self._reach * np.cos(self._between(flexion) / 2.0)

    def rise(self, flexion: float | np.ndarray) -> float | np.ndarray:
        """Height of the hand above its hanging position, in m."""
        return self.bone_length * (1.0 - np.cos(flexion))

    @property
    def weight_moment(self) -> float:
        """Greatest moment about the elbow of the weight of load and lower arm, N m: that at a flexion of 90°."""
        return GRAVITY * self.bone_length * (self.load + self.lower_mass / 2.0)

    def balance(self, flexion: float | np.ndarray) -> float | np.ndarray:
        """The force in N that holds the arm still at a flexion."""
        return self.weight_moment * np.sin(flexion) / self.moment_arm(flexion)

    def ballistic_force(self, flexion: float | np.ndarray) -> float | np.ndarray:
        """The constant force in N that takes the arm from rest just to a flexion without friction: the muscle's work
        equals the gain in potential energy."""
        return self.weight_moment * (1.0 - np.cos(flexion)) / (self.muscle_length(0.0) - self.muscle_length(flexion))

    @property
    def throwing_force(self) -> float:
        """The constant force in N that takes the arm from rest just to the stop without friction: the greatest
        `ballistic_force` on the way, which need not be that of the stop."""
        way = self.most_flexion * np.linspace(0.0, 1.0, _WAY)[1:]
        return float(np.max(self.ballistic_force(way)))

    def spec(self) -> mujoco.MjSpec:
        """A new, editable `mujoco.MjSpec` of the arm, hanging at rest."""
        spec = mujoco.MjSpec()
        spec.modelname = "arm"
        spec.compiler.degree = False
        spec.option.timestep = self.timestep
        spec.option.gravity = (0.0, 0.0, -GRAVITY)
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        self._add_bones(spec)
        across = 0.0 if self.posture == "vertical" else -self.bone_length
        add_scenery(spec, rail=(across, 0.06), target="upper_arm")
        add_sensors(spec, "JOINTPOS", "JOINT", {"flexion": "elbow"})
        add_sensors(spec, "JOINTVEL", "JOINT", {"flexion_velocity": "elbow"})
        add_sensors(spec, "FRAMEPOS", "SITE", {"hand_height": "hand"})
        add_muscles(spec, self.muscles)
        spec.add_key(name=START, qpos=np.zeros(1))
        return spec

    @property
    def _reach(self) -> float:
        """Distance from the elbow to either end of the muscle, in m."""
        return math.hypot(self.bone_length / 2.0, self.offset)

    def _between(self, flexion: float | np.ndarray) -> float | np.ndarray:
        """The angle at the elbow between the muscle's ends, in rad."""
        return math.radians(self.hanging) - flexion - 2.0 * math.atan(2.0 * self.offset / self.bone_length)

    def _add_bones(self, spec: mujoco.MjSpec) -> None:
        length = self.bone_length
        thick = 0.05 * self.bone_length
        capsule, sphere, box = mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX
        upper = spec.worldbody.add_body(name="upper_arm", pos=(0.0, 0.0, self.elbow_height))
        upright = self.posture == "vertical"
        shoulder = np.array((0.0, 0.0, length) if upright else (-length, 0.0, 0.0))
        add_geom(upper, "harness", box, (0.02, 0.04, 0.05), shoulder, 0.0, _HARNESS)
        bone = add_geom(upper, "upper_arm", capsule, (thick, length / 2.0, 0.0), shoulder / 2.0, 0.0, _BONE)
        bone.quat = (1.0, 0.0, 0.0, 0.0) if upright else (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
        lower = upper.add_body(name="lower_arm")
        elbow = lower.add_joint(name="elbow", type=mujoco.mjtJoint.mjJNT_HINGE, axis=(0, 1, 0))
        elbow.damping[0] = self.joint_damping
        elbow.limited = True
        # an elbow that hangs straight does not bend the other way
        elbow.range = (0.0 if upright else -math.pi, self.most_flexion)
        elbow.solref_limit = (0.004, 1.0)
        elbow.solimp_limit[:3] = (0.95, 0.99, 0.001)
        size = (thick, length / 2.0, 0.0)
        add_geom(lower, "lower_arm", capsule, size, (0.0, 0.0, -length / 2.0), self.lower_mass, _BONE)
        # drawn as an iron ball of that mass, so that a heavier load looks heavier
        radius = max((3.0 * self.load / (4.0 * math.pi * 7870.0)) ** (1.0 / 3.0), 1e-3)
        add_geom(lower, "load", sphere, (radius, 0.0, 0.0), (0.0, 0.0, -length), self.load, _LOAD)
        lower.add_site(name="hand", pos=(0.0, 0.0, -length), size=(0.01, 0.01, 0.01), group=4)
