"""Planes and height fields, with a texture that tells distances."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.sim import _framing
from motorgrad.sim._colours import geom_colours
from motorgrad.sim._scenery import nice_step
from motorgrad.sim.scene import _turns
from motorgrad.sim.scene._glb import textured
from motorgrad.sim.scene._layer import Layer

if TYPE_CHECKING:
    import mujoco
    import viser

    from motorgrad.sim.live import Session
    from motorgrad.sim.scene._pose import Pose

REACH = 250.0  # m from the middle to the edge of an endless plane, which follows the body
MOST = 250_000  # points of a height field that are drawn; of a finer one every second, third, … row and column
PIXELS = 512


class Ground(Layer):
    """Every plane of the world as a tiled floor, every height field as hills with lines of equal height.

    An endless plane is a large square that is moved on by whole tiles as the body goes far.
    """

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self._endless: list[tuple[Any, np.ndarray, np.ndarray, float]] = []
        model = session.model
        if model is None:
            return
        import mujoco

        self.applies = True
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        colours = geom_colours(model)
        for geom in _framing.visible_geoms(model):
            place, turn = data.geom_xpos[geom].copy(), data.geom_xmat[geom].reshape(3, 3).copy()
            where: dict[str, Any] = {"position": place, "wxyz": _turns.of_matrices(turn)[0]}
            if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
                half = np.where(model.geom_size[geom, :2] > 0, model.geom_size[geom, :2], REACH)
                tile = 10 * nice_step(max(float(model.stat.extent) / 10, 1e-3))
                handle = server.scene.add_glb(
                    f"/ground/{geom}", floor(half, tile, colours[geom, :3]), cast_shadow=False, **where
                )
                if np.any(model.geom_size[geom, :2] == 0):
                    self._endless.append((handle, place, turn, tile))
            elif model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_HFIELD:
                content = hills(model, model.geom_dataid[geom], colours[geom, :3])
                server.scene.add_glb(f"/ground/{geom}", content, **where)

    def draw(self, pose: Pose) -> None:
        """Move endless planes on, when the body has gone some way."""
        for handle, place, turn, tile in self._endless:
            leap = 16 * tile
            steps = np.round((pose.centre - place) @ turn[:, :2] / leap)
            handle.position = place + turn[:, :2] @ (steps * leap)


def floor(half: np.ndarray, tile: float, rgb: np.ndarray) -> bytes:
    """A rectangle as GLB, of `half` its sides in m, with tiles of `tile` m in ten by ten squares."""
    import trimesh

    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    mesh = trimesh.Trimesh(np.c_[corners, np.zeros(4)], [(0, 1, 2), (0, 2, 3)], process=False)
    return textured(mesh, corners / tile, tiles(rgb))


def tiles(rgb: np.ndarray) -> np.ndarray:
    """One tile of the floor `(n, n, 3)` in [0, 1]: a fine grain, ten squares a side, a line around."""
    grain = np.random.default_rng(0).normal(size=(PIXELS, PIXELS))
    for axis in (0, 1):  # a little smoother than noise; wraps around, so that tiles join
        grain = grain + np.roll(grain, 1, axis) + np.roll(grain, -1, axis)
    grain /= grain.std()
    square = np.arange(PIXELS) * 10 // PIXELS
    odd = (square[:, None] + square) % 2
    shade = 1 + 0.012 * grain - 0.045 * odd
    edge = np.minimum(np.arange(PIXELS), PIXELS - 1 - np.arange(PIXELS)) < 2
    shade[edge[:, None] | edge] *= 0.86
    return np.clip(rgb * shade[..., None], 0, 1)


def hills(model: mujoco.MjModel, field: int, rgb: np.ndarray) -> bytes:
    """A height field as GLB in its geom's axes, its texture baked: lines of equal height, and paler where higher."""
    import trimesh

    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    wide, deep, tall, _ = model.hfield_size[field]
    first = model.hfield_adr[field]
    grid = model.hfield_data[first : first + rows * columns].reshape(rows, columns)
    stride = int(np.ceil(np.sqrt(rows * columns / MOST)))
    row, column = (np.unique(np.append(np.arange(0, n, stride), n - 1)) for n in (rows, columns))
    v, u = row / (rows - 1), column / (columns - 1)
    height = grid[np.ix_(row, column)].astype(float)
    x, y = np.meshgrid(wide * (2 * u - 1), deep * (2 * v - 1))
    corner = np.arange(height.size).reshape(height.shape)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    mesh = trimesh.Trimesh(np.stack([x, y, tall * height], -1).reshape(-1, 3), faces, process=False)
    uv = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    return textured(mesh, uv, _contoured(height, float(tall), rgb, wide / deep))


def _contoured(height: np.ndarray, tall: float, rgb: np.ndarray, aspect: float) -> np.ndarray:
    """The picture of a height field `(n, m, 3)`, first row at the top of the picture as textures have it."""
    from scipy.ndimage import zoom

    across = int(np.clip(2048 * min(1, aspect), 256, 2048))
    down = int(np.clip(across / aspect, 256, 2048))
    fine: Any = zoom(
        height, (down / height.shape[0], across / height.shape[1]), order=1, grid_mode=True, mode="nearest"
    )
    spread = max(float(np.ptp(fine)), 1e-9)
    part = (fine - fine.min()) / spread
    steps = tall * fine / nice_step(max(tall * spread / 4, 1e-6))
    slope = np.hypot(*np.gradient(steps)) + 1e-9
    line = np.clip(1.2 - np.abs(steps - np.round(steps)) / slope, 0, 1) * (slope < 0.35) * (slope > 1e-3)
    grain = np.random.default_rng(0).normal(size=fine.shape)
    shade = 0.86 + 0.24 * part + 0.02 * grain - 0.16 * line
    return np.clip(rgb * shade[..., None], 0, 1)[::-1]
