"""How a model looks: colours of geoms and muscles, its posture without dynamics, tendon paths and height fields."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from motorgrad._errors import check

if TYPE_CHECKING:
    import mujoco


def geom_colours(model: mujoco.MjModel) -> np.ndarray:
    """RGBA `(ngeom, 4)` in [0, 1]: the geom's own, or its material's, multiplied by the mean of its texture."""
    colours = np.array(model.geom_rgba, float)
    for geom in np.flatnonzero(model.geom_matid >= 0):
        colours[geom] = model.mat_rgba[model.geom_matid[geom]]
        texture = texture_of(model, int(geom))
        if texture >= 0:
            colours[geom, :3] *= texture_pixels(model, texture)[..., :3].mean((0, 1)) / 255
    return colours


def texture_of(model: mujoco.MjModel, geom: int) -> int:
    """The index of the first texture of a geom's material, or -1."""
    material = model.geom_matid[geom]
    textures = model.mat_texid[material] if material >= 0 else np.array([-1])
    known = textures[textures >= 0]
    return int(known[0]) if known.size else -1


def texture_pixels(model: mujoco.MjModel, texture: int) -> np.ndarray:
    """A texture as an image `(height, width, channels)`, uint8; the six faces of a cube are below one another."""
    high = model.tex_height[texture]
    wide = model.tex_width[texture]
    channels = model.tex_nchannel[texture]
    first = model.tex_adr[texture]
    return model.tex_data[first : first + high * wide * channels].reshape(high, wide, channels)


MARK = np.array([0.10, 0.60, 0.34])  # places that a task marks, such as targets
MARK_OPACITY = 0.45
SILENT = np.array([0.95, 0.70, 0.66])
FIRING = np.array([0.80, 0.02, 0.06])
PASSIVE = np.array([0.50, 0.53, 0.57])  # a tendon without an actuator
SWELL = 1.1  # a fully active muscle is drawn 1 + SWELL times as wide as a silent one
THINNEST = 0.006  # radius of a silent muscle, as a share of the size in view


def tendon_activation(model: mujoco.MjModel, activation: np.ndarray) -> np.ndarray:
    """The activation of each tendon, `(ntendon,)`: that of its most active muscle, NaN without an actuator."""
    import mujoco

    # NumPy compares with a number a hundred times as fast as with a member of an enumeration
    pulls = np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON.value)
    level = np.full(model.ntendon, np.nan)
    np.fmax.at(level, model.actuator_trnid[pulls, 0], np.asarray(activation, float)[pulls])
    return level


def muscle_colour(level: np.ndarray) -> np.ndarray:
    """RGB `(n, 3)` in [0, 1] of muscles at `level` `(n,)`: pale when silent, strong red when active, grey at NaN."""
    level = level[:, None]
    blend = SILENT + np.nan_to_num(level) * (FIRING - SILENT)
    return np.where(np.isnan(level), PASSIVE, blend)


def muscle_width(level: np.ndarray) -> np.ndarray:
    """Width `(n,)` relative to a silent muscle's."""
    return 1 + SWELL * np.nan_to_num(level)


def muscle_radius(model: mujoco.MjModel, size: float) -> np.ndarray:
    """Radius `(ntendon,)` of a silent muscle in m: the model's own, but visible on a body of `size` m."""
    return np.maximum(model.tendon_width, THINNEST * size)


def height_grid(model: mujoco.MjModel, field: int) -> np.ndarray:
    """The heights of a height field `(rows, columns)`, as shares of its size upwards."""
    rows = int(model.hfield_nrow[field])
    columns = int(model.hfield_ncol[field])
    first = model.hfield_adr[field]
    return model.hfield_data[first : first + rows * columns].reshape(rows, columns)


def check_posture(
    model: mujoco.MjModel, position: npt.ArrayLike, activation: npt.ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """A posture `(nq,)` and activations `(nu,)` as arrays. **Raises** `ValueError` for other shapes."""
    position = np.asarray(position, float)
    activation = np.asarray(activation, float)
    check(position.shape == (model.nq,), "position.shape", position.shape, f"({model.nq},): (nq of the model,)")
    check(activation.shape == (model.nu,), "activation.shape", activation.shape, f"({model.nu},): (actuators,)")
    return position, activation


def set_posture(model: mujoco.MjModel, data: mujoco.MjData, position: np.ndarray) -> None:
    """Place the bodies, geoms, cameras, lights and tendon paths of `data` at `position` `(nq,)`.

    Only these stages are computed: `mj_forward` would also detect collisions and call any installed muscle callback.
    """
    import mujoco

    data.qpos[:] = position
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    mujoco.mj_flex(model, data)
    mujoco.mj_tendon(model, data)


def tendon_paths(model: mujoco.MjModel, data: mujoco.MjData) -> list[tuple[int, np.ndarray]]:
    """The visible pieces of tendons: pairs of a tendon's index and its points `(n, 3)`.

    A tendon through a pulley has several pieces. Fixed tendons have no path.
    """
    pieces = []
    for tendon in range(model.ntendon):
        start = data.ten_wrapadr[tendon]
        rows = slice(start, start + data.ten_wrapnum[tendon])
        points = data.wrap_xpos.reshape(-1, 3)[rows]
        kinds = data.wrap_obj.reshape(-1)[rows]
        for piece in np.split(np.arange(len(points)), np.flatnonzero(kinds == -2)):
            piece = piece[kinds[piece] != -2]  # MuJoCo marks a pulley by -2, a site by -1
            if len(piece) > 1:
                pieces.append((tendon, points[piece].copy()))
    return pieces
