"""The hopper: four links in a rhombus under a load on a slide, with a foot, two flexors and two extensors."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import mujoco
import numpy as np

from motorgrad._errors import check
from motorgrad.bodies._body import START, add_geom, add_muscles, add_paths, add_scenery, add_sensors
from motorgrad.bodies.muscles._hill import Curves, Hill, HillMuscle, Tendon
from motorgrad.bodies.muscles._muscle import (
    Attachment,
    Motor,
    Muscle,
    Wrap,
    add_motors,
    contraction_work,
    groups_of,
)
from motorgrad.bodies.muscles._wrapping import away_angle, wrapped_length
from motorgrad.schema import Range, Settings, number, static

SIDES = ("left", "right")
# Joint positions are relative to this interior angle of the knee, so that 0 everywhere is the start pose.
REFERENCE_ANGLE = math.pi / 2.0
_BONE = (0.90, 0.87, 0.80, 1.0)
_LOAD = (0.27, 0.30, 0.36, 1.0)
_FOOT = (0.36, 0.38, 0.44, 1.0)
_CAPSULE = (0.95, 0.95, 0.98, 0.35)


@dataclasses.dataclass(frozen=True)
class Hopper(Settings):
    """A planar hopper whose only controllable degree of freedom is the angle of its knees (thesis, section 5.2).

    The load moves on a vertical slide (the harness). Two thighs lead from it to the knees, and two shanks from there to
    the foot. Each knee has a flexor in front (inside the rhombus) and an extensor behind. The two flexors form one
    group and the two extensors another, so an action has two numbers. With `drive="motors"` each muscle is a motor at
    its knee instead, of the same name and group. x points to the right, z up, and the plane is y = 0.

    **Names in the model:** bodies `load`, `thigh_left`, `shank_left`, `foot`, `thigh_right`, `shank_right`, with each
    link's frame at its upper joint and −z along the bone; joints `height`, `hip_left`, `knee_left`, `ankle`,
    `hip_right`, `knee_right`; at each knee a sphere `capsule_left` and the sites `front_left` and `behind_left`.

    **Sensors:** `knee_angle` (rad from 90°, positive when extended), `knee_velocity` (rad/s), `foot_height` (of the
    underside above the floor, m), `foot_contact` (normal force on the foot, N), `load_height` (m).
    """

    load_mass: float = number(2.0, 0, open_low=True, unit="kg", help="mass of the load on the slide")
    link_length: float = number(0.25, 0, open_low=True, unit="m", help="length of each of the four links")
    link_mass: float = number(0.15, 0, open_low=True, unit="kg", help="mass of each of the four links")
    foot_mass: float = number(0.2, 0, open_low=True, unit="kg", help="mass of the foot")
    foot_size: tuple[float, float, float] = static(
        (0.07, 0.05, 0.015), allowed=Range(0, open_low=True), unit="m", help="half-lengths (x, y, z) of the foot's box"
    )
    knee_range: tuple[float, float] = static(
        (40.0, 150.0),
        allowed=Range(0, 180, open_low=True, open_high=True),
        unit="degrees",
        help="least and greatest interior angle of a knee, with 90 in between; the stop is stiff but not rigid",
    )
    armature: float = number(5e-4, 0, unit="kg m²", help="armature of every hinge")
    joint_damping: float = number(0.005, 0, unit="N m s/rad", help="damping of every hinge; the slide is free")
    capsule_radius: float = number(0.04, 0, open_low=True, unit="m", help="radius ρ of the sphere around each knee")
    attachment_distance: float = number(
        0.12, 0, open_low=True, unit="m", help="distance from the knee to a muscle's ends, along the bone"
    )
    flexor_strength: float = number(100.0, 0, open_low=True, unit="N", help="greatest contractile force of a flexor")
    flexor_rest_length: float = number(
        0.13, 0, open_low=True, unit="m", help="length at which a flexor reaches that force"
    )
    extensor_strength: float = number(
        400.0, 0, open_low=True, unit="N", help="greatest contractile force of an extensor"
    )
    extensor_rest_length: float = number(
        0.25, 0, open_low=True, unit="m", help="length at which an extensor reaches that force"
    )
    muscle_damping: float = number(8.0, 0, unit="N s/m", help="damping k_SE of every muscle")
    muscle_shape: float = number(
        0.5, 0, open_low=True, help="shape k_CE of every muscle; larger values flatten the force–length curve"
    )
    lateral: Literal["symmetric", "spring"] = static(
        "symmetric", help='"symmetric" holds the foot under the load; "spring" lets the body lean against a spring'
    )
    lateral_stiffness: float = number(100.0, 0, unit="N m/rad", help="stiffness of the lateral spring")
    lateral_damping: float = number(1.0, 0, unit="N m s/rad", help="damping of the lateral spring")
    drive: Literal["muscles", "motors"] = static(
        "muscles",
        help='"muscles"; or "motors", each of which does the work of its muscle between the stops of the knee with a '
        "torque that depends on nothing but its control; the muscles' dampers stay",
    )
    timestep: float = number(0.001, 0, open_low=True, unit="s", help="time step of the physics")
    muscle_model: Literal["thesis", "native", "hill"] = static(
        "thesis",
        help='"thesis" (exact law, needs the callback), "native" (MuJoCo\'s own muscle, an approximation) or "hill": '
        "Hill-type muscles of the same strengths, with fibers that suit their paths (`Hill.spanning`); the rest "
        "lengths, `muscle_damping` and `muscle_shape` then have no meaning",
    )
    tendon: Tendon = static("compliant", help="the tendons of Hill-type muscles")
    curves: Curves = static("de-groote", help="the curves of Hill-type muscles")
    extra_muscles: tuple[Muscle, ...] = static(
        (), help="further muscles; a new group name adds a component to the action"
    )

    def validate(self) -> None:
        least, greatest = self.knee_range
        check(least < 90 < greatest, "knee_range", self.knee_range, "(least, greatest) with 90 degrees in between")
        reach, radius, length = self.attachment_distance, self.capsule_radius, self.link_length
        allowed = f"between capsule_radius {radius!r} and link_length {length!r} (m)"
        check(radius < reach < length, "attachment_distance", reach, allowed)
        right = self.drive == "muscles" or self.muscle_model == "thesis"
        check(right, "muscle_model", self.muscle_model, "'thesis' with motors, whose torque follows from its law")

    @property
    def muscles(self) -> tuple[Muscle | HillMuscle, ...]:
        """Flexor and extensor of the left knee, then of the right knee, unless motors drive them; then the extra
        muscles."""
        return (*(self._own_muscles if self.drive == "muscles" else ()), *self.extra_muscles)

    @property
    def motors(self) -> tuple[Motor, ...]:
        """Flexor and extensor of the left knee, then of the right knee; empty for a body with muscles.

        The torque of each is the mean of its muscle's torque over the range of the knee, so that both do the same work
        from one stop to the other.
        """
        if self.drive == "muscles":
            return ()
        torques = {"flexor": -self._mean_torque("flexor"), "extensor": self._mean_torque("extensor")}
        return tuple(
            Motor(f"{group}_{side}", group, f"knee_{side}", torque)
            for side in SIDES
            for group, torque in torques.items()
        )

    @property
    def actuators(self) -> tuple[Muscle | HillMuscle | Motor, ...]:
        """Motors, if any, then muscles."""
        return (*self.motors, *self.muscles)

    @property
    def groups(self) -> tuple[str, ...]:
        """("flexor", "extensor"), then the groups of extra muscles."""
        return groups_of(self.actuators)

    @property
    def sensor_components(self) -> Mapping[str, int]:
        """Heights are the z component of a position sensor."""
        return MappingProxyType({"foot_height": 2, "load_height": 2})

    def spec(self) -> mujoco.MjSpec:
        """A new, editable `mujoco.MjSpec` of the hopper, standing on the floor with its knees at 90°."""
        spec = _skeleton(self)
        if self.motors:
            add_paths(spec, self._own_muscles)
            add_motors(spec, self.motors)
        if self.muscles:
            add_muscles(spec, self.muscles, "thesis" if self.muscle_model == "hill" else self.muscle_model)
        spec.add_key(name=START, qpos=np.zeros(6))
        return spec

    @property
    def _own_muscles(self) -> tuple[Muscle | HillMuscle, ...]:
        return tuple(self._muscle(group, side) for side in SIDES for group in ("flexor", "extensor"))

    def _span(self, group: str) -> tuple[float, float]:
        """The least and the greatest length (m) of a muscle between the stops of the knee."""
        angles = away_angle(np.radians(self.knee_range), behind=group == "extensor")
        reach = self.attachment_distance
        low, high = sorted(wrapped_length(angles, reach, reach, self.capsule_radius).tolist())
        return low, high

    def _mean_torque(self, group: str) -> float:
        """The mean torque (N m) of an active muscle over the range of the knee: its work divided by the angle."""
        strength, rest = (getattr(self, f"{group}_{name}") for name in ("strength", "rest_length"))
        work = contraction_work(*self._span(group), strength, rest, self.muscle_shape)
        return work / math.radians(self.knee_range[1] - self.knee_range[0])

    def _muscle(self, group: str, side: str) -> Muscle | HillMuscle:
        flexor = group == "flexor"
        reach = self.attachment_distance
        origin = Attachment(f"thigh_{side}", (0.0, 0.0, reach - self.link_length))
        insertion = Attachment(f"shank_{side}", (0.0, 0.0, -reach))
        wrap = Wrap(f"capsule_{side}", f"{'front' if flexor else 'behind'}_{side}")
        strength = self.flexor_strength if flexor else self.extensor_strength
        if self.muscle_model == "hill":
            hill = Hill.spanning(self._span(group), strength, tendon=self.tendon, curves=self.curves)
            return HillMuscle(f"{group}_{side}", group, origin, insertion, hill, wrap)
        return Muscle(
            name=f"{group}_{side}",
            group=group,
            origin=origin,
            insertion=insertion,
            strength=strength,
            rest_length=self.flexor_rest_length if flexor else self.extensor_rest_length,
            damping=self.muscle_damping,
            shape=self.muscle_shape,
            wrap=wrap,
        )


def _skeleton(hopper: Hopper) -> mujoco.MjSpec:
    """The hopper without muscles and keyframe, with its knees at 90° and the foot's underside on the floor."""
    spec = mujoco.MjSpec()
    spec.modelname = "hopper"
    spec.compiler.degree = False
    spec.option.timestep = hopper.timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    height = 2.0 * hopper.link_length * math.sin(REFERENCE_ANGLE / 2.0) + 2.0 * hopper.foot_size[2]
    load = _add_load(spec, hopper, height)
    add_scenery(spec, rail=(0.0, 0.14), target="load")
    for side in SIDES:
        _add_leg(load, hopper, side)
    _close_loop(spec, hopper)
    add_sensors(spec, "JOINTPOS", "JOINT", {"knee_angle": "knee_left"})
    add_sensors(spec, "JOINTVEL", "JOINT", {"knee_velocity": "knee_left"})
    add_sensors(spec, "FRAMEPOS", "SITE", {"foot_height": "sole"})
    add_sensors(spec, "TOUCH", "SITE", {"foot_contact": "foot_touch"})
    add_sensors(spec, "FRAMEPOS", "SITE", {"load_height": "harness"})
    return spec


def _add_load(spec: mujoco.MjSpec, hopper: Hopper, height: float) -> mujoco.MjsBody:
    load = spec.worldbody.add_body(name="load", pos=(0.0, 0.0, height))
    load.add_joint(name="height", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1))
    # drawn as an aluminium ball of that mass, so that a heavier load looks heavier
    radius = (3.0 * hopper.load_mass / (4.0 * math.pi * 2700.0)) ** (1.0 / 3.0)
    add_geom(load, "load", mujoco.mjtGeom.mjGEOM_SPHERE, (radius, 0, 0), (0, 0, 0), hopper.load_mass, _LOAD)
    load.add_site(name="harness", size=(0.01, 0.01, 0.01), group=4)
    return load


def _add_leg(load: mujoco.MjsBody, hopper: Hopper, side: str) -> None:
    """Add thigh, shank and, on the left, the foot. Positive joint positions have the same meaning on both sides."""
    mirror = 1.0 if side == "left" else -1.0
    axis = (0.0, mirror, 0.0)
    length = hopper.link_length
    half = REFERENCE_ANGLE / 2.0
    thigh = load.add_body(name=f"thigh_{side}", quat=_about_y(mirror * half))
    _add_hinge(thigh, f"hip_{side}", axis, hopper)
    _add_link(thigh, f"thigh_{side}", hopper)
    shank = thigh.add_body(name=f"shank_{side}", pos=(0, 0, -length), quat=_about_y(-mirror * 2.0 * half))
    knee = _add_hinge(shank, f"knee_{side}", axis, hopper)
    knee.limited = True
    knee.range = [math.radians(angle) - REFERENCE_ANGLE for angle in hopper.knee_range]
    # stiff, or the knee would swing through its singularity at 180°
    knee.solref_limit = (0.004, 1.0)
    knee.solimp_limit[:3] = (0.95, 0.99, 0.001)
    _add_link(shank, f"shank_{side}", hopper)
    _add_capsule(thigh, hopper, side, mirror)
    if side == "left":
        foot = shank.add_body(name="foot", pos=(0, 0, -length), quat=_about_y(mirror * half))
        _add_hinge(foot, "ankle", axis, hopper)
        _add_foot(foot, hopper)


def _add_capsule(thigh: mujoco.MjsBody, hopper: Hopper, side: str, mirror: float) -> None:
    """Add the knee's sphere, and a site on either side of it that tells MuJoCo which way a muscle passes.

    The sites are at the middle of the arc: behind the knee for the most flexed pose, in front of it for the most
    extended. In MuJoCo 4.0 the path snaps to the other side if the site lies outside the cone between the bones,
    extended beyond the joint. That cone is as wide as the interior angle, so a site inside it at the most flexed pose
    always is; one perpendicular to the bone is not.
    """
    knee = np.array((0.0, 0.0, -hopper.link_length))
    size = (hopper.capsule_radius, 0, 0)
    add_geom(thigh, f"capsule_{side}", mujoco.mjtGeom.mjGEOM_SPHERE, size, knee, 0.0, _CAPSULE)
    for name, interior, sign in (
        ("front", math.radians(160.0), 1.0),
        ("behind", math.radians(hopper.knee_range[0]), -1.0),
    ):
        # the bisector of the interior angle, from the knee; the thigh points along +z from there
        bisector = np.array((mirror * math.sin(interior / 2.0), 0.0, math.cos(interior / 2.0)))
        position = knee + sign * 1.5 * hopper.capsule_radius * bisector
        thigh.add_site(name=f"{name}_{side}", pos=position, size=(0.004, 0.004, 0.004), group=4)


def _add_foot(foot: mujoco.MjsBody, hopper: Hopper) -> None:
    size = hopper.foot_size
    geom = add_geom(foot, "foot", mujoco.mjtGeom.mjGEOM_BOX, size, (0, 0, -size[2]), hopper.foot_mass, _FOOT)
    geom.contype = 1
    geom.solref = (0.005, 1.0)
    foot.add_site(name="sole", pos=(0, 0, -2.0 * size[2]), size=(0.005, 0.005, 0.005), group=4)
    # the touch sensor sums the contacts within this volume: the whole box and a margin
    sole = foot.add_site(name="foot_touch", pos=(0, 0, -size[2]), group=4)
    sole.type = mujoco.mjtGeom.mjGEOM_BOX
    sole.size = np.asarray(size) + 0.01


def _close_loop(spec: mujoco.MjSpec, hopper: Hopper) -> None:
    """Connect the right shank to the foot, keep the foot perpendicular to the line from load to foot, and hold that
    line upright or on a spring.

    With equal links, closing the loop makes the two knee angles equal, but leaves the rhombus free to swing about the
    load. The remaining freedom is the lean, half the difference of the hips.
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


def _add_hinge(body: mujoco.MjsBody, name: str, axis: tuple, hopper: Hopper) -> mujoco.MjsJoint:
    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, armature=hopper.armature)
    joint.damping[0] = hopper.joint_damping
    return joint


def _add_link(body: mujoco.MjsBody, name: str, hopper: Hopper) -> None:
    half = hopper.link_length / 2.0
    size = (0.05 * hopper.link_length, half, 0.0)
    add_geom(body, name, mujoco.mjtGeom.mjGEOM_CAPSULE, size, (0, 0, -half), hopper.link_mass, _BONE)


def _about_y(angle: float) -> tuple[float, float, float, float]:
    return (math.cos(angle / 2.0), 0.0, math.sin(angle / 2.0), 0.0)
