"""Surroundings: the ground, textured so that distances can be judged, sky and light."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import trimesh
import viser
from scipy.ndimage import zoom

from timsim.film import geom_colours, height_grid, nice_step, visible_geoms
from timsim.live import Session
from timsim.scene._geometry import quaternions_from_matrices, textured_glb
from timsim.scene._layer import Layer
from timsim.scene._own import watches
from timsim.scene._pose import Pose

REACH = 250.0  # m from the middle to the edge of an infinite plane, which follows the body
MAX_DRAWN_POINTS = 250_000  # of a height field; of a finer one, every second, third, … row and column
PIXELS = 512


class Ground(Layer):
    """Draws every plane of the world as a tiled floor and every height field as hills with contour lines.

    An infinite plane is a large square that moves by whole tiles as the body goes far.
    """

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self._endless: list[tuple[Any, np.ndarray, np.ndarray, float]] = []
        self._hills: dict[str, tuple[int, np.ndarray, dict[str, Any]]] = {}
        self._scene = server.scene
        self._edits = 0
        model = session.model
        if model is None:
            return

        self.applies = True
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        colours = geom_colours(model)
        for geom in visible_geoms(model):
            place = data.geom_xpos[geom].copy()
            turn = data.geom_xmat[geom].reshape(3, 3).copy()
            where: dict[str, Any] = {"position": place, "wxyz": quaternions_from_matrices(turn)[0]}
            if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
                half = np.where(model.geom_size[geom, :2] > 0, model.geom_size[geom, :2], REACH)
                tile = 10 * nice_step(max(float(model.stat.extent) / 10, 1e-3))
                handle = server.scene.add_glb(
                    f"/ground/{geom}", floor_glb(half, tile, colours[geom, :3]), cast_shadow=False, **where
                )
                if np.any(model.geom_size[geom, :2] == 0):
                    self._endless.append((handle, place, turn, tile))
            elif model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_HFIELD:
                self._hills[f"/ground/{geom}"] = int(model.geom_dataid[geom]), colours[geom, :3], where
        self._draw_hills(model)

    def _draw_hills(self, model: mujoco.MjModel) -> None:
        self._heights = np.array(model.hfield_size)
        for node, (field, colour, where) in self._hills.items():
            self._scene.add_glb(node, height_field_glb(model, field, colour), **where)

    def draw(self, pose: Pose) -> None:
        """Move infinite planes with the body; draw hills again whose height was edited."""
        assert pose.model is not None
        if pose.edits != self._edits:
            self._edits = pose.edits
            if not np.array_equal(self._heights, pose.model.hfield_size):
                self._draw_hills(pose.model)
        for handle, place, turn, tile in self._endless:
            leap = 16 * tile
            steps = np.round((pose.centre - place) @ turn[:, :2] / leap)
            handle.position = place + turn[:, :2] @ (steps * leap)


def floor_glb(half: np.ndarray, tile: float, rgb: np.ndarray) -> bytes:
    """A rectangle as GLB, of half sides `half` in m, with tiles of `tile` m in ten by ten squares."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    mesh = trimesh.Trimesh(np.c_[corners, np.zeros(4)], [(0, 1, 2), (0, 2, 3)], process=False)
    return textured_glb(mesh, corners / tile, floor_tile(rgb))


def floor_tile(rgb: np.ndarray) -> np.ndarray:
    """One tile of the floor `(n, n, 3)` in [0, 1]: a fine grain, ten squares a side, a line around."""
    grain = np.random.default_rng(0).normal(size=(PIXELS, PIXELS))
    for axis in (0, 1):  # slightly smoother than noise; wraps around, so that tiles join
        grain = grain + np.roll(grain, 1, axis) + np.roll(grain, -1, axis)
    grain /= grain.std()
    square = np.arange(PIXELS) * 10 // PIXELS
    odd = (square[:, None] + square) % 2
    shade = 1 + 0.012 * grain - 0.045 * odd
    edge = np.minimum(np.arange(PIXELS), PIXELS - 1 - np.arange(PIXELS)) < 2
    shade[edge[:, None] | edge] *= 0.86
    return np.clip(rgb * shade[..., None], 0, 1)


def height_field_glb(model: mujoco.MjModel, field: int, rgb: np.ndarray) -> bytes:
    """A height field as GLB in its geom's axes; its baked texture has contour lines and is paler where higher."""
    grid = height_grid(model, field)
    (wide, deep, tall, _) = model.hfield_size[field]
    rows, columns = grid.shape
    stride = int(np.ceil(np.sqrt(rows * columns / MAX_DRAWN_POINTS)))
    row, column = (np.unique(np.append(np.arange(0, n, stride), n - 1)) for n in (rows, columns))
    v = row / (rows - 1)
    u = column / (columns - 1)
    height = grid[np.ix_(row, column)].astype(float)
    x, y = np.meshgrid(wide * (2 * u - 1), deep * (2 * v - 1))
    corner = np.arange(height.size).reshape(height.shape)
    a = corner[:-1, :-1]
    b = corner[:-1, 1:]
    c = corner[1:, 1:]
    d = corner[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    mesh = trimesh.Trimesh(np.stack([x, y, tall * height], -1).reshape(-1, 3), faces, process=False)
    uv = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    return textured_glb(mesh, uv, _contoured(height, float(tall), rgb, wide / deep))


def _contoured(height: np.ndarray, tall: float, rgb: np.ndarray, aspect: float) -> np.ndarray:
    """The texture of a height field `(n, m, 3)`, its first row at the top of the picture, as in textures."""
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


ZENITH = np.array([0.30, 0.50, 0.76])
HORIZON = np.array([0.84, 0.89, 0.93])
"""Colours of the sky, sRGB."""
# radius of the dome in m, and as a share of the browser's drawing distance, initially 1,000 m
FAR = 500.0
SHARE = 0.5
SUN = (-0.45, -0.65, 1.0)  # direction of the sun


class Sky(Layer):
    """Draws a dome that is paler towards the horizon, a sun that casts shadows, and ambient light."""

    name = "Shadows"

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self.applies = True
        scene = server.scene
        scene.set_up_direction("+z")
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map("park", environment_intensity=0.35)
        self._server, self._far = server, FAR
        self._dome = scene.add_glb("/sky/dome", sky_glb(), cast_shadow=False, receive_shadow=False)
        scene.add_light_hemisphere("/sky/glow", sky_color=(214, 230, 255), ground_color=(150, 140, 128), intensity=1.1)
        self._sun = scene.add_light_directional(
            "/sky/sun", color=(255, 247, 232), intensity=2.4, position=SUN, cast_shadow=True
        )

    def draw(self, pose: Pose) -> None:
        """Keep the dome within the drawing distance of all browsers but beyond what they see, which for a large planet
        is far. Where one may drive, those that only watch do not count.
        """
        clients = self._server.get_clients()
        driving = [client for number, client in clients.items() if not watches(self._server, number)]
        far = SHARE * min((client.camera.far for client in driving or clients.values()), default=FAR / SHARE)
        if far > 0 and far != self._far:
            self._far = far
            self._dome.scale = far / FAR

    def switch(self, shown: bool) -> None:
        if self.applies:
            self._sun.cast_shadow = shown


def sky_glb() -> bytes:
    """The sky as GLB: a sphere seen from inside, which glows by itself."""
    sphere: Any = trimesh.creation.uv_sphere(FAR, count=(24, 32))
    sphere.invert()
    rise = np.clip(sphere.vertices[:, 2] / FAR, -0.1, 1)
    uv = np.stack([np.full(len(rise), 0.5), (rise + 0.1) / 1.1], axis=1)
    part = np.clip(np.linspace(1.0, -0.1, 256), 0, 1)[:, None] ** 0.55
    shades = HORIZON + part * (ZENITH - HORIZON)
    return textured_glb(sphere, uv, np.repeat(shades[:, None], 4, axis=1), glows=True)
