"""Render pictures of a body off screen with OpenGL, if this computer can."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import copy
import functools
import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from motorgrad._processes import SAFE
from timsim.film._annotations import Arrow, write_names
from timsim.film._appearance import (
    MARK,
    MARK_OPACITY,
    geom_colours,
    muscle_colour,
    muscle_radius,
    muscle_width,
    set_posture,
    tendon_activation,
    texture_of,
)
from timsim.film._framing import DOWNWARDS, SIDEWAYS, UPWARDS, View, visible_geoms
from timsim.film._scenery import (
    SHADE,
    SKY,
    add_arrow,
    add_backdrop,
    add_geom,
    add_lamp,
    add_marks,
    add_shadows,
    in_picture,
)
from timsim.film._viewpoint import Viewpoint

if TYPE_CHECKING:
    import mujoco


PACKAGES = "libegl1 libopengl0 libgl1-mesa-dri"
ADVICE = f"On Debian or Ubuntu, `apt-get install {PACKAGES}` enables rendered pictures, even without a graphics card."
# Run in another process: a broken driver may abort the process that tries it.
_PROBE = """
import mujoco
from timsim.film._gl import make_context
context = make_context({backend!r}, 16, 16)
context.make_current()
resources = mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
resources.free()
context.free()
print("ready")
"""


def backend() -> str:
    """The kind of context used here: that of `MUJOCO_GL` if it names one, else EGL on Linux and the system's own
    elsewhere.

    The variable is read at each call. MuJoCo chooses once, when it is first imported, and needs a window where the
    variable is not set.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked in ("disable", "disabled", "off", "false", "0"):
        return "off"
    if platform.system() == "Linux":
        return asked if asked in ("egl", "osmesa", "glfw") else "egl"
    return "system"


def make_context(kind: str, width: int, height: int) -> Any:
    """An OpenGL context of kind "egl", "osmesa", "glfw" or "system", with `make_current()` and `free()`."""
    if kind == "egl":
        from mujoco.egl import GLContext
    elif kind == "osmesa":
        from mujoco.osmesa import GLContext
    elif kind == "glfw":
        from mujoco.glfw import GLContext
    else:
        from mujoco.rendering.classic.gl_context import GLContext
    return GLContext(width, height)


def gl_problem() -> str:
    """Why OpenGL pictures cannot be made here, in one line; empty if they can. Tried once, in another process."""
    return _problem(backend())


@functools.cache
def _problem(kind: str) -> str:
    if kind == "off":
        return "OpenGL is switched off by MUJOCO_GL"
    if kind == "egl":
        import ctypes

        try:
            ctypes.CDLL("libEGL.so.1")
        except OSError:
            return "the library libEGL.so.1 is not installed"
    paths = os.pathsep.join(path for path in sys.path if path)
    try:
        probe = subprocess.run(
            [sys.executable, "-c", _PROBE.format(backend=kind)],
            env={**os.environ, "PYTHONPATH": paths, **SAFE},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=120,
        )
    except (OSError, subprocess.SubprocessError) as error:
        return f"a trial picture with {kind} failed: {type(error).__name__}"
    if probe.returncode == 0 and "ready" in probe.stdout:
        return ""
    lines = probe.stderr.strip().splitlines()
    return f"a trial picture with {kind} failed: {lines[-1] if lines else f'exit status {probe.returncode}'}"


Ground = Literal["marked", "plain"]
MARK_RGBA = np.append(MARK, MARK_OPACITY)
FIELD_OF_VIEW = 26.0  # degrees; a long lens distorts less


class GlRenderer:
    """Renders pictures of one body: call `paint` for each frame, and `close` at the end.

    **Arguments:** `model`; `view`, from `frame_motions`; `which` of the view's motions this is; picture size in pixels;
    `ground`: "marked", or "plain" for an even one of the background's colour.
    """

    def __init__(
        self, model: mujoco.MjModel, view: View, which: int, width: int, height: int, ground: Ground = "marked"
    ) -> None:
        import mujoco

        self._gl_context = self._resources = None
        self._model = copy.copy(model)
        if ground == "plain":
            _make_plain(self._model)
        self._data = mujoco.MjData(self._model)
        self._which = which
        self._viewpoint: Viewpoint | None = None
        self._size = width, height
        self._bare = model
        self._terrain = bool(np.any(model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD))
        self._marked = ground == "marked"
        self._ground = _level_ground(model)
        if self._ground is not None and not self._marked:
            self._ground = (*self._ground[:2], SKY, True)
        self._style()
        self.set_view(view)

        self._gl_context = make_context(backend(), width, height)
        self._gl_context.make_current()
        self._scene = mujoco.MjvScene(self._model, maxgeom=20 * (model.ngeom + model.nsite) + 120 * model.ntendon + 400)
        self._resources = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._resources)
        flags = self._scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SHADOW] = self._terrain
        flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = False
        flags[mujoco.mjtRndFlag.mjRND_FOG] = True
        self._options = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()
        self._rectangle = mujoco.MjrRect(0, 0, width, height)
        self._pixels = np.empty((height, width, 3), np.uint8)

    def set_view(self, view: View) -> None:
        """Change to another view: the camera's position, and what depends on its size: fog, clipping planes, muscle
        width.
        """
        model = self._model
        size = float(np.linalg.norm(view.half))
        self._view = view
        self._distance, self._lift = _stand_back(view, self._size[0] / self._size[1])
        # MuJoCo measures fog and clipping planes in units of the extent
        model.stat.extent = size
        model.vis.map.znear = 0.02
        model.vis.map.zfar = 80.0
        self._set_fog(self._distance)
        self._tendon_width = muscle_radius(self._bare, size)

    def look(self, viewpoint: Viewpoint | None) -> None:
        """Look from a viewpoint, or, with None, as the view says."""
        self._viewpoint = viewpoint
        centre = self._view.centres[self._which][0]
        away = self._distance if viewpoint is None else float(np.linalg.norm(centre - viewpoint.position))
        self._model.vis.global_.fovy = FIELD_OF_VIEW if viewpoint is None else viewpoint.field_of_view
        self._set_fog(away)

    def _set_fog(self, distance: float) -> None:
        model, size = self._model, self._model.stat.extent
        model.vis.map.fogstart = distance / size + 2.0
        model.vis.map.fogend = distance / size + 14.0

    def _style(self) -> None:
        """Set the appearance of the renderer's copy of the model: picture size, light, no markers."""
        import mujoco

        model = self._model
        model.vis.global_.offwidth, model.vis.global_.offheight = self._size
        model.vis.quality.shadowsize = 2048
        # fewer facets than MuJoCo's default halve the time of a software renderer, without a visible difference
        model.vis.quality.numslices = 20
        model.vis.quality.numstacks = 10
        model.vis.quality.numquads = 4  # MuJoCo's default: a stranger's model may ask for billions
        model.vis.global_.fovy = FIELD_OF_VIEW
        model.vis.rgba.fog[:] = (*SKY, 1)
        # a pale studio replaces the model's lamps and sky, so that all bodies have the same light
        model.light_active[:] = 0
        model.vis.headlight.active = 1
        model.vis.headlight.ambient[:] = 0.50
        model.vis.headlight.diffuse[:] = 0.26
        model.vis.headlight.specular[:] = 0.05
        # hide the sites of muscle paths and the volumes of touch sensors
        markers = model.wrap_objid[model.wrap_type == mujoco.mjtWrap.mjWRAP_SITE]
        wrapped = np.isin(model.wrap_type, (mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER))
        beside = model.wrap_prm[wrapped]  # the site that tells on which side a muscle passes, or -1
        sensed = model.sensor_objid[model.sensor_objtype == mujoco.mjtObj.mjOBJ_SITE]
        model.site_rgba[np.concatenate([markers, beside[beside >= 0], sensed]).astype(int), 3] = 0
        model.tendon_matid[:] = -1

    def paint(
        self,
        frame: int,
        position: np.ndarray,
        activation: np.ndarray,
        marks: np.ndarray,
        beside: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]] = (),
        arrows: Sequence[Arrow] = (),
    ) -> np.ndarray:
        """The picture `(height, width, 3)`, uint8, of one posture with its marks; the next call overwrites it.

        `beside` are further bodies of the model: position, activation, and how far they are moved, `(3,)` m; `arrows`
        stand in the scene with their names.
        """
        import mujoco

        model, data, scene = self._model, self._data, self._scene
        self._place(position, activation)
        self._aim(frame)
        mujoco.mjv_updateScene(model, data, self._options, None, self._camera, mujoco.mjtCatBit.mjCAT_ALL.value, scene)
        nobody = mujoco.MjvPerturb()
        moving = mujoco.mjtCatBit.mjCAT_DYNAMIC.value
        for other_position, other_activation, shift in beside:
            first = scene.ngeom
            self._place(other_position, other_activation)
            mujoco.mjv_addGeoms(model, data, self._options, nobody, moving, scene)
            for index in range(first, scene.ngeom):
                scene.geoms[index].pos[:] += shift
        if self._viewpoint is not None:
            right_up_near, place = self._viewpoint.axes, self._viewpoint.position
            for eye in scene.camera:  # one for each eye
                eye.pos[:] = place
                eye.forward[:] = -right_up_near[2]
                eye.up[:] = right_up_near[1]
        self._decorate(frame)
        for x, y, z, radius in marks:
            add_geom(scene, mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, radius), np.array([x, y, z]), np.eye(3), MARK_RGBA)
            scene.geoms[scene.ngeom - 1].transparent = 1
        for arrow in arrows:
            add_arrow(scene, arrow)
        assert self._gl_context is not None
        self._gl_context.make_current()
        mujoco.mjr_render(self._rectangle, scene, self._resources)
        mujoco.mjr_readPixels(self._pixels, None, self._rectangle, self._resources)
        places = {arrow.name: in_picture(scene, arrow.ends[1], *self._size) for arrow in arrows}
        return write_names(self._pixels[::-1], {name: at for name, at in places.items() if at is not None})

    def _place(self, position: np.ndarray, activation: np.ndarray) -> None:
        """Set the posture, and the colours and widths of the muscles."""
        model = self._model
        level = tendon_activation(model, activation)
        model.tendon_rgba[:, :3] = muscle_colour(level)
        model.tendon_rgba[:, 3] = 1
        model.tendon_width[:] = self._tendon_width * muscle_width(level)
        set_posture(model, self._data, position)

    def _aim(self, frame: int) -> None:
        import mujoco

        camera, view = self._camera, self._view
        if view.camera >= 0 and self._viewpoint is None:
            camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, view.camera
            return
        camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        camera.azimuth, camera.elevation, camera.distance = view.azimuth, view.elevation, self._distance
        camera.lookat[:] = view.centres[self._which][frame] + view.axes[1] * self._lift

    def _decorate(self, frame: int) -> None:
        scene, view = self._scene, self._view
        count = scene.ngeom
        centre = view.centres[self._which][frame]
        size = float(np.linalg.norm(view.half))
        add_lamp(scene, centre, size, self._terrain)
        if self._ground is not None:
            point, normal, rgb, plain = self._ground
            if plain and self._marked and normal[2] > 0.999:
                add_marks(scene, centre, point[2], size, np.append(rgb * 0.86, 1.0), 12 * size)
            # opaque, as overlapping transparent shadows would be darker
            shade = np.append(rgb * SHADE, 1.0)
            add_shadows(scene, count, point, normal, size, shade)
        axes = view.axes if self._viewpoint is None else self._viewpoint.axes
        add_backdrop(scene, centre, axes, 40 * size)

    def close(self) -> None:
        """Free the resources of the graphics driver."""
        if self._gl_context is not None:
            self._gl_context.make_current()
            if self._resources is not None:
                self._resources.free()
            self._gl_context.free()
        self._gl_context = self._resources = None


def _stand_back(view: View, aspect: float) -> tuple[float, float]:
    """A free camera's distance, and how far above the centre it looks, such that the box stays within the margins."""
    right, up, near = view.corners.T
    slope = np.tan(np.radians(FIELD_OF_VIEW) / 2)
    share = (DOWNWARDS - UPWARDS) / (DOWNWARDS + UPWARDS)
    lift = share * up.max()
    needed = [
        near + np.abs(right) / (slope * aspect * SIDEWAYS),
        near + (up - lift) / (slope * UPWARDS),
        near - (up - lift) / (slope * DOWNWARDS),
    ]
    return float(np.max(needed)), float(lift)


def _make_plain(model: mujoco.MjModel) -> None:
    """Hide planes, and give height fields the background's colour without texture."""
    import mujoco

    flat, hilly = (model.geom_type == kind for kind in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD))
    model.geom_matid[flat | hilly] = -1
    model.geom_rgba[hilly, :3] = SKY
    model.geom_rgba[flat, 3] = 0


def _level_ground(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool] | None:
    """Point, normal, mean colour and whether it is untextured, of the world's first plane; None without one."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for geom in visible_geoms(model):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE and model.body_weldid[model.geom_bodyid[geom]] == 0:
            rgb = geom_colours(model)[geom, :3]
            plain = texture_of(model, int(geom)) < 0
            return data.geom_xpos[geom].copy(), data.geom_xmat[geom, 2::3].copy(), rgb, plain
    return None
