"""The parts of bodies that are meshes, with their textures."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.sim import _framing
from motorgrad.sim._colours import geom_colours, pixels, texture_of
from motorgrad.sim.scene._glb import textured
from motorgrad.sim.scene._layer import Layer
from motorgrad.sim.scene._shapes import smooth

if TYPE_CHECKING:
    import mujoco
    import viser

    from motorgrad.sim.live import Session
    from motorgrad.sim.scene._pose import Pose


class Meshes(Layer):
    """Every mesh geom as a node under a frame of its part, so that only the frames of parts that move are sent."""

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self._frames: list[dict[int, Any]] = []
        self._server, model = server, session.model
        if model is None:
            return
        import mujoco

        seen = _framing.visible_geoms(model)
        kinds = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
        self._geoms = seen[np.isin(model.geom_type[seen], kinds)]
        self.applies = bool(self._geoms.size)
        self._parts = np.unique(model.geom_bodyid[self._geoms])

    def draw(self, pose: Pose) -> None:
        assert pose.model is not None
        while len(self._frames) < len(pose.bodies):
            self._add(pose.model, len(self._frames))
        for frames, data, offset in zip(self._frames, pose.bodies, pose.offset, strict=False):
            for part, frame in frames.items():
                frame.position, frame.wxyz = data.xpos[part] + offset, data.xquat[part]
        for row, frames in enumerate(self._frames):
            for frame in frames.values():
                frame.visible = row < len(pose.bodies)

    def _add(self, model: mujoco.MjModel, row: int) -> None:
        """Add the nodes of one more body."""
        scene, colours = self._server.scene, geom_colours(model)
        self._frames.append({part: scene.add_frame(f"/meshes/{row}/{part}", show_axes=False) for part in self._parts})
        for geom in self._geoms:
            name = f"/meshes/{row}/{model.geom_bodyid[geom]}/{geom}"
            where = {"position": model.geom_pos[geom], "wxyz": model.geom_quat[geom]}
            vertices, faces, uv = _mesh(model, model.geom_dataid[geom])
            texture = texture_of(model, int(geom))
            if uv is not None and texture >= 0 and model.tex_nchannel[texture] >= 3:
                import trimesh

                mesh = trimesh.Trimesh(vertices, faces, process=False)
                scene.add_glb(name, textured(mesh, uv, pixels(model, texture)[..., :3] / 255), **where)
                continue
            shape, colour = smooth(vertices, faces), colours[geom]
            opacity = None if colour[3] >= 1 else float(colour[3])
            scene.add_mesh_simple(name, shape.vertices, shape.faces, color=tuple(colour[:3]), opacity=opacity, **where)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Vertices, faces and texture coordinates; where it has these, each face has three vertices of its own."""
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    rows = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    vertices, faces = model.mesh_vert[first : first + count], model.mesh_face[rows]
    start = model.mesh_texcoordadr[mesh]
    if start < 0:
        return vertices, faces, None
    uv = model.mesh_texcoord[start + model.mesh_facetexcoord[rows].ravel()]
    return vertices[faces.ravel()], np.arange(faces.size).reshape(-1, 3), np.array(uv, float)
