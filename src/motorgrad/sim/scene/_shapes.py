"""Meshes of size one, of which everything that moves is made."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np

SLICES = 24  # facets around; a tube of a few centimetres is round with so many


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh: `vertices` `(n, 3)` float32, `faces` `(m, 3)` uint32."""

    vertices: np.ndarray
    faces: np.ndarray


@functools.cache
def ball(slices: int = SLICES) -> Shape:
    """A sphere of radius 1."""
    import trimesh

    return _shape(trimesh.creation.uv_sphere(1.0, count=(slices // 2 + 1, slices)))


@functools.cache
def rod() -> Shape:
    """A cylinder of radius 1 about z, from z = -1/2 to 1/2."""
    import trimesh

    return _shape(trimesh.creation.cylinder(1.0, 1.0, sections=SLICES))


@functools.cache
def tube(slices: int = SLICES) -> Shape:
    """A cylinder of radius 1 about z, from z = -1/2 to 1/2, open at both ends."""
    import trimesh

    return _shape(trimesh.creation.revolve(np.array([(1.0, -0.5), (1.0, 0.5)]), sections=slices))


@functools.cache
def block() -> Shape:
    """A box from -1 to 1 along each axis."""
    import trimesh

    return _shape(trimesh.creation.box((2.0, 2.0, 2.0)))


@functools.cache
def ring() -> Shape:
    """A thin ring of radius 1 about z."""
    import trimesh

    return _shape(trimesh.creation.torus(1.0, 0.02, major_sections=2 * SLICES, minor_sections=6))


@functools.cache
def arrow() -> Shape:
    """An arrow along z, from 0 to its tip at 1."""
    import trimesh

    line = [(0, 0), (0.035, 0), (0.035, 0.76), (0.09, 0.76), (0, 1)]
    return _shape(trimesh.creation.revolve(np.array(line), sections=SLICES // 2))


def smooth(vertices: np.ndarray, faces: np.ndarray) -> Shape:
    """A mesh whose edges sharper than 30° have vertices of their own; others would be shaded round."""
    import trimesh

    mesh = trimesh.graph.smooth_shade(trimesh.Trimesh(vertices, faces), angle=np.radians(30))
    return Shape(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32))


def _shape(mesh: Any) -> Shape:
    return smooth(mesh.vertices, mesh.faces)
