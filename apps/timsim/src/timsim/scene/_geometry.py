"""Geometry for viser: quaternions, unit meshes that everything is made of, and textured meshes."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial


def quaternions_from_matrices(matrices: np.ndarray) -> np.ndarray:
    """Quaternions `(n, 4)`, w first, of rotation matrices, `(n, 9)` or `(n, 3, 3)`."""
    rows = np.ascontiguousarray(matrices, float).reshape(-1, 9)
    turn = np.empty((len(rows), 4))
    for quaternion, row in zip(turn, rows, strict=True):  # a fifth of the time of scipy's Rotation for a few dozen
        mujoco.mju_mat2Quat(quaternion, row)
    return turn


def quaternions_from_z(directions: np.ndarray) -> np.ndarray:
    """Quaternions `(n, 4)` of the shortest rotations from z to directions `(n, 3)`; none for a zero direction."""
    directions = np.asarray(directions, float).reshape(-1, 3)
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    unit = np.where(length > 1e-12, directions / np.maximum(length, 1e-12), [0.0, 0.0, 1.0])
    turn = np.stack([1 + unit[:, 2], -unit[:, 1], unit[:, 0], np.zeros(len(unit))], axis=1)
    turn[unit[:, 2] < -1 + 1e-9] = (0, 1, 0, 0)  # straight down: about any horizontal axis
    return turn / np.linalg.norm(turn, axis=1, keepdims=True)


def identity_quaternions(count: int) -> np.ndarray:
    """Quaternions `(count, 4)` of no rotation."""
    return np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))


SLICES = 24  # facets around; enough for a tube of a few centimetres to look round


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh: `vertices` `(n, 3)` float32, `faces` `(m, 3)` uint32."""

    vertices: np.ndarray
    faces: np.ndarray


@functools.cache
def ball(slices: int = SLICES) -> Shape:
    """A sphere of radius 1."""
    return _shape(trimesh.creation.uv_sphere(1.0, count=(slices // 2 + 1, slices)))


@functools.cache
def rod() -> Shape:
    """A cylinder of radius 1 along z, from z = -1/2 to 1/2."""
    return _shape(trimesh.creation.cylinder(1.0, 1.0, sections=SLICES))


@functools.cache
def tube(slices: int = SLICES) -> Shape:
    """A cylinder of radius 1 along z, from z = -1/2 to 1/2, open at both ends."""
    return _shape(trimesh.creation.revolve(np.array([(1.0, -0.5), (1.0, 0.5)]), sections=slices))


@functools.cache
def block() -> Shape:
    """A box from -1 to 1 along each axis."""
    return _shape(trimesh.creation.box((2.0, 2.0, 2.0)))


@functools.cache
def ring() -> Shape:
    """A thin ring of radius 1 about z."""
    return _shape(trimesh.creation.torus(1.0, 0.02, major_sections=2 * SLICES, minor_sections=6))


@functools.cache
def arrow() -> Shape:
    """An arrow along z, from 0 to its tip at 1."""
    line = [(0, 0), (0.035, 0), (0.035, 0.76), (0.09, 0.76), (0, 1)]
    return _shape(trimesh.creation.revolve(np.array(line), sections=SLICES // 2))


def smooth_shaded(vertices: np.ndarray, faces: np.ndarray) -> Shape:
    """A mesh with separate vertices along edges sharper than 30°, so that these are not shaded round."""
    mesh = trimesh.graph.smooth_shade(trimesh.Trimesh(vertices, faces), angle=np.radians(30))
    return Shape(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32))


def _shape(mesh: trimesh.Trimesh) -> Shape:
    return smooth_shaded(mesh.vertices, mesh.faces)


def textured_glb(mesh: trimesh.Trimesh, uv: np.ndarray, picture: np.ndarray, *, glows: bool = False) -> bytes:
    """A `trimesh.Trimesh` with a texture, as GLB.

    **Arguments:** `uv` `(vertices, 2)`, from the picture's lower left corner, repeated beyond 1; `picture` `(height,
    width, 3)`, sRGB in [0, 1]; `glows`: whether it shows its own colours regardless of light.
    """
    image = Image.fromarray(np.round(255 * picture).astype(np.uint8))
    image.format = "JPEG"  # a tenth of the size of the default PNG, which cannot compress the grain of the ground
    colour: dict[str, Any] = {"baseColorTexture": image}
    if glows:
        colour = {"baseColorFactor": [0, 0, 0, 255], "emissiveTexture": image, "emissiveFactor": [1.0, 1.0, 1.0]}
    material = PBRMaterial(**colour, metallicFactor=0.0, roughnessFactor=0.95)
    mesh.visual = TextureVisuals(uv=uv, material=material)
    found: Any = mesh.export(file_type="glb")
    return found
