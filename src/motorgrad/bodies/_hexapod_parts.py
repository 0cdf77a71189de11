"""The hexapod's skeleton: three sections, six legs, and what is measured. Muscles or servos come on top."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from motorgrad.bodies._hexapod_numbers import HexapodNumbers, Hinge, Leg, Section, Segment
from motorgrad.bodies._hexapod_sensors import add_sensors
from motorgrad.bodies._scenery import add_scenery

SIDES = ("left", "right")

_BONE, _FOOT = (0.90, 0.87, 0.80, 1.0), (0.36, 0.38, 0.44, 1.0)
_TRUNK, _CAPSULE = (0.27, 0.30, 0.36, 1.0), (0.95, 0.95, 0.98, 0.35)
_STOP = ((0.005, 1.0), (0.98, 0.999, 0.001))  # soft stops let legs pass their range by ten degrees
_CONTACT = (0.02, 1.0)  # stiffer feet bounce, and stand on two legs of three
_MARGIN = 0.01  # m, by which the volume of a touch sensor exceeds what it watches


def skeleton(hexapod: HexapodNumbers) -> mujoco.MjSpec:
    """The hexapod without muscles and keyframe, its trunk level and its femurs level."""
    spec = mujoco.MjSpec()
    spec.modelname = "hexapod"
    spec.compiler.degree = False
    spec.option.timestep = hexapod.timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    middle = spec.worldbody.add_body(name="middle", pos=(0.0, 0.0, standing_height(hexapod)))
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
    add_sensors(spec)
    return spec


def start(hexapod: HexapodNumbers, model: mujoco.MjModel) -> np.ndarray:
    """Positions (nq,) of the start pose: trunk level, every foot on the floor under a leg that is at rest laterally."""
    position, height = np.array(model.qpos0), standing_height(hexapod)
    for name, section in hexapod.sections.items():
        for side in SIDES:
            position[model.joint(f"vertical_{side}_{name}").qposadr[0]] = standing_angle(section.leg, height)
    return position


def standing_height(hexapod: HexapodNumbers) -> float:
    """Height in m of the hips above the floor when the middle legs stand with level femurs."""
    leg = hexapod.middle.leg
    return leg.foot.length * math.sin(math.radians(leg.knee)) + leg.foot.radius


def standing_angle(leg: Leg, height: float) -> float:
    """The vertical angle in rad at which a foot just touches the floor `height` m below its hip; NaN if it cannot.

    The tip lies `femur sin φ + foot sin(φ − knee)` above the joint, which is one sine of φ.
    """
    knee = math.radians(leg.knee)
    along, down = leg.femur.length + leg.foot.length * math.cos(knee), leg.foot.length * math.sin(knee)
    share = (height - leg.foot.radius) / math.hypot(along, down)
    return math.atan2(down, along) - math.asin(share) if abs(share) <= 1.0 else math.nan


def _add_section(body: mujoco.MjsBody, name: str, section: Section) -> None:
    size = np.array((section.length, section.width, section.height)) / 2.0
    belly = _add_geom(body, name, mujoco.mjtGeom.mjGEOM_BOX, size, (0, 0, 0), section.mass, _TRUNK)
    belly.contype, belly.priority, belly.solref = 1, 1, _CONTACT
    touch = body.add_site(name=f"belly_{name}", type=mujoco.mjtGeom.mjGEOM_BOX, group=4)
    touch.size = size + _MARGIN
    for side in SIDES:
        _add_leg(body, f"{side}_{name}", section)


def _add_leg(body: mujoco.MjsBody, name: str, section: Section) -> None:
    """Coxa, femur and foot; x of each frame runs along the bone and z up, the right leg is the left one's mirror."""
    leg, left = section.leg, name.startswith("left")
    hip, turn = section.width / 2.0, math.radians(90.0 - leg.splay)
    coxa = body.add_body(name=f"coxa_{name}", pos=(0.0, hip if left else -hip, 0.0))
    coxa.quat = _about((0, 0, 1), turn if left else -turn)
    _add_hinge(coxa, f"lateral_{name}", (0.0, 0.0, -1.0 if left else 1.0), leg.lateral)
    _add_bone(coxa, f"coxa_{name}", leg.coxa, _BONE)
    femur = coxa.add_body(name=f"femur_{name}", pos=(leg.coxa.length, 0.0, 0.0))
    _add_hinge(femur, f"vertical_{name}", (0.0, -1.0, 0.0), leg.vertical)
    _add_bone(femur, f"femur_{name}", leg.femur, _BONE)
    _add_capsule(coxa, name, leg)
    foot = femur.add_body(name=f"foot_{name}", pos=(leg.femur.length, 0.0, 0.0))
    foot.quat = _about((0, 1, 0), math.radians(leg.knee))
    _add_hinge(foot, f"ankle_{name}", (0.0, -1.0, 0.0), leg.ankle)
    sole = _add_bone(foot, f"foot_{name}", leg.foot, _FOOT)
    # MuJoCo takes the greater of two frictions, unless one of the two geoms comes first
    sole.contype, sole.priority, sole.friction[0], sole.solref = 1, 1, leg.friction, _CONTACT
    touch = foot.add_site(name=f"foot_{name}", type=mujoco.mjtGeom.mjGEOM_CAPSULE, group=4)
    touch.pos, touch.quat, touch.size = sole.pos, sole.quat, np.add(sole.size, (_MARGIN, _MARGIN, 0.0))


def _add_capsule(coxa: mujoco.MjsBody, name: str, leg: Leg) -> None:
    """The vertical joint's capsule, and the point below it that tells MuJoCo which way round the depressor goes.

    A cylinder about the joint's axis, not a sphere: where the femur is in line with the coxa a path round a sphere is
    in no plane of its own, and MuJoCo led it round the side. The point is in the middle of the arc of the most lifted
    femur, as in the hopper's most flexed knee.
    """
    joint, radius = np.array((leg.coxa.length, 0.0, 0.0)), leg.vertical_muscles.radius
    size = (radius, leg.femur.radius, 0.0)
    capsule = _add_geom(coxa, f"capsule_{name}", mujoco.mjtGeom.mjGEOM_CYLINDER, size, joint, 0.0, _CAPSULE)
    capsule.quat = _about((1, 0, 0), math.pi / 2.0)
    half = math.radians(leg.vertical.range[1]) / 2.0
    below = joint + 1.5 * radius * np.array((math.sin(half), 0.0, -math.cos(half)))
    coxa.add_site(name=f"below_{name}", pos=below, size=(0.004, 0.004, 0.004), group=4)


def _add_hinge(body: mujoco.MjsBody, name: str, axis: tuple, hinge: Hinge) -> mujoco.MjsJoint:
    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, armature=hinge.armature)
    joint.damping[0], joint.stiffness[0] = hinge.damping, hinge.stiffness
    joint.limited, joint.range = True, [math.radians(angle) for angle in hinge.range]
    joint.solref_limit, joint.solimp_limit[:3] = _STOP
    return joint


def _add_bone(body: mujoco.MjsBody, name: str, segment: Segment, colour: Sequence[float]) -> mujoco.MjsGeom:
    half = segment.length / 2.0
    kind, size = mujoco.mjtGeom.mjGEOM_CAPSULE, (segment.radius, half, 0.0)
    bone = _add_geom(body, name, kind, size, (half, 0.0, 0.0), segment.mass, colour)
    bone.quat = _about((0, 1, 0), math.pi / 2.0)
    return bone


def _add_geom(body, name, kind, size, position, mass, colour) -> Any:
    """A geom that touches nothing unless told to."""
    return body.add_geom(
        name=name, type=kind, size=size, pos=position, mass=mass, rgba=colour, contype=0, conaffinity=0
    )


def _about(axis: Sequence[float], angle: float) -> tuple[float, ...]:
    return (math.cos(angle / 2.0), *(math.sin(angle / 2.0) * part for part in axis))
