"""Pictures of a body rendered with OpenGL."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np

from motorgrad.sim import _framing, _gl, _muscles, _scenery
from motorgrad.sim._colours import geom_colours, texture_of
from motorgrad.sim._pose import pose

if TYPE_CHECKING:
    import mujoco

FIELD_OF_VIEW = 26.0  # degrees; a long lens bends the body less


class Rendered:
    """Renders one body: make it, call `paint` for each frame, `close` it.

    **Arguments:** `model`; `view`, from `_framing.frame`; which of the view's motions this is; picture size in pixels.
    """

    def __init__(self, model: mujoco.MjModel, view: _framing.View, which: int, width: int, height: int) -> None:
        import mujoco

        self._gl_context = self._resources = None
        self._model = copy.copy(model)
        self._data = mujoco.MjData(self._model)
        self._which = which
        self._size = width, height
        self._bare = model
        self._terrain = bool(np.any(model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD))
        self._ground = _level_ground(model)
        self._style()
        self.look(view)

        self._gl_context = _gl.make_context(_gl.backend(), width, height)
        self._gl_context.make_current()
        self._scene = mujoco.MjvScene(self._model, maxgeom=10 * (model.ngeom + model.nsite) + 60 * model.ntendon + 400)
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

    def look(self, view: _framing.View) -> None:
        """Take another view: where to stand, and what is told in its size: fog, clipping planes, the muscles' width."""
        model, size = self._model, float(np.linalg.norm(view.half))
        self._view = view
        self._distance, self._lift = _stand_back(view, self._size[0] / self._size[1])
        # distances of fog and clipping planes are told in units of the extent
        model.stat.extent = size
        model.vis.map.znear, model.vis.map.zfar = 0.02, 80.0
        model.vis.map.fogstart = self._distance / size + 2.0
        model.vis.map.fogend = self._distance / size + 14.0
        self._tendon_width = _muscles.least_width(self._bare, size)

    def _style(self) -> None:
        """Set the copy's looks: size of the picture, light, no markers."""
        import mujoco

        model = self._model
        model.vis.global_.offwidth, model.vis.global_.offheight = self._size
        model.vis.quality.shadowsize = 2048
        # fewer facets than MuJoCo's own: half the time of a software renderer, and no difference to see
        model.vis.quality.numslices, model.vis.quality.numstacks = 20, 10
        model.vis.global_.fovy = FIELD_OF_VIEW
        model.vis.rgba.fog[:] = (*_scenery.SKY, 1)
        # the model's lamps and sky give way to a pale studio, into which the ground fades: all bodies in one light
        model.light_active[:] = 0
        model.vis.headlight.active = 1
        model.vis.headlight.ambient[:] = 0.50
        model.vis.headlight.diffuse[:] = 0.26
        model.vis.headlight.specular[:] = 0.05
        # points of muscle paths and touch sensors' volumes are means, not things to look at
        markers = model.wrap_objid[model.wrap_type == mujoco.mjtWrap.mjWRAP_SITE]
        wrapped = np.isin(model.wrap_type, (mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER))
        beside = model.wrap_prm[wrapped]  # the site on whose side a muscle passes, -1 for none
        sensed = model.sensor_objid[model.sensor_objtype == mujoco.mjtObj.mjOBJ_SITE]
        model.site_rgba[np.concatenate([markers, beside[beside >= 0], sensed]).astype(int), 3] = 0
        model.tendon_matid[:] = -1

    def paint(self, frame: int, position: np.ndarray, activation: np.ndarray) -> np.ndarray:
        """The picture `(height, width, 3)`, uint8, of one posture; overwritten by the next."""
        import mujoco

        model, data, scene = self._model, self._data, self._scene
        level = _muscles.tendon_activation(model, activation)
        model.tendon_rgba[:, :3] = _muscles.colour(level)
        model.tendon_rgba[:, 3] = 1
        model.tendon_width[:] = self._tendon_width * _muscles.width(level)
        pose(model, data, position)
        self._aim(frame)
        mujoco.mjv_updateScene(model, data, self._options, None, self._camera, mujoco.mjtCatBit.mjCAT_ALL.value, scene)
        self._decorate(frame)
        assert self._gl_context is not None
        self._gl_context.make_current()
        mujoco.mjr_render(self._rectangle, scene, self._resources)
        mujoco.mjr_readPixels(self._pixels, None, self._rectangle, self._resources)
        return self._pixels[::-1]

    def _aim(self, frame: int) -> None:
        import mujoco

        camera, view = self._camera, self._view
        if view.camera >= 0:
            camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, view.camera
            return
        camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        camera.azimuth, camera.elevation, camera.distance = view.azimuth, view.elevation, self._distance
        camera.lookat[:] = view.centres[self._which][frame] + view.axes[1] * self._lift

    def _decorate(self, frame: int) -> None:
        scene, view = self._scene, self._view
        count = scene.ngeom
        centre, size = view.centres[self._which][frame], float(np.linalg.norm(view.half))
        _scenery.add_lamp(scene, centre, size, self._terrain)
        if self._ground is not None:
            point, normal, rgb, plain = self._ground
            if plain and normal[2] > 0.999:
                _scenery.add_marks(scene, centre, point[2], size, np.append(rgb * 0.86, 1.0), 12 * size)
            # opaque: where transparent shadows overlap they would be darker
            shade = np.append(rgb * _scenery.SHADE, 1.0)
            _scenery.add_shadows(scene, count, point, normal, size, shade)
        _scenery.add_backdrop(scene, centre, view.axes, 40 * size)

    def close(self) -> None:
        """Free what the graphics driver holds."""
        if self._gl_context is not None:
            self._gl_context.make_current()
            if self._resources is not None:
                self._resources.free()
            self._gl_context.free()
        self._gl_context = self._resources = None


def _stand_back(view: _framing.View, aspect: float) -> tuple[float, float]:
    """How far off a free camera stands, and how far above the centre it looks, so that the box stays in the margins."""
    right, up, near = view.corners.T
    slope = np.tan(np.radians(FIELD_OF_VIEW) / 2)
    share = (_framing.DOWNWARDS - _framing.UPWARDS) / (_framing.DOWNWARDS + _framing.UPWARDS)
    lift = share * up.max()
    needed = [
        near + np.abs(right) / (slope * aspect * _framing.SIDEWAYS),
        near + (up - lift) / (slope * _framing.UPWARDS),
        near - (up - lift) / (slope * _framing.DOWNWARDS),
    ]
    return float(np.max(needed)), float(lift)


def _level_ground(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool] | None:
    """Point, normal, mean colour and whether it is untextured, of the first plane of the world; None without one."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for geom in _framing.visible_geoms(model):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE and model.body_weldid[model.geom_bodyid[geom]] == 0:
            rgb, plain = geom_colours(model)[geom, :3], texture_of(model, int(geom)) < 0
            return data.geom_xpos[geom].copy(), data.geom_xmat[geom, 2::3].copy(), rgb, plain
    return None
