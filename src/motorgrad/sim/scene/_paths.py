"""Where muscles run: the engine's own path points, and between two on a pulley or a capsule the arc around it."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    import mujoco

ARC = 8  # straight pieces of an arc
PULLEY = -2  # what MuJoCo writes where a path is cut by a pulley; -1 stands for a site, 0 and more for a wrapped geom


class Segments(NamedTuple):
    """Straight pieces of all paths: from `start` `(n, 3)` to `end` `(n, 3)`, of tendon `(n,)`; `last` `(n,)` is true
    where no other piece goes on."""

    start: np.ndarray
    end: np.ndarray
    tendon: np.ndarray
    last: np.ndarray


def most_segments(model: mujoco.MjModel) -> tuple[int, int]:
    """How many segments all paths of a model can have together, and how many ends that no other piece continues."""
    import mujoco

    kinds = mujoco.mjtWrap
    sites = int(np.sum(model.wrap_type == kinds.mjWRAP_SITE))
    wraps = int(np.sum(np.isin(model.wrap_type, (kinds.mjWRAP_SPHERE, kinds.mjWRAP_CYLINDER))))
    spatial = model.wrap_type[model.tendon_adr] != kinds.mjWRAP_JOINT
    pieces = int(np.sum(spatial)) + int(np.sum(model.wrap_type == kinds.mjWRAP_PULLEY))
    # a geom adds two points, and what is between them becomes an arc
    return sites - pieces + (1 + ARC) * wraps, pieces


def segments(model: mujoco.MjModel, data: mujoco.MjData) -> Segments:
    """The paths of all tendons in the posture of `data`; fixed tendons have none."""
    count = data.ten_wrapnum
    rows = np.concatenate(
        [np.arange(first, first + n) for first, n in zip(data.ten_wrapadr, count, strict=True)] or [[]]
    )
    rows = rows.astype(int)
    points, kinds = data.wrap_xpos.reshape(-1, 3)[rows], data.wrap_obj.reshape(-1)[rows]
    tendon = np.repeat(np.arange(model.ntendon), count)
    joined = (tendon[1:] == tendon[:-1]) & (kinds[1:] != PULLEY) & (kinds[:-1] != PULLEY)
    at = np.flatnonzero(joined)
    goes_on = np.append(joined[1:], False)[at]
    bent = (kinds[at] >= 0) & (kinds[at] == kinds[at + 1])
    start, end = points[at], points[at + 1]
    steps = np.where(bent, ARC, 1)
    whole = np.repeat(np.arange(len(at)), steps)
    # the number of each piece within its arc
    part = np.arange(len(whole)) - np.repeat(np.cumsum(steps) - steps, steps)
    starts, ends = start[whole], end[whole]
    if bent.any():
        arcs = _arcs(model, data, kinds[at[bent]], points[at[bent] - 1], start[bent], end[bent])
        curved = bent[whole]
        starts[curved] = arcs[:, :-1].reshape(-1, 3)
        ends[curved] = arcs[:, 1:].reshape(-1, 3)
    last = ~goes_on[whole] & (part == steps[whole] - 1)
    return Segments(starts, ends, tendon[at][whole], last)


def _arcs(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geoms: np.ndarray,
    before: np.ndarray,
    start: np.ndarray,
    end: np.ndarray,
) -> np.ndarray:
    """Points `(n, ARC + 1, 3)` along arcs around spheres and cylinders, on which a path comes straight from `before`.

    It touches where it comes from, which tells the way round even where that is the longer one. Along a cylinder's axis
    it advances evenly.
    """
    import mujoco

    centre = data.geom_xpos[geoms]
    axis = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, :, 2]
    axis = np.where((model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_SPHERE)[:, None], 0.0, axis)

    def across(vector: np.ndarray) -> np.ndarray:
        return vector - np.sum(vector * axis, 1, keepdims=True) * axis

    first, second = across(start - centre), across(end - centre)
    normal = np.cross(first, across(start - before))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    angle = np.arctan2(np.sum(np.cross(first, second) * normal, 1), np.sum(first * second, 1)) % (2 * np.pi)
    angle = np.where(angle > 2 * np.pi - 1e-6, 0.0, angle)[:, None]
    part = np.linspace(0, 1, ARC + 1)
    turn = (part * angle)[..., None]
    bow = np.cos(turn) * first[:, None] + np.sin(turn) * np.cross(normal, first)[:, None]
    along = np.sum((start - centre) * axis, 1)[:, None] + part * np.sum((end - start) * axis, 1)[:, None]
    arcs = centre[:, None] + bow + along[..., None] * axis[:, None]
    arcs[:, 0], arcs[:, -1] = start, end  # the engine's own, bit for bit
    return arcs
