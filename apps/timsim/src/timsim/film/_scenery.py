"""What a rendered picture shows besides the model: pale background, lamp, shadows, distance marks on the ground."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from timsim.film._annotations import Arrow

if TYPE_CHECKING:
    import mujoco


SKY = np.array([0.93, 0.95, 0.97])
SUN = np.array([0.30, 0.45, -1.0]) / np.linalg.norm([0.30, 0.45, -1.0])  # from above, slightly left of the viewer
SHADE = 0.72  # brightness of ground in shadow
GLOW = 0.15  # of an arrow, whose colour has a meaning


def add_geom(
    scene: mujoco.MjvScene, kind: int, size: np.ndarray, place: np.ndarray, turn: np.ndarray, rgba: np.ndarray
) -> None:
    """Append a decorative geom, unless the scene is full. `turn` is any matrix `(3, 3)`."""
    import mujoco

    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, size, place, np.eye(3).ravel(), rgba.astype(np.float32))
    geom.size[:] = size  # a scene's convention: half lengths along all three axes
    geom.mat[:] = turn
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    geom.specular = geom.shininess = geom.reflectance = 0.0
    scene.ngeom += 1


def add_arrow(scene: mujoco.MjvScene, arrow: Arrow) -> None:
    """Add an arrow, without its name."""
    import mujoco

    kind, (start, end) = mujoco.mjtGeom.mjGEOM_ARROW, arrow.ends
    rgba = np.append(np.array([*bytes.fromhex(arrow.colour[1:])]) / 255, 1.0)
    add_geom(scene, kind, np.full(3, arrow.radius), start, np.eye(3), rgba)
    geom = scene.geoms[scene.ngeom - 1]
    # MuJoCo's renderer draws arrows at half their length
    mujoco.mjv_connector(geom, kind, arrow.radius, start, 2 * end - start)
    geom.emission = GLOW


def in_picture(scene: mujoco.MjvScene, point: np.ndarray, width: int, height: int) -> tuple[float, float] | None:
    """Where a point `(3,)` m is in the picture, in pixels from its upper left corner; None behind the camera."""
    eye = scene.camera[0]  # of two, which are equal without stereo
    forward, up = (np.array(part, float) for part in (eye.forward, eye.up))
    away = point - np.array(eye.pos)
    depth = away @ forward
    if depth <= 0:
        return None
    scale = 0.5 * height * eye.frustum_near / (eye.frustum_top * depth)  # pixels of a metre
    return 0.5 * width + scale * float(away @ np.cross(forward, up)), 0.5 * height - scale * float(away @ up)


def add_backdrop(scene: mujoco.MjvScene, place: np.ndarray, axes: np.ndarray, reach: float) -> None:
    """Add a wall beyond the fog, in the fog's colour: MuJoCo itself clears the picture to black."""
    import mujoco

    wall = np.array([8 * reach, 8 * reach, 0.01 * reach])
    add_geom(scene, mujoco.mjtGeom.mjGEOM_BOX, wall, place - axes[2] * reach, axes.T, np.append(SKY, 1.0))


def add_lamp(scene: mujoco.MjvScene, target: np.ndarray, size: float, shadow_map: bool) -> None:
    """Add a sun beside the camera's own light, with or without a shadow map, which is slow."""
    import mujoco

    lamp = scene.lights[scene.nlight]
    lamp.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    lamp.headlight = False
    lamp.castshadow = shadow_map
    # steeper over hills: at grazing light a shadow map stipples slopes
    ray = np.array([0.08, 0.12, -0.99]) if shadow_map else SUN
    lamp.pos[:] = target - 4 * size * ray  # the map covers the surroundings of the ray from here
    lamp.dir[:] = ray
    lamp.attenuation[:] = (1, 0, 0)
    lamp.ambient[:] = 0
    lamp.diffuse[:] = 0.46
    lamp.specular[:] = 0.12
    scene.nlight += 1


def add_shadows(
    scene: mujoco.MjvScene, count: int, point: np.ndarray, normal: np.ndarray, size: float, rgba: np.ndarray
) -> None:
    """Flatten the scene's first `count` geoms along the sun onto a plane: a shadow for the price of a geom.

    `size` is that of the scene in m. A shadow map halves the speed of software rendering, so it is used only where the
    ground is not a plane.
    """
    import mujoco

    kinds = mujoco.mjtGeom
    solid = (kinds.mjGEOM_SPHERE, kinds.mjGEOM_CAPSULE, kinds.mjGEOM_ELLIPSOID, kinds.mjGEOM_CYLINDER, kinds.mjGEOM_BOX)
    fall = np.outer(SUN, normal) / (SUN @ normal)
    upright = np.outer(normal, normal)
    for index in range(count):
        geom = scene.geoms[index]
        if geom.type not in solid or geom.category == mujoco.mjtCatBit.mjCAT_STATIC or geom.transparent:
            continue
        place = np.array(geom.pos, float)
        if (place - point) @ normal <= 0:
            continue
        # thinner than its gap to the ground, or it would cut into it; without any thickness it would have no normals
        long = np.sum(geom.size)
        foot = place - fall @ (place - point) + normal * 0.003 * size
        flat = (np.eye(3) - fall + 0.001 * size / long * upright) @ geom.mat
        add_geom(scene, geom.type, np.array(geom.size), foot, flat, rgba)


def nice_step(length: float) -> float:
    """The nearest 1, 2 or 5 times a power of ten at or below `length`: the distance between marks in m."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(step for step in (1, 2, 5) if step * power <= length * (1 + 1e-9)))


def add_marks(
    scene: mujoco.MjvScene, centre: np.ndarray, height: float, size: float, rgba: np.ndarray, reach: float
) -> None:
    """Add thin lines across a level ground, every 1, 2 or 5 times a power of ten metres."""
    import mujoco

    step = nice_step(size)
    middle = np.round(centre[0] / step) * step
    for place in middle + step * np.arange(-np.ceil(reach / step), np.ceil(reach / step) + 1):
        line = np.array([0.004 * size, reach, 0.0004 * size])
        add_geom(scene, mujoco.mjtGeom.mjGEOM_BOX, line, np.array([place, centre[1], height]), np.eye(3), rgba)
