"""A body put into a posture, without dynamics."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco


def pose(model: mujoco.MjModel, data: mujoco.MjData, position: np.ndarray) -> None:
    """Place bodies, geoms, cameras, lights and tendon paths of `data` at `position` `(nq,)`.

    Only these stages: a whole `mj_forward` would also collide and call whatever muscle callback is installed.
    """
    import mujoco

    data.qpos[:] = position
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    mujoco.mj_flex(model, data)
    mujoco.mj_tendon(model, data)


def tendon_paths(model: mujoco.MjModel, data: mujoco.MjData) -> list[tuple[int, np.ndarray]]:
    """The pieces of tendon that are seen: pairs of the tendon's index and its points `(n, 3)`.

    A tendon through a pulley is several pieces. Fixed tendons have no path.
    """
    pieces = []
    for tendon in range(model.ntendon):
        start = data.ten_wrapadr[tendon]
        rows = slice(start, start + data.ten_wrapnum[tendon])
        points, kinds = data.wrap_xpos.reshape(-1, 3)[rows], data.wrap_obj.reshape(-1)[rows]
        for piece in np.split(np.arange(len(points)), np.flatnonzero(kinds == -2)):
            piece = piece[kinds[piece] != -2]  # -2 marks a pulley, -1 a site
            if len(piece) > 1:
                pieces.append((tendon, points[piece].copy()))
    return pieces
