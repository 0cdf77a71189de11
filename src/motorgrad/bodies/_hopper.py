"""The hopper: four links in a rhombus under a load on a slide, with a foot, two flexors and two extensors."""

import dataclasses
import math
from collections.abc import Mapping
from types import MappingProxyType

import mujoco
import numpy as np

from motorgrad._errors import check, choice
from motorgrad.bodies._body import MUSCLE_MODELS, START, add_muscles
from motorgrad.bodies._muscle import Attachment, Muscle, Wrap, groups_of, not_negative, positive
from motorgrad.bodies._scenery import add_scenery

LATERAL = ("symmetric", "spring")
SIDES = ("left", "right")
# Joint positions count from this interior angle of the knee, so that 0 everywhere is the start pose.
REFERENCE_ANGLE = math.pi / 2.0

_BONE = (0.90, 0.87, 0.80, 1.0)
_LOAD = (0.27, 0.30, 0.36, 1.0)
_FOOT = (0.36, 0.38, 0.44, 1.0)
_CAPSULE = (0.95, 0.95, 0.98, 0.35)


@dataclasses.dataclass(frozen=True)
class Hopper:
    """A planar hopper whose one controllable freedom is the angle of its knees (thesis, section 5.2).

    The load hangs on a vertical slide (the harness). From it two thighs lead to the knees and two shanks back together
    to the foot. Each knee has a flexor in front (inside the rhombus) and an extensor behind; the two flexors are one
    group and the two extensors the other, so an action is two numbers. x points to the right, z up, the plane is y = 0.

    **Arguments** (m, kg, N, s, rad unless said otherwise):

    - `load_mass`, `link_length`, `link_mass` (each of four), `foot_mass`.
    - `foot_size`: half-lengths (x, y, z) of the foot's box.
    - `knee_range`: least and greatest interior angle of a knee, **degrees**, with 0 < least < 90 < greatest < 180; the
      stop is stiff but not rigid.
    - `armature` (kg m²), `joint_damping` (N m s/rad): of every hinge; the slide is free.
    - `capsule_radius`: ρ of the sphere around each knee; `attachment_distance`: from the knee to a muscle's ends, on
      the bone.
    - `flexor_strength`, `flexor_rest_length`, `extensor_strength`, `extensor_rest_length`; `muscle_damping` (k_SE,
      N s/m), `muscle_shape` (k_CE).
    - `lateral`: "symmetric" holds the foot under the load; "spring" lets the body lean, against a spring.
    - `lateral_stiffness` (N m/rad), `lateral_damping` (N m s/rad): of that spring.
    - `timestep`: of the physics, s.
    - `muscle_model`: "thesis" (exact law, needs the callback) or "native" (MuJoCo's own muscle, an approximation).
    - `extra_muscles`: further muscles; a new group name makes a new component of the action.

    **Names in the model:** bodies `load`, `thigh_left`, `shank_left`, `foot`, `thigh_right`, `shank_right`, each
    link's frame at its upper joint with −z along the bone; joints `height`, `hip_left`, `knee_left`, `ankle`,
    `hip_right`, `knee_right`; at each knee a sphere `capsule_left` and the sites `front_left` and `behind_left`.

    **Sensors:** `knee_angle` (rad from 90°, positive when extended), `knee_velocity` (rad/s), `foot_height` (the
    underside above the floor, m), `foot_contact` (normal force on the foot, N), `load_height` (m).

    **Raises:** `ValueError` naming the field and what it may be.
    """

    load_mass: float = 2.0
    link_length: float = 0.25
    link_mass: float = 0.15
    foot_mass: float = 0.2
    foot_size: tuple[float, float, float] = (0.07, 0.05, 0.015)
    knee_range: tuple[float, float] = (40.0, 150.0)
    armature: float = 5e-4
    joint_damping: float = 0.005
    capsule_radius: float = 0.04
    attachment_distance: float = 0.12
    flexor_strength: float = 100.0
    flexor_rest_length: float = 0.13
    extensor_strength: float = 400.0
    extensor_rest_length: float = 0.25
    muscle_damping: float = 8.0
    muscle_shape: float = 0.5
    lateral: str = "symmetric"
    lateral_stiffness: float = 100.0
    lateral_damping: float = 1.0
    timestep: float = 0.001
    muscle_model: str = "thesis"
    extra_muscles: tuple[Muscle, ...] = ()

    def __post_init__(self) -> None:
        _check_fields(self)

    @property
    def muscles(self) -> tuple[Muscle, ...]:
        """Flexor and extensor of the left knee, then of the right, then the extra ones."""
        own = (self._muscle(group, side) for side in SIDES for group in ("flexor", "extensor"))
        return (*own, *self.extra_muscles)

    @property
    def groups(self) -> tuple[str, ...]:
        """("flexor", "extensor") and the groups of extra muscles."""
        return groups_of(self.muscles)

    @property
    def sensor_components(self) -> Mapping[str, int]:
        """Heights are the z of a position sensor."""
        return MappingProxyType({"foot_height": 2, "load_height": 2})

    def spec(self) -> mujoco.MjSpec:
        """A fresh, editable `mujoco.MjSpec` of the hopper, standing on the floor with its knees at 90°."""
        spec = mujoco.MjSpec()
        spec.modelname = "hopper"
        spec.compiler.degree = False
        _set_physics(spec, self.timestep)
        # the pose that all joint positions count from: knees at 90°, the foot's underside on the floor
        height = 2.0 * self.link_length * math.sin(REFERENCE_ANGLE / 2.0) + 2.0 * self.foot_size[2]
        load = _add_load(spec, self, height)
        add_scenery(spec, rail=(0.0, 0.14), target="load")
        for side in SIDES:
            _add_leg(load, self, side)
        _close_loop(spec, self)
        _add_sensors(spec)
        add_muscles(spec, self.muscles, self.muscle_model)
        spec.add_key(name=START, qpos=np.zeros(6))
        return spec

    def _muscle(self, group: str, side: str) -> Muscle:
        flexor = group == "flexor"
        return Muscle(
            name=f"{group}_{side}",
            group=group,
            origin=Attachment(f"thigh_{side}", (0.0, 0.0, self.attachment_distance - self.link_length)),
            insertion=Attachment(f"shank_{side}", (0.0, 0.0, -self.attachment_distance)),
            strength=self.flexor_strength if flexor else self.extensor_strength,
            rest_length=self.flexor_rest_length if flexor else self.extensor_rest_length,
            damping=self.muscle_damping,
            shape=self.muscle_shape,
            wrap=Wrap(f"capsule_{side}", f"{'front' if flexor else 'behind'}_{side}"),
        )


def _check_fields(hopper: Hopper) -> None:
    for name in (
        *("load_mass", "link_length", "link_mass", "foot_mass", "capsule_radius", "attachment_distance"),
        *("flexor_strength", "flexor_rest_length", "extensor_strength", "extensor_rest_length", "muscle_shape"),
        "timestep",
    ):
        positive(name, getattr(hopper, name))
    for name in ("armature", "joint_damping", "muscle_damping", "lateral_stiffness", "lateral_damping"):
        not_negative(name, getattr(hopper, name))
    size, limits = tuple(hopper.foot_size), tuple(hopper.knee_range)
    check(len(size) == 3, "foot_size", size, "three half-lengths (m)")
    for value in size:
        positive("foot_size", value)
    check(
        len(limits) == 2 and 0.0 < limits[0] < 90.0 < limits[1] < 180.0,
        "knee_range",
        limits,
        "(least, greatest) in degrees with 0 < least < 90 < greatest < 180",
    )
    check(
        hopper.capsule_radius < hopper.attachment_distance < hopper.link_length,
        "attachment_distance",
        hopper.attachment_distance,
        f"between capsule_radius {hopper.capsule_radius!r} and link_length {hopper.link_length!r} (m)",
    )
    choice("lateral", hopper.lateral, LATERAL)
    choice("muscle_model", hopper.muscle_model, MUSCLE_MODELS)
    extra = tuple(hopper.extra_muscles)
    for muscle in extra:
        check(isinstance(muscle, Muscle), "extra_muscles", muscle, "a tuple of Muscle")
    object.__setattr__(hopper, "foot_size", size)
    object.__setattr__(hopper, "knee_range", limits)
    object.__setattr__(hopper, "extra_muscles", extra)


def _set_physics(spec: mujoco.MjSpec, timestep: float) -> None:
    spec.option.timestep = timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON


def _add_load(spec: mujoco.MjSpec, hopper: Hopper, height: float) -> mujoco.MjsBody:
    load = spec.worldbody.add_body(name="load", pos=(0.0, 0.0, height))
    load.add_joint(name="height", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1))
    # drawn as a ball of aluminium of that mass, so that a heavier load looks heavier
    radius = (3.0 * hopper.load_mass / (4.0 * math.pi * 2700.0)) ** (1.0 / 3.0)
    _add_geom(load, "load", mujoco.mjtGeom.mjGEOM_SPHERE, (radius, 0, 0), (0, 0, 0), hopper.load_mass, _LOAD)
    load.add_site(name="harness", size=(0.01, 0.01, 0.01), group=4)
    return load


def _add_leg(load: mujoco.MjsBody, hopper: Hopper, side: str) -> None:
    """Thigh, shank and, on the left, the foot. Positive joint positions mean the same on both sides."""
    mirror = 1.0 if side == "left" else -1.0
    axis, length = (0.0, mirror, 0.0), hopper.link_length
    half = REFERENCE_ANGLE / 2.0
    thigh = load.add_body(name=f"thigh_{side}", quat=_about_y(mirror * half))
    _add_hinge(thigh, f"hip_{side}", axis, hopper)
    _add_link(thigh, f"thigh_{side}", hopper)
    shank = thigh.add_body(name=f"shank_{side}", pos=(0, 0, -length), quat=_about_y(-mirror * 2.0 * half))
    knee = _add_hinge(shank, f"knee_{side}", axis, hopper)
    knee.limited = True
    knee.range = [math.radians(angle) - REFERENCE_ANGLE for angle in hopper.knee_range]
    # stiff, or the knee swings through its singularity at 180°
    knee.solref_limit = (0.004, 1.0)
    knee.solimp_limit[:3] = (0.95, 0.99, 0.001)
    _add_link(shank, f"shank_{side}", hopper)
    _add_capsule(thigh, hopper, side, mirror)
    if side == "left":
        foot = shank.add_body(name="foot", pos=(0, 0, -length), quat=_about_y(mirror * half))
        _add_hinge(foot, "ankle", axis, hopper)
        _add_foot(foot, hopper)


def _add_capsule(thigh: mujoco.MjsBody, hopper: Hopper, side: str, mirror: float) -> None:
    """The knee's sphere, and a point on either side of it that tells MuJoCo which way round a muscle goes.

    The points sit in the middle of the arc: behind the knee when it is flexed most, in front of it when it is
    stretched. MuJoCo 4.0 lets the path snap to the other side where the point lies outside the cone between the bones
    as prolonged beyond the joint. That cone is as wide as the interior angle, so that a point which is within it in the
    most flexed knee always is; one square to the bone is not.
    """
    knee = np.array((0.0, 0.0, -hopper.link_length))
    size = (hopper.capsule_radius, 0, 0)
    _add_geom(thigh, f"capsule_{side}", mujoco.mjtGeom.mjGEOM_SPHERE, size, knee, 0.0, _CAPSULE)
    for name, interior, sign in (("front", math.radians(160.0), 1.0), ("behind", math.radians(hopper.knee_range[0]), -1.0)):
        # the bisector of the interior angle, seen from the knee; the thigh leads from the knee along +z
        bisector = np.array((mirror * math.sin(interior / 2.0), 0.0, math.cos(interior / 2.0)))
        position = knee + sign * 1.5 * hopper.capsule_radius * bisector
        thigh.add_site(name=f"{name}_{side}", pos=position, size=(0.004, 0.004, 0.004), group=4)


def _add_foot(foot: mujoco.MjsBody, hopper: Hopper) -> None:
    size = hopper.foot_size
    geom = _add_geom(foot, "foot", mujoco.mjtGeom.mjGEOM_BOX, size, (0, 0, -size[2]), hopper.foot_mass, _FOOT)
    geom.contype = 1
    geom.solref = (0.005, 1.0)
    foot.add_site(name="sole", pos=(0, 0, -2.0 * size[2]), size=(0.005, 0.005, 0.005), group=4)
    # the volume whose contacts the touch sensor adds up: the whole box and a margin
    sole = foot.add_site(name="foot_touch", pos=(0, 0, -size[2]), group=4)
    sole.type = mujoco.mjtGeom.mjGEOM_BOX
    sole.size = np.asarray(size) + 0.01


def _close_loop(spec: mujoco.MjSpec, hopper: Hopper) -> None:
    """Right shank to foot, foot square to the line from load to foot, and that line upright or on a spring.

    Equal links make the two knee angles equal by themselves once the loop is closed, but leave the rhombus free to
    swing about the load; what remains to hold is the lean, half the difference of the hips.
    """
    ankle = (0.0, 0.0, -hopper.link_length)
    connect = _add_equality(spec, mujoco.mjtEq.mjEQ_CONNECT, "shank_right", "foot")
    connect.objtype = mujoco.mjtObj.mjOBJ_BODY
    connect.data[:3] = ankle
    _add_joint_equality(spec, "ankle", "knee_left", -0.5)
    if hopper.lateral == "symmetric":
        _add_joint_equality(spec, "hip_right", "hip_left", 1.0)
    else:
        lean = spec.add_tendon(
            name="lean", stiffness=hopper.lateral_stiffness, damping=hopper.lateral_damping, springlength=(0.0, 0.0)
        )
        lean.wrap_joint("hip_left", 0.5)
        lean.wrap_joint("hip_right", -0.5)


def _add_joint_equality(spec: mujoco.MjSpec, follower: str, leader: str, ratio: float) -> None:
    equality = _add_equality(spec, mujoco.mjtEq.mjEQ_JOINT, follower, leader)
    equality.data[:5] = (0.0, ratio, 0.0, 0.0, 0.0)


def _add_equality(spec: mujoco.MjSpec, kind: mujoco.mjtEq, first: str, second: str) -> mujoco.MjsEquality:
    equality = spec.add_equality(name=f"{first}_{second}", type=kind, name1=first, name2=second)
    equality.solref = (0.003, 1.0)
    return equality


def _add_sensors(spec: mujoco.MjSpec) -> None:
    kinds, objects = mujoco.mjtSensor, mujoco.mjtObj
    for name, kind, object_kind, of in (
        ("knee_angle", kinds.mjSENS_JOINTPOS, objects.mjOBJ_JOINT, "knee_left"),
        ("knee_velocity", kinds.mjSENS_JOINTVEL, objects.mjOBJ_JOINT, "knee_left"),
        ("foot_height", kinds.mjSENS_FRAMEPOS, objects.mjOBJ_SITE, "sole"),
        ("foot_contact", kinds.mjSENS_TOUCH, objects.mjOBJ_SITE, "foot_touch"),
        ("load_height", kinds.mjSENS_FRAMEPOS, objects.mjOBJ_SITE, "harness"),
    ):
        spec.add_sensor(name=name, type=kind, objtype=object_kind, objname=of)


def _add_hinge(body: mujoco.MjsBody, name: str, axis: tuple, hopper: Hopper) -> mujoco.MjsJoint:
    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, armature=hopper.armature)
    joint.damping[0] = hopper.joint_damping
    return joint


def _add_link(body: mujoco.MjsBody, name: str, hopper: Hopper) -> None:
    half = hopper.link_length / 2.0
    size = (0.05 * hopper.link_length, half, 0.0)
    _add_geom(body, name, mujoco.mjtGeom.mjGEOM_CAPSULE, size, (0, 0, -half), hopper.link_mass, _BONE)


def _add_geom(body, name, kind, size, position, mass, colour) -> mujoco.MjsGeom:
    """A geom that touches nothing unless told to."""
    return body.add_geom(
        name=name, type=kind, size=size, pos=position, mass=mass, rgba=colour, contype=0, conaffinity=0
    )


def _about_y(angle: float) -> tuple[float, float, float, float]:
    return (math.cos(angle / 2.0), 0.0, math.sin(angle / 2.0), 0.0)
