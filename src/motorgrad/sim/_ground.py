"""The line of the ground in a drawn picture."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco


def ground_line(
    model: mujoco.MjModel, data: mujoco.MjData, through: np.ndarray, screen: np.ndarray, along: np.ndarray
) -> np.ndarray | None:
    """Where planes and height fields cut the upright plane through a point, seen level.

    **Arguments:** `through`: `(3,)`, a point of the cut; `screen`: `(2, 3)`, right and up; `along`: `(n,)`, metres to
    the right, where the height is wanted.

    **Returns:** `(n,)` heights, the highest ground counting; None where the model has none, or seen from above.
    """
    if abs(screen[1, 2]) < 0.5:
        return None
    return ground_height(model, data, through + np.outer(along - through @ screen[0], screen[0]))


def ground_height(model: mujoco.MjModel, data: mujoco.MjData, places: np.ndarray) -> np.ndarray | None:
    """The height `(n,)` of the highest plane or height field above or below places `(n, 3)`; None without either."""
    import mujoco

    heights = []
    for geom in range(model.ngeom):
        point, turn = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE and turn[2, 2] > 0.1:
            heights.append(point[2] - (places - point)[:, :2] @ turn[:2, 2] / turn[2, 2])
        elif model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_HFIELD:
            heights.append(_field_height(model, model.geom_dataid[geom], (places - point) @ turn) + point[2])
    return np.max(heights, axis=0) if heights else None


def _field_height(model: mujoco.MjModel, field: int, places: np.ndarray) -> np.ndarray:
    """Height of a field above its origin at places in its own axes, bilinear; its edge continues outwards."""
    rows, columns = model.hfield_nrow[field], model.hfield_ncol[field]
    wide, deep, tall = model.hfield_size[field, :3]
    first = model.hfield_adr[field]
    grid = model.hfield_data[first : first + rows * columns].reshape(rows, columns)
    column = np.clip((places[:, 0] / wide + 1) / 2, 0, 1) * (columns - 1)
    row = np.clip((places[:, 1] / deep + 1) / 2, 0, 1) * (rows - 1)
    left, low = np.minimum(column.astype(int), columns - 2), np.minimum(row.astype(int), rows - 2)
    x, y = column - left, row - low
    below = grid[low, left] * (1 - x) + grid[low, left + 1] * x
    above = grid[low + 1, left] * (1 - x) + grid[low + 1, left + 1] * x
    return tall * (below * (1 - y) + above * y)
