"""The arm: a lower arm with a load in the hand, hanging from a fixed upper arm and bent by one straight flexor."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
import math
from collections.abc import Mapping
from types import MappingProxyType

import mujoco
import numpy as np

from motorgrad._errors import check, check_not_negative, check_positive
from motorgrad.bodies._body import START, add_geom, add_muscles, add_scenery, add_sensors
from motorgrad.bodies.muscles._muscle import Attachment, Muscle, groups_of

HANGING = 90.0  # degrees between the bones when the lower arm hangs, as the upper arm is level
GRAVITY = 9.81
COARSEST = 0.01  # s, the largest time step; flexions are accurate to 5e-4 rad with it, and to 2e-2 with ten times that
_BONE = (0.90, 0.87, 0.80, 1.0)
_LOAD = (0.27, 0.30, 0.36, 1.0)
_HARNESS = (0.55, 0.58, 0.62, 1.0)


@dataclasses.dataclass(frozen=True)
class Arm:
    """An arm with one degree of freedom that lifts a load (thesis, section 4.3.2 and figure 4.5).

    A harness holds the upper arm level. The lower arm hangs from the elbow, with the load in its hand. One flexor bends
    it upwards: a straight line from the middle of one bone to the middle of the other. Both ends are offset from the
    bones towards the inside of the elbow, so that the muscle never pulls along a bone. Its force does not depend on its
    length. x points from the shoulder to the elbow, z up, and the plane is y = 0.

    **Arguments:**

    - `load` (kg): mass in the hand, at least 0.
    - `bone_length` (m): length of each of the two bones.
    - `lower_mass` (kg): mass of the lower arm, evenly distributed.
    - `strength` (N): the muscle's force at full activation. The default is just enough to lift 14 kg to the top.
    - `offset` (m): distance of the muscle's ends from the bones.
    - `least_angle` (degrees): the interior angle of the elbow at the stop. The muscle's ends would meet at 2 atan(2
      `offset` / `bone_length`), and the stop must come before.
    - `joint_damping` (N m s/rad): damping of the elbow.
    - `elbow_height` (m): height above the floor, which nothing touches.
    - `timestep` (s): time step of the physics, at most 0.01.

    **Names in the model:** bodies `upper_arm`, `lower_arm` (frame at the elbow, −z along the bone when it hangs); joint
    `elbow`, 0 when the lower arm hangs, positive when bent; tendon and actuator `flexor`; site `hand`.

    **Sensors:** `flexion` (rad from hanging), `flexion_velocity` (rad/s), `hand_height` (m above the floor).

    **Raises:** `ValueError` naming the field and what it may be.
    """

    load: float = 5.0
    bone_length: float = 0.3
    lower_mass: float = 1.0
    strength: float = 164.6
    offset: float = 0.02
    least_angle: float = 20.0
    joint_damping: float = 0.02
    elbow_height: float = 0.6
    timestep: float = 0.001

    def __post_init__(self) -> None:
        for name in ("bone_length", "lower_mass", "strength", "elbow_height", "timestep"):
            check_positive(name, getattr(self, name))
        for name in ("load", "offset", "joint_damping"):
            check_not_negative(name, getattr(self, name))
        check(self.timestep <= COARSEST, "timestep", self.timestep, f"a finite number > 0 and at most {COARSEST:g} s")
        meet = math.degrees(2.0 * math.atan(2.0 * self.offset / self.bone_length))
        allowed = f"an interior angle between {meet:.4g}, where the muscle's ends would meet, and {HANGING:g} degrees"
        check(meet < self.least_angle < HANGING, "least_angle", self.least_angle, allowed)

    @property
    def muscles(self) -> tuple[Muscle, ...]:
        """The flexor."""
        half = self.bone_length / 2.0
        return (
            Muscle(
                name="flexor",
                group="flexor",
                origin=Attachment("upper_arm", (-half, 0.0, -self.offset)),
                insertion=Attachment("lower_arm", (-self.offset, 0.0, -half)),
                strength=self.strength,
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
        return math.radians(HANGING - self.least_angle)

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

    def spec(self) -> mujoco.MjSpec:
        """A new, editable `mujoco.MjSpec` of the arm, hanging at rest."""
        spec = mujoco.MjSpec()
        spec.modelname = "arm"
        spec.compiler.degree = False
        spec.option.timestep = self.timestep
        spec.option.gravity = (0.0, 0.0, -GRAVITY)
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        self._add_bones(spec)
        add_scenery(spec, rail=(-self.bone_length, 0.06), target="upper_arm")
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
        return math.radians(HANGING) - flexion - 2.0 * math.atan(2.0 * self.offset / self.bone_length)

    def _add_bones(self, spec: mujoco.MjSpec) -> None:
        length, thick = self.bone_length, 0.05 * self.bone_length
        capsule, sphere, box = mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX
        upper = spec.worldbody.add_body(name="upper_arm", pos=(0.0, 0.0, self.elbow_height))
        level = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
        add_geom(upper, "harness", box, (0.02, 0.04, 0.05), (-length, 0.0, 0.0), 0.0, _HARNESS)
        bone = add_geom(upper, "upper_arm", capsule, (thick, length / 2.0, 0.0), (-length / 2.0, 0.0, 0.0), 0.0, _BONE)
        bone.quat = level
        lower = upper.add_body(name="lower_arm")
        elbow = lower.add_joint(name="elbow", type=mujoco.mjtJoint.mjJNT_HINGE, axis=(0, 1, 0))
        elbow.damping[0] = self.joint_damping
        elbow.limited = True
        elbow.range = (-math.pi, self.most_flexion)
        elbow.solref_limit = (0.004, 1.0)
        elbow.solimp_limit[:3] = (0.95, 0.99, 0.001)
        size = (thick, length / 2.0, 0.0)
        add_geom(lower, "lower_arm", capsule, size, (0.0, 0.0, -length / 2.0), self.lower_mass, _BONE)
        # drawn as an iron ball of that mass, so that a heavier load looks heavier
        radius = max((3.0 * self.load / (4.0 * math.pi * 7870.0)) ** (1.0 / 3.0), 1e-3)
        add_geom(lower, "load", sphere, (radius, 0.0, 0.0), (0.0, 0.0, -length), self.load, _LOAD)
        lower.add_site(name="hand", pos=(0.0, 0.0, -length), size=(0.01, 0.01, 0.01), group=4)
