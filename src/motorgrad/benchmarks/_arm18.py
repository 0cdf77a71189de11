"""An arm with five joints and 18 muscles, made in Python: of the size of published models of the arm."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import math

import mujoco

from motorgrad.bodies import Mjcf
from motorgrad.tasks import Composed, compose, terms

# m, lengths of the bones
UPPER = 0.3
LOWER = 0.28
RINGS = (("deltoid", 5, 0.07, -0.12), ("cuff", 3, 0.05, -0.08))
"""Muscles around the shoulder: name, number, radius of their origins (m), and height of their insertions (m)."""
SPANNING = {
    "biceps": (("trunk", (0.05, -0.02, 0.03)), ("lower", (0.03, 0.0, -0.06))),
    "triceps": (("trunk", (-0.06, -0.02, 0.0)), ("lower", (-0.02, 0.0, 0.02))),
    "brachialis": (("upper", (0.02, 0.0, -0.18)), ("lower", (0.025, 0.0, -0.05))),
    "brachioradialis": (("upper", (0.03, 0.01, -0.22)), ("lower", (0.02, 0.02, -0.2))),
    "flexor": (("upper", (0.025, -0.02, -0.25)), ("lower", (0.02, -0.02, -0.18))),
    "anconeus": (("upper", (-0.03, 0.0, -0.24)), ("lower", (-0.03, 0.01, 0.0))),
    "medial triceps": (("upper", (-0.025, 0.01, -0.15)), ("lower", (-0.022, 0.0, 0.02))),
    "lateral triceps": (("upper", (-0.025, -0.01, -0.12)), ("lower", (-0.022, 0.0, 0.02))),
    "pronator": (("upper", (0.0, -0.03, -0.27)), ("lower", (0.02, 0.025, -0.12))),
    "supinator": (("upper", (0.0, 0.03, -0.27)), ("lower", (0.02, -0.025, -0.1))),
}


def arm18() -> Mjcf:
    """The arm, hanging from a trunk at rest."""
    spec = mujoco.MjSpec()
    spec.modelname = "arm18"
    spec.compiler.degree = False
    spec.option.timestep = 0.002
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    trunk = spec.worldbody.add_body(name="trunk", pos=(0, 0, 1.4))
    _bone(trunk, "trunk", (0, 0, 0.05), (0, 0, -0.02), 0.03, 1.0)
    upper = trunk.add_body(name="upper")
    for name, axis, low, high in (
        ("flexion", (0, -1, 0), -0.6, 2.0),
        ("abduction", (1, 0, 0), -0.3, 1.5),
        ("rotation", (0, 0, 1), -0.8, 0.8),
    ):
        _hinge(upper, name, axis, low, high)
    _bone(upper, "upper", (0, 0, 0), (0, 0, -UPPER), 0.022, 1.8)
    lower = upper.add_body(name="lower", pos=(0, 0, -UPPER))
    _hinge(lower, "elbow", (0, -1, 0), 0.1, 2.3)
    _hinge(lower, "pronation", (0, 0, 1), -1.2, 1.2)
    _bone(lower, "lower", (0, 0, 0), (0, 0, -LOWER), 0.018, 1.2)
    lower.add_site(name="hand", pos=(0, 0, -LOWER), size=(0.015, 0.015, 0.015))
    elbow = upper.add_geom(name="elbow", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=(0.022, 0.03, 0), pos=(0, 0, -UPPER))
    elbow.quat = (0.5**0.5, 0.5**0.5, 0, 0)
    elbow.mass = 0.0
    elbow.contype = 0
    elbow.conaffinity = 0
    upper.add_site(name="elbow behind", pos=(-0.04, 0, -UPPER), size=(0.004, 0.004, 0.004))
    ends = dict(SPANNING)
    for name, number, radius, height in RINGS:
        for i in range(number):
            turn = 2 * math.pi * (i + 0.5) / number
            far = (radius * math.cos(turn), radius * math.sin(turn))
            near = (0.02 * math.cos(turn), 0.02 * math.sin(turn))
            ends[f"{name} {i + 1}"] = (("trunk", (*far, 0.02)), ("upper", (*near, height)))
    for name, (origin, insertion) in ends.items():
        _muscle(spec, name, origin, insertion, behind="triceps" in name)
    spec.add_key(name="start", qpos=(0.3, 0.2, 0.0, 1.2, 0.0))
    return Mjcf(spec)  # type: ignore[arg-type]


def reach18() -> Composed:
    """Reach with that arm for places that it can reach, with all that its muscles feel."""
    return compose(
        arm18(),
        targets=["reach"],
        observe=["joint-positions", "joint-velocities", "activations", "muscle-lengths", "target-error"],
        reward=["distance", terms.Effort(weight=-0.1)],
        reset=[terms.RandomJoints(share=0.5)],
        metrics=["distance"],
        time_limit=2.0,
    )


def _hinge(body: mujoco.MjsBody, name: str, axis: tuple[float, ...], low: float, high: float) -> None:
    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, armature=0.005)
    joint.range = (low, high)
    joint.limited = True
    joint.damping[0] = 0.3


def _bone(body: mujoco.MjsBody, name: str, start: tuple, end: tuple, radius: float, mass: float) -> None:
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=(*start, *end),
        size=(radius, 0, 0),
        mass=mass,
        contype=0,
        conaffinity=0,
    )


def _muscle(spec: mujoco.MjSpec, name: str, origin: tuple, insertion: tuple, behind: bool) -> None:
    tendon = spec.add_tendon(name=name, width=0.006)
    for number, (body, place) in enumerate((origin, insertion)):
        site = f"{name} {'origin' if number == 0 else 'insertion'}"
        spec.body(body).add_site(name=site, pos=place, size=(0.004, 0.004, 0.004))
        if number and behind:
            tendon.wrap_geom("elbow", "elbow behind")
        tendon.wrap_site(site)
    actuator = spec.add_actuator(name=name, target=name, ctrllimited=True, ctrlrange=(0.0, 1.0))
    actuator.trntype = mujoco.mjtTrn.mjTRN_TENDON
    actuator.set_to_muscle(timeconst=(0.015, 0.05), tausmooth=0.0, scale=400.0)
