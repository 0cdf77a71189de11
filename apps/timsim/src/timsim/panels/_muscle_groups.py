"""Find muscles among many: by groups of name, side and joint, by a search, and in a chosen order."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from __future__ import annotations

import fnmatch
import re
from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np

ALL = "all"
ORDERS = ("as in the model", "name", "force", "activation")
_SIDE = {
    "right": re.compile(r"(^|[_ .-])(r|right)($|[_ .-])|[a-z]R$", re.IGNORECASE),
    "left": re.compile(r"(^|[_ .-])(l|left)($|[_ .-])|[a-z]L$", re.IGNORECASE),
}
ARM = 1e-3  # m, the least moment arm of a muscle that counts as crossing a joint
FEW = 2  # muscles that make a group by name


def groups_of(model: mujoco.MjModel, names: Sequence[str]) -> dict[str, list[int]]:
    """Groups of actuators by name: all, each side, those across each joint at the start, and families of names that
    differ in a number, such as `glmax1_r` and `glmax2_r`.

    **Arguments:** `model`; `names` of its actuators.

    **Returns** the numbers of the actuators in each, with more than one but not all of them in every group but the
    first.
    """
    found = {ALL: list(range(len(names)))}
    for side, pattern in _SIDE.items():
        found[side] = [row for row, name in enumerate(names) if pattern.search(name)]
    found |= {f"across {joint}": rows for joint, rows in _across(model).items()}
    families: dict[str, list[int]] = {}
    for row, name in enumerate(names):
        families.setdefault(re.sub(r"\d+", "*", name), []).append(row)
    found |= {family: rows for family, rows in sorted(families.items()) if "*" in family}
    return {name: rows for name, rows in found.items() if name == ALL or FEW <= len(rows) < len(names)}


def _across(model: mujoco.MjModel) -> dict[str, list[int]]:
    """The actuators that turn or move each joint in the start posture."""
    data: Any = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_fwdPosition(model, data)
    moment = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
    found = {}
    for joint in range(model.njnt):
        kind = int(model.jnt_type[joint])
        name = model.joint(joint).name
        if kind in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)) and name:
            found[name] = np.flatnonzero(np.abs(moment[:, model.jnt_dofadr[joint]]) > ARM).tolist()
    return found


def chosen_rows(
    names: Sequence[str],
    group: Sequence[int],
    search: str,
    order: str,
    force: Callable[[], np.ndarray],
    activation: Callable[[], np.ndarray],
) -> list[int]:
    """The actuators of a group that a search finds, in an order.

    **Arguments:** `names`; `group`, their numbers; `search`: words or patterns such as `gas*_l`, one of which a name
    matches; `order`, of `ORDERS`; `force` and `activation`: return those of all actuators, `(nu,)`; the greatest first.
    """
    words = [word.lower() for word in re.split(r"[,\s]+", search.strip()) if word]
    patterns = [word if any(mark in word for mark in "*?[") else f"*{word}*" for word in words]
    known = [name.lower() for name in names]
    rows = [row for row in group if not patterns or any(fnmatch.fnmatchcase(known[row], each) for each in patterns)]
    if order == "name":
        return sorted(rows, key=lambda row: names[row].lower())
    if order in ("force", "activation"):
        level = np.abs(force() if order == "force" else activation())
        return sorted(rows, key=lambda row: -float(level[row]))
    return rows
