"""Meshes with a picture on them, in the format that browsers read."""

from __future__ import annotations

import io
from typing import Any

import numpy as np


def textured(mesh: Any, uv: np.ndarray, picture: np.ndarray, *, glows: bool = False) -> bytes:
    """A `trimesh.Trimesh` with a picture on it, as GLB.

    **Arguments:** `uv` `(vertices, 2)`, from the picture's lower left corner, repeated beyond 1; `picture`
    `(height, width, 3)`, sRGB in [0, 1]; `glows`, whether it shows its own colours whatever light falls on it.
    """
    from PIL import Image
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    image = Image.fromarray(np.round(255 * picture).astype(np.uint8))
    image.format = "JPEG"  # a tenth of the bytes of the default, PNG: the grain of a ground does not compress
    colour: dict[str, Any] = {"baseColorTexture": image}
    if glows:
        colour = {"baseColorFactor": [0, 0, 0, 255], "emissiveTexture": image, "emissiveFactor": [1.0, 1.0, 1.0]}
    material = PBRMaterial(**colour, metallicFactor=0.0, roughnessFactor=0.95)
    mesh.visual = TextureVisuals(uv=uv, material=material)
    with io.BytesIO() as file:
        mesh.export(file, file_type="glb")
        return file.getvalue()
