"""What colour a geom has where it is drawn in one."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco


def geom_colours(model: mujoco.MjModel) -> np.ndarray:
    """RGBA `(ngeom, 4)` in [0, 1]: the geom's own, or its material's with the mean of the material's texture."""
    colours = np.array(model.geom_rgba, float)
    for geom in np.flatnonzero(model.geom_matid >= 0):
        colours[geom] = model.mat_rgba[model.geom_matid[geom]]
        texture = texture_of(model, int(geom))
        if texture >= 0:
            colours[geom, :3] *= pixels(model, texture)[..., :3].mean((0, 1)) / 255
    return colours


def texture_of(model: mujoco.MjModel, geom: int) -> int:
    """The first texture of a geom's material, or -1."""
    material = model.geom_matid[geom]
    textures = model.mat_texid[material] if material >= 0 else np.array([-1])
    known = textures[textures >= 0]
    return int(known[0]) if known.size else -1


def pixels(model: mujoco.MjModel, texture: int) -> np.ndarray:
    """A texture as a picture `(height, width, channels)`, uint8; a cube's six faces one below the other."""
    high, wide, channels = model.tex_height[texture], model.tex_width[texture], model.tex_nchannel[texture]
    first = model.tex_adr[texture]
    return model.tex_data[first : first + high * wide * channels].reshape(high, wide, channels)
