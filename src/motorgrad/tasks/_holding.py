"""Which poses the muscles of a body can hold: where they cannot, no policy can."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import warnings
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from motorgrad.bodies import Body, install_muscle_callback

POSES = 32
"""Poses that are tried, so that a planar arm takes 0.2 s at most: a share is then known to about 9 %."""
MAX_JOINTS = 10
"""Joints of bodies that are looked at: poses of more, each drawn by itself, are seldom those that a task is about."""
FLAT = 2
"""Joints up to which stability is looked at, too: so few have few directions in which they can give way."""
DIRECTIONS = 24
"""Directions of two joints in which a pose must not give way."""
FEW = 0.5
"""The share of poses below which it is told."""
EXACT = 1e-3
"""The torque that may lack, as a share of the largest that is needed in any pose."""
STEP = 1e-5
"""The step of differences over joints, in rad or m."""
_TURNS = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
_PULLS = (int(mujoco.mjtGain.mjGAIN_MUSCLE), int(mujoco.mjtGain.mjGAIN_USER))


_looked_at: set[int] = set()


class HoldingWarning(UserWarning):
    """A warning that muscles cannot hold most poses of their body."""


class Held(NamedTuple):
    """Which poses muscles can hold at rest, `(poses,)` each.

    - `balanced`: some activations balance gravity and passive forces, so that feedback can keep the body there.
    - `stable`: some of these also pull the body back from nearby poses, so that they keep it there unchanged; `None`
      for more than two joints.
    """

    balanced: Bool[np.ndarray, " poses"]
    stable: Bool[np.ndarray, " poses"] | None


def tell_if_few_can_be_held(body: Body, model: mujoco.MjModel) -> None:
    """Warn, once for each body, if its muscles can hold few poses. **Arguments:** the body and its compiled model."""
    try:
        mark = hash(body)
    except TypeError:  # a body of another library
        mark = id(model)
    if mark in _looked_at:
        return
    _looked_at.add(mark)
    found = held_poses(model)
    if found is None:
        return
    balanced = found.balanced.mean()
    held = balanced if found.stable is None else found.stable.mean()
    if held >= FEW:
        return
    message = f"{held:.0%} of the poses can be held by any constant activation"
    if found.stable is None:
        message = f"{balanced:.0%} of the poses can be held by any activation"
    elif balanced > held:
        message += f", {balanced:.0%} by one that corrects all the time"
    warnings.warn(
        f"{body!r}: {message} (a sample of {len(found.balanced)} poses spread over the joints' ranges, at rest, "
        "without contacts; balance by bounded least squares, stability by linear programs). In the others the body "
        "gives way: stronger muscles, longer moment arms, more muscles across a joint, less mass or narrower ranges of "
        "the joints help; mg.tasks.held_poses(model) has each pose",
        HoldingWarning,
        stacklevel=7,
    )


def held_poses(model: mujoco.MjModel, poses: Float[np.ndarray, "poses nq"] | None = None) -> Held | None:
    """Which poses muscles can hold at rest.

    The forces of the muscles at rest, from the least to the greatest activation, are a box, whose torques are compared
    with those needed, by bounded least squares. A linear program finds among the activations that balance a pose some
    that make it stable in every direction. Contacts do not help.

    **Arguments:** `model`, a `mujoco.MjModel`; `poses`, by default 32 that are spread evenly over the ranges of the
    joints (`spread_poses`).

    **Returns** `None` where this is no question of muscles alone: for a body without muscles, that is not fixed to the
    ground, with ball joints, more than ten joints, constraints, or muscles with tendons that stretch.
    """
    pulls = np.isin(model.actuator_gaintype, _PULLS)
    turning = np.isin(model.jnt_type, _TURNS).all() and 0 < model.nq == model.nv <= MAX_JOINTS
    if not turning or not pulls.any() or model.neq or (model.actuator_actnum > 1).any():
        return None
    install_muscle_callback(model)
    data = mujoco.MjData(model)
    every = spread_poses(model) if poses is None else np.asarray(poses, float)
    torques = [_torques(model, data, pose) for pose in every]
    slack = np.maximum(EXACT * max(np.abs(needed).max() for _, needed in torques), model.dof_frictionloss)
    balanced = np.array([_can_balance(able, needed, slack) for able, needed in torques])
    if model.nv > FLAT:
        return Held(balanced, None)
    stable = np.array([yes and _can_be_stable(model, data, pose) for yes, pose in zip(balanced, every, strict=True)])
    return Held(balanced, stable)


def _can_balance(able: np.ndarray, needed: np.ndarray, slack: np.ndarray) -> bool:
    """Whether shares from 0 to 1 of the torques of which muscles are `able`, `(nv, nu)`, add up to those needed."""
    from scipy.optimize import nnls

    # shares and what is left of them are both at least 0 and add up to 1
    count = able.shape[1]
    heavy = 1e3 * slack.min()
    both = np.block([[able, np.zeros_like(able)], [heavy * np.eye(count), heavy * np.eye(count)]])
    shares = np.clip(nnls(both, np.concatenate([needed, np.full(count, heavy)]))[0][:count], 0.0, 1.0)
    return bool((np.abs(able @ shares - needed) <= slack).all())


def _can_be_stable(model: mujoco.MjModel, data: mujoco.MjData, pose: np.ndarray) -> bool:
    """Whether some shares that balance a pose also push it back from every direction."""
    from scipy.optimize import linprog

    able, needed = _torques(model, data, pose)
    slopes = []
    for step in STEP * np.eye(model.nv):
        (more, after), (less, before) = (_torques(model, data, pose + way) for way in (step, -step))
        slopes.append(((more - less) / (2 * STEP), (after - before) / (2 * STEP)))
    angles = np.linspace(0.0, np.pi, DIRECTIONS, endpoint=False)
    ways = np.stack([np.cos(angles), np.sin(angles)], 1) if model.nv > 1 else np.ones((1, 1))
    of_shares = np.einsum("wi,kij,wk->wj", ways, np.array([able for able, _ in slopes]), ways)
    of_needs = np.einsum("wi,ki,wk->w", ways, np.array([needs for _, needs in slopes]), ways)
    # the torque along every way must fall along it: shares·(slope of muscles) − (slope of what is needed) < 0
    none = np.zeros(able.shape[1])
    return bool(linprog(none, of_shares, of_needs, able, needed, bounds=(0.0, 1.0)).status == 0)


def spread_poses(model: mujoco.MjModel, count: int = POSES) -> Float[np.ndarray, "poses nq"]:
    """Poses spread evenly over the ranges of all joints at once, always the same: a sequence of the kind R of
    M. Roberts, which adds powers of the root of x^(n+1) = x + 1 to every coordinate, modulo 1."""
    root = 2.0
    for _ in range(50):
        root = (1 + root) ** (1 / (model.nq + 1))
    steps = root ** -np.arange(1.0, model.nq + 1)
    shares = (0.5 + np.arange(1, count + 1)[:, None] * steps) % 1
    hinge = model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)
    free = np.where(hinge[:, None], [-np.pi, np.pi], 0.0) + model.qpos0[:, None] * ~hinge[:, None]
    low, high = np.where(model.jnt_limited[:, None] > 0, model.jnt_range, free).T
    return low + shares * (high - low)


def _torques(model: mujoco.MjModel, data: mujoco.MjData, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """In a pose at rest: the torques that each actuator adds from its least to its greatest activation, `(nv, nu)`, and
    those that are needed beside the least, `(nv,)`."""
    torques = []
    states = model.actuator_actnum > 0
    limits = np.where(model.actuator_ctrllimited[:, None] > 0, model.actuator_ctrlrange, [0.0, 1.0])
    for end in (0, 1):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = pose
        level = np.where(np.isin(model.actuator_gaintype, _PULLS), np.clip(limits[:, end], 0, 1), limits[:, end])
        data.ctrl[:] = level
        data.act[model.actuator_actadr[states]] = level[states]
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        arms = np.zeros((model.nu, model.nv))
        mujoco.mju_sparse2dense(arms, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
        torques.append(arms.T * data.actuator_force)
    least, most = torques
    return most - least, data.qfrc_bias - data.qfrc_passive - least.sum(axis=1)
