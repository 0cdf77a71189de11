"""Tiles as a browser takes them."""

# pyright: reportAttributeAccessIssue=false
# (the modules of trimesh are found as they are used)

import io

import numpy as np

from motorgrad.sim.planet._tile import Tile


def to_glb(tile: Tile) -> bytes:
    """A tile as GLB, coloured by its vertices, its shading smooth."""
    import trimesh

    mesh = trimesh.Trimesh(tile.vertices, tile.faces, process=False)
    material = trimesh.visual.material.PBRMaterial(metallicFactor=0.0, roughnessFactor=0.95, doubleSided=False)
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    opaque = np.full(len(tile.colours), 255, np.uint8)
    mesh.visual.vertex_attributes["color"] = np.c_[tile.colours, opaque]
    with io.BytesIO() as file:
        mesh.export(file, file_type="glb", include_normals=True)
        return file.getvalue()
