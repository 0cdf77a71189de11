"""Tasks that make sense for a body which nobody has described: what to try first with a model."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

from typing import Any, NamedTuple

import mujoco
import numpy as np

from motorgrad.bodies import Anatomy, Body, start_pose

PERIOD = 0.02  # s between two decisions
LOW = 0.6
"""Share of the height at the start below which a body has fallen."""
HINGE, SLIDE, FREE = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_FREE


class _Found(NamedTuple):
    """What of a body the suggestions need: its trunk with its height (m) and upright axis, its tip, and joints."""

    trunk: str
    height: float
    axis: str
    moves: bool
    tip: str
    joints: tuple[str, ...]
    size: float
    muscles: bool
    activations: bool


def suggestions(body: Body) -> dict[str, dict[str, Any]]:
    """Settings of composed tasks for a body, by what is to be learned in words: to reach a place, to hold a pose, to
    keep upright, to move along x, as far as the body can.

    They are plain tables, as `Composed` takes them and as a TOML file has them, and are meant to be changed. The tip
    that reaches is the part at the end of the longest chain of joints, or a site on it. A body that can fall keeps its
    heaviest free part upright.

    **Arguments:** `body`: any body with an actuator.

    **Returns** the settings, those that fit the body best first.

    ```python
    tasks = mg.tasks.suggestions(mg.bodies.Mjcf("arm6"))
    task = mg.tasks.compose("arm6", **tasks["reach a place"])
    ```
    """
    model: Any = Anatomy(body).model
    about = _examine(body, model)
    step = float(model.opt.timestep)
    period = max(1, round(PERIOD / step)) * step
    # muscles that are on or off walk; for a place or a pose, controls of any size learn from fewer decisions
    standing = {
        goal: {**each, "actions": "binary" if about.muscles else "continuous"}
        for goal, each in _standing(about).items()
    }
    moving = {goal: {**each, "actions": "continuous"} for goal, each in _reaching(about).items()}
    chosen = {**standing, **moving} if about.moves else moving
    return {goal: {**settings, "action_period": period} for goal, settings in chosen.items()}


def _reaching(about: _Found) -> dict[str, dict[str, Any]]:
    """Tasks for joints that have ranges."""
    if not about.joints:
        return {}
    joints = {} if about.joints == ("*",) else {"joints": list(about.joints)}
    senses = ["joint-positions", "joint-velocities", "target-error", *(["activations"] if about.activations else [])]
    start = [{"kind": "random-joints", "share": 0.5, **joints}]
    near = float(f"{0.04 * about.size:.1g}")
    found = {}
    if about.tip:
        found["reach a place"] = {
            "targets": [{"kind": "reach", "parts": about.tip, **joints}],
            "observe": [*senses[:2], "target", *senses[2:]],
            "reward": ["distance", {"kind": "closeness", "width": 2 * near}, {"kind": "effort", "weight": -0.05}],
            "reset": start,
            "metrics": ["distance", {"kind": "within", "tolerance": near, "name": "solved"}],
            "time_limit": 2.0,
        }
    found["hold a pose"] = {
        "targets": [{"kind": "pose", **joints}],
        "observe": senses,
        "reward": ["distance", {"kind": "closeness", "width": 0.3}, {"kind": "effort", "weight": -0.05}],
        "reset": start,
        "metrics": ["distance", {"kind": "within", "tolerance": 0.2, "name": "solved"}],
        "time_limit": 2.0,
    }
    return found


def _standing(about: _Found) -> dict[str, dict[str, Any]]:
    """Tasks for a body that can go away and fall."""
    part = {"part": about.trunk}
    senses = ["joint-positions", "joint-velocities", *(["activations"] if about.activations else [])]
    upright = {"kind": "upright", **part, "axis": about.axis}
    common: dict[str, Any] = {"observe": senses, "time_limit": 5.0}
    if about.joints:
        joints = {} if about.joints == ("*",) else {"joints": list(about.joints)}
        common["reset"] = [{"kind": "noise", "velocity": 0.05, **joints}]
    if about.height > 0:
        common["terminate"] = [{"kind": "height", **part, "below": round(LOW * about.height, 3)}]
    effort = {"kind": "effort", "weight": -0.05}
    return {
        "keep upright": {
            **common,
            "reward": ["alive", upright, {"kind": "speed", **part, "weight": -0.2}, effort],
            "metrics": [{"kind": "height", **part}, {**upright, "name": "upright"}],
        },
        "move along x": {
            **common,
            "reward": [{"kind": "along", **part}, {**upright, "weight": 0.3}, {"kind": "alive", "weight": 0.3}, effort],
            "metrics": [{"kind": "along", **part, "name": "speed"}],
        },
    }


def _examine(body: Body, model: mujoco.MjModel) -> _Found:
    data: Any = mujoco.MjData(model)
    position, velocity, activation = start_pose(body, model)
    data.qpos[:], data.qvel[:], data.act[:] = position, velocity, activation
    mujoco.mj_forward(model, data)
    moving = [i for i in range(1, model.nbody) if model.body_weldid[i] != 0]
    # a body of its own moves against the world: its parent does not
    trunks = [i for i in moving if model.body_weldid[model.body_parentid[i]] == 0 and model.body(i).name]
    trunk = max(trunks, key=lambda i: model.body_subtreemass[i], default=0)
    kinds = [int(model.jnt_type[j]) for j in range(model.njnt) if model.jnt_bodyid[j] == trunk]
    gravity = float(np.linalg.norm(model.opt.gravity)) > 0
    axes = data.xmat[trunk].reshape(3, 3)[2]
    muscle = np.isin(model.actuator_dyntype, (mujoco.mjtDyn.mjDYN_MUSCLE, mujoco.mjtDyn.mjDYN_USER))
    tension = model.actuator_gaintype == mujoco.mjtGain.mjGAIN_USER
    return _Found(
        model.body(trunk).name,
        float(data.xpos[trunk, 2]),
        "xyz"[int(np.argmax(axes))],
        bool(trunk) and gravity and bool({int(FREE), int(SLIDE)} & set(kinds)),
        _tip(model, data, moving, trunk),
        _ranged(model),
        _size(model, data, moving),
        bool(model.nu) and bool(np.all(muscle | tension)),
        bool(np.any(model.actuator_actadr >= 0)),
    )


def _size(model: mujoco.MjModel, data: mujoco.MjData, moving: list[int]) -> float:
    """The longest side of the box around the parts that move, in m."""
    at = np.concatenate(
        [
            data.xpos[moving],
            data.site_xpos[np.isin(model.site_bodyid, moving)],
            data.geom_xpos[np.isin(model.geom_bodyid, moving)],
        ]
    )
    return max(float(np.ptp(at, axis=0).max()), 0.05) if len(at) else 1.0


def _tip(model: mujoco.MjModel, data: mujoco.MjData, moving: list[int], trunk: int) -> str:
    """The name of what is at the end of the longest chain of joints: a site that no muscle is attached to, a geom, or
    the body, whichever has a name, the one farthest from the trunk."""
    depth = {0: 0}
    for i in range(1, model.nbody):
        depth[i] = depth[int(model.body_parentid[i])] + int(model.body_jntnum[i])
    root = data.xpos[trunk]
    attached = model.wrap_objid[model.wrap_type == mujoco.mjtWrap.mjWRAP_SITE]
    places = [
        (model.site, data.site_xpos, model.site_bodyid, set(range(model.nsite)) - set(attached.tolist())),
        (model.geom, data.geom_xpos, model.geom_bodyid, set(range(model.ngeom))),
        (model.body, data.xpos, np.arange(model.nbody), set(moving)),
    ]
    far = {i: float(np.linalg.norm(data.xpos[i] - root)) for i in moving}
    for end in sorted(moving, key=lambda i: (depth[i], far[i]), reverse=True):
        for part, at, of, known in places:
            named = [j for j in np.flatnonzero(of == end).tolist() if j in known and part(j).name]
            if named:
                return part(max(named, key=lambda j, at=at: np.linalg.norm(at[j] - root))).name
    return ""


def _ranged(model: mujoco.MjModel) -> tuple[str, ...]:
    """The joints with a range that nothing else determines, or "*" where these are all."""
    kinds = np.isin(model.jnt_type, (HINGE, SLIDE))
    tied = model.eq_obj1id[(model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_active0 > 0)]
    free = kinds & (model.jnt_limited > 0) & ~np.isin(np.arange(model.njnt), tied)
    names = tuple(model.joint(int(j)).name for j in np.flatnonzero(free))
    return ("*",) if names and free.all() else tuple(name for name in names if name)
