"""The hopper's skeleton: load, legs, foot, the closed loop and the sensors. Muscles come on top."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import math

import mujoco
import numpy as np

from motorgrad.bodies._hopper_numbers import HopperNumbers
from motorgrad.bodies._scenery import add_scenery

SIDES = ("left", "right")
# Joint positions count from this interior angle of the knee, so that 0 everywhere is the start pose.
REFERENCE_ANGLE = math.pi / 2.0

_BONE = (0.90, 0.87, 0.80, 1.0)
_LOAD = (0.27, 0.30, 0.36, 1.0)
_FOOT = (0.36, 0.38, 0.44, 1.0)
_CAPSULE = (0.95, 0.95, 0.98, 0.35)


def skeleton(hopper: HopperNumbers) -> mujoco.MjSpec:
    """The hopper without muscles and keyframe, with its knees at 90° and the foot's underside on the floor."""
    spec = mujoco.MjSpec()
    spec.modelname = "hopper"
    spec.compiler.degree = False
    _set_physics(spec, hopper.timestep)
    height = 2.0 * hopper.link_length * math.sin(REFERENCE_ANGLE / 2.0) + 2.0 * hopper.foot_size[2]
    load = _add_load(spec, hopper, height)
    add_scenery(spec, rail=(0.0, 0.14), target="load")
    for side in SIDES:
        _add_leg(load, hopper, side)
    _close_loop(spec, hopper)
    _add_sensors(spec)
    return spec


def _set_physics(spec: mujoco.MjSpec, timestep: float) -> None:
    spec.option.timestep = timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON


def _add_load(spec: mujoco.MjSpec, hopper: HopperNumbers, height: float) -> mujoco.MjsBody:
    load = spec.worldbody.add_body(name="load", pos=(0.0, 0.0, height))
    load.add_joint(name="height", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1))
    # drawn as a ball of aluminium of that mass, so that a heavier load looks heavier
    radius = (3.0 * hopper.load_mass / (4.0 * math.pi * 2700.0)) ** (1.0 / 3.0)
    _add_geom(load, "load", mujoco.mjtGeom.mjGEOM_SPHERE, (radius, 0, 0), (0, 0, 0), hopper.load_mass, _LOAD)
    load.add_site(name="harness", size=(0.01, 0.01, 0.01), group=4)
    return load


def _add_leg(load: mujoco.MjsBody, hopper: HopperNumbers, side: str) -> None:
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


def _add_capsule(thigh: mujoco.MjsBody, hopper: HopperNumbers, side: str, mirror: float) -> None:
    """The knee's sphere, and a point on either side of it that tells MuJoCo which way round a muscle goes.

    The points sit in the middle of the arc: behind the knee when it is flexed most, in front of it when it is
    stretched. MuJoCo 4.0 lets the path snap to the other side where the point lies outside the cone between the bones
    as prolonged beyond the joint. That cone is as wide as the interior angle, so that a point which is within it in the
    most flexed knee always is; one square to the bone is not.
    """
    knee = np.array((0.0, 0.0, -hopper.link_length))
    size = (hopper.capsule_radius, 0, 0)
    _add_geom(thigh, f"capsule_{side}", mujoco.mjtGeom.mjGEOM_SPHERE, size, knee, 0.0, _CAPSULE)
    for name, interior, sign in (
        ("front", math.radians(160.0), 1.0),
        ("behind", math.radians(hopper.knee_range[0]), -1.0),
    ):
        # the bisector of the interior angle, seen from the knee; the thigh leads from the knee along +z
        bisector = np.array((mirror * math.sin(interior / 2.0), 0.0, math.cos(interior / 2.0)))
        position = knee + sign * 1.5 * hopper.capsule_radius * bisector
        thigh.add_site(name=f"{name}_{side}", pos=position, size=(0.004, 0.004, 0.004), group=4)


def _add_foot(foot: mujoco.MjsBody, hopper: HopperNumbers) -> None:
    size = hopper.foot_size
    geom = _add_geom(foot, "foot", mujoco.mjtGeom.mjGEOM_BOX, size, (0, 0, -size[2]), hopper.foot_mass, _FOOT)
    geom.contype = 1
    geom.solref = (0.005, 1.0)
    foot.add_site(name="sole", pos=(0, 0, -2.0 * size[2]), size=(0.005, 0.005, 0.005), group=4)
    # the volume whose contacts the touch sensor adds up: the whole box and a margin
    sole = foot.add_site(name="foot_touch", pos=(0, 0, -size[2]), group=4)
    sole.type = mujoco.mjtGeom.mjGEOM_BOX
    sole.size = np.asarray(size) + 0.01


def _close_loop(spec: mujoco.MjSpec, hopper: HopperNumbers) -> None:
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


def _add_hinge(body: mujoco.MjsBody, name: str, axis: tuple, hopper: HopperNumbers) -> mujoco.MjsJoint:
    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, armature=hopper.armature)
    joint.damping[0] = hopper.joint_damping
    return joint


def _add_link(body: mujoco.MjsBody, name: str, hopper: HopperNumbers) -> None:
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
