"""Bodies: geoms and meshes of their parts, and on request sites, joint axes and labels."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np
import trimesh
import viser

from timsim.film import MARK, MARK_OPACITY, geom_colours, texture_of, texture_pixels, visible_geoms
from timsim.live import Session
from timsim.scene._beside import tinted_beside
from timsim.scene._geometry import (
    Shape,
    arrow,
    ball,
    block,
    quaternions_from_matrices,
    quaternions_from_z,
    rod,
    smooth_shaded,
    textured_glb,
)
from timsim.scene._layer import Layer, MeshPool, place_nodes, sent_colour, unchanging
from timsim.scene._pose import Pose

# of the part that is chosen
TINT = (1.0, 0.62, 0.0)
TINT_SHARE = 0.65
APART = 0.02  # relative difference in size of two coinciding balls; more than facets depart from a sphere


class Pieces(NamedTuple):
    """Copies of one unit shape: of `geom` `(n,)`, at `shift` `(n,)` m along its own z, of `size` `(n, 3)`."""

    geom: np.ndarray
    shift: np.ndarray
    size: np.ndarray

    def take(self, chosen: np.ndarray) -> Pieces:
        """Some of the copies."""
        return Pieces(*(column[chosen] for column in self))


class Bodies(Layer):
    """Draws geoms as copies of three unit meshes; a capsule is a rod and two balls.

    So the number of messages does not grow with the body, and only positions and rotations are sent.

    **Attributes:** `chosen`: the number of the body whose geoms are tinted; −1 for none.
    """

    chosen = -1

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self._parts: list[tuple[MeshPool, str, np.ndarray]] = []
        self._pieces: dict[str, Pieces] = {}
        model = session.model
        if model is None:
            return
        self._colours = geom_colours(model)
        self._drawn = (-1, -1)
        self._copies: list[tuple[Any, ...]] = []
        for kind, shape, pieces in unit_pieces(model):
            self._pieces[kind] = pieces
            for clear in (False, True):
                some = np.flatnonzero((self._colours[pieces.geom, 3] < 1) == clear)
                if not some.size:
                    continue
                node = f"/bodies/{kind}{'/clear' if clear else ''}"
                opacity = self._colours[pieces.geom[some], 3] if clear else None
                pool = MeshPool(server.scene, node, shape, some.size, shadow=not clear, opacity=opacity)
                self._parts.append((pool, kind, some))
        self.pools = [pool for pool, *_ in self._parts]
        self.applies = bool(self.pools)

    def draggable(self) -> list[tuple[Any, np.ndarray]]:
        """What can be dragged: viser's handles, and the geom of each copy."""
        known = [part for part in self._parts if part[0].handle is not None]
        return [(pool.handle, self._pieces[kind].geom[some]) for pool, kind, some in known]

    def draw(self, pose: Pose) -> None:
        assert pose.model is not None
        drawn = (pose.edits, self.chosen)
        if drawn != self._drawn:  # sizes may have changed; the number of copies does not
            self._drawn = drawn
            pieces = {kind: pieces for kind, _, pieces in unit_pieces(pose.model)}
            colours = tinted(pose.model, self._colours, self.chosen)
            self._copies = []
            for _, kind, some in self._parts:
                copies = pieces[kind].take(some)
                rgb = colours[copies.geom, :3]
                self._copies.append((copies, rgb, *map(unchanging, (copies.size, sent_colour(rgb)))))
        for (pool, *_), (copies, rgb, size, colour) in zip(self._parts, self._copies, strict=True):
            if len(pose.bodies) == 1:
                place, turn, _ = placed_pieces(pose.bodies[0], pose.offset[0], copies)
                pool.show(place, turn, size, colour)
                continue
            rows = [
                (*placed_pieces(data, offset, copies)[:2], size, tinted_beside(rgb, row))
                for row, (data, offset) in enumerate(zip(pose.bodies, pose.offset, strict=True))
            ]
            pool.show(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def tinted(model: mujoco.MjModel, colours: np.ndarray, body: int) -> np.ndarray:
    """The colours of all geoms, with those of one body tinted."""
    share = TINT_SHARE * (model.geom_bodyid == body)[:, None]
    return np.concatenate([colours[:, :3] + share * (np.array(TINT) - colours[:, :3]), colours[:, 3:]], axis=1)


def placed_pieces(data: mujoco.MjData, offset: np.ndarray, pieces: Pieces) -> tuple[np.ndarray, ...]:
    """Positions, rotations and sizes of copies, moved by `offset`."""
    turn = data.geom_xmat[pieces.geom].reshape(-1, 3, 3)
    place = data.geom_xpos[pieces.geom] + pieces.shift[:, None] * turn[:, :, 2] + offset
    return place, quaternions_from_matrices(turn), pieces.size


def unit_pieces(model: mujoco.MjModel) -> Iterator[tuple[str, Shape, Pieces]]:
    """The copies of each unit shape."""
    kinds = mujoco.mjtGeom
    seen = visible_geoms(model)

    def of(kind: int) -> tuple[np.ndarray, np.ndarray]:
        geoms = seen[model.geom_type[seen] == kind]
        return geoms, model.geom_size[geoms]

    spheres, sphere = of(kinds.mjGEOM_SPHERE)
    eggs, egg = of(kinds.mjGEOM_ELLIPSOID)
    capsules, capsule = of(kinds.mjGEOM_CAPSULE)
    cylinders, cylinder = of(kinds.mjGEOM_CYLINDER)
    boxes, box = of(kinds.mjGEOM_BOX)
    none = np.zeros(len(capsules))
    half = capsule[:, 1]
    # where two limbs meet, their ends are the same ball in two colours: make one of them larger
    ends = capsule[:, [0, 0, 0]] * (1 + APART * (model.geom_bodyid[capsules, None] % 3))
    yield (
        "balls",
        ball(),
        Pieces(
            np.concatenate([spheres, eggs, capsules, capsules]),
            np.concatenate([0 * sphere[:, 0], 0 * egg[:, 0], half, -half]),
            np.concatenate([sphere[:, [0, 0, 0]], egg, ends, ends]),
        ),
    )
    yield (
        "rods",
        rod(),
        Pieces(
            np.concatenate([cylinders, capsules]),
            np.concatenate([0 * cylinder[:, 0], none]),
            np.concatenate([cylinder[:, [0, 0, 1]], capsule[:, [0, 0, 1]]]) * [1, 1, 2],
        ),
    )
    yield "blocks", block(), Pieces(boxes, 0 * box[:, 0], box)


class Meshes(Layer):
    """Draws mesh geoms as nodes under a frame of their body part, so that only frames of moving parts are sent.

    **Attributes:** `chosen`: the number of the body whose geoms are tinted; −1 for none. Textured ones are not.
    """

    chosen = -1

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self._frames: list[dict[int, Any]] = []
        self._nodes: list[tuple[Any, int]] = []
        self._placed: dict[int, np.ndarray] = {}
        self._tinted = -1
        self._seen = 0
        self._server, model = server, session.model
        if model is None:
            return

        seen = visible_geoms(model)
        kinds = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
        self._geoms = seen[np.isin(model.geom_type[seen], kinds)]
        self.applies = bool(self._geoms.size)
        self._parts = np.unique(model.geom_bodyid[self._geoms])

    def draggable(self) -> list[tuple[Any, np.ndarray]]:
        """viser's handles of the meshes of the first body, and their geoms."""
        return [(node, np.array([geom])) for node, geom in self._nodes]

    def draw(self, pose: Pose) -> None:
        assert pose.model is not None
        if self.chosen != self._tinted:
            self._tinted = self.chosen
            colours = geom_colours(pose.model)
            for node, geom in self._nodes:
                if hasattr(node, "color"):
                    node.color = tuple(map(int, 255 * tinted(pose.model, colours, self.chosen)[geom, :3]))
        while len(self._frames) < len(pose.bodies):
            self._add(pose.model, len(self._frames))
        for row, (data, offset) in enumerate(zip(pose.bodies, pose.offset, strict=True)):
            handles = list(self._frames[row].values())
            places = data.xpos[self._parts] + offset
            self._placed[row] = place_nodes(handles, places, data.xquat[self._parts], self._placed.get(row))
        if len(pose.bodies) != self._seen:
            self._seen = len(pose.bodies)
            for row, frames in enumerate(self._frames):
                for frame in frames.values():
                    frame.visible = row < self._seen

    def _add(self, model: mujoco.MjModel, row: int) -> None:
        """Add the nodes of one more body."""
        scene = self._server.scene
        colours = geom_colours(model)
        self._frames.append({part: scene.add_frame(f"/meshes/{row}/{part}", show_axes=False) for part in self._parts})
        for geom in self._geoms:
            name = f"/meshes/{row}/{model.geom_bodyid[geom]}/{geom}"
            where = {"position": model.geom_pos[geom], "wxyz": model.geom_quat[geom]}
            vertices, faces, uv = _mesh(model, model.geom_dataid[geom])
            texture = texture_of(model, int(geom))
            if uv is not None and texture >= 0 and model.tex_nchannel[texture] >= 3:
                mesh = trimesh.Trimesh(vertices, faces, process=False)
                picture = texture_pixels(model, texture)[..., :3] / 255
                node: Any = scene.add_glb(name, textured_glb(mesh, uv, picture), **where)
                self._nodes += [(node, int(geom))] if row == 0 else []
                continue
            shape = smooth_shaded(vertices, faces)
            colour = colours[geom]
            opacity = None if colour[3] >= 1 else float(colour[3])
            style = {"color": tuple(tinted_beside(colour[None, :3], row)[0]), "opacity": opacity}
            node = scene.add_mesh_simple(name, shape.vertices, shape.faces, **style, **where)
            self._nodes += [(node, int(geom))] if row == 0 else []


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Vertices, faces and texture coordinates; with these, each face has three vertices of its own."""
    first = model.mesh_vertadr[mesh]
    count = model.mesh_vertnum[mesh]
    rows = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    vertices = model.mesh_vert[first : first + count]
    faces = model.mesh_face[rows]
    start = model.mesh_texcoordadr[mesh]
    if start < 0:
        return vertices, faces, None
    uv = model.mesh_texcoord[start + model.mesh_facetexcoord[rows].ravel()]
    return vertices[faces.ravel()], np.arange(faces.size).reshape(-1, 3), np.array(uv, float)


SITE = (0.55, 0.25, 0.75)
HINGE = (0.10, 0.35, 0.85)
SLIDE = (0.95, 0.55, 0.10)


class Targets(Layer):
    """Draws the places that a task marks, such as targets, as translucent balls."""

    name = "Targets"

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self.applies = session.task is not None and session.model is not None and session.sizes.marks > 0
        if self.applies:
            room = 2 * session.sizes.marks // 4
            self.pools = [MeshPool(server.scene, "/targets", ball(), room, shadow=False, opacity=MARK_OPACITY)]

    def draw(self, pose: Pose) -> None:
        snapshot = pose.snapshot
        assert snapshot is not None
        marks = snapshot.marks.reshape(len(snapshot.marks), -1, 4)
        place = (marks[..., :3] + pose.offset[:, None]).reshape(-1, 3)
        self.pools[0].show_balls(place, marks[..., 3].ravel(), MARK)


class Sites(Layer):
    """Draws every site as a small ball: muscle attachments and sensors."""

    name = "Sites"
    initially_shown = False

    def build(self, server: viser.ViserServer, session: Session) -> None:
        if session.model is not None and session.model.nsite:
            self.applies = True
            self.pools = [MeshPool(server.scene, "/sites", ball(12), session.model.nsite, shadow=False)]

    def draw(self, pose: Pose) -> None:
        place = np.concatenate([data.site_xpos + at for data, at in zip(pose.bodies, pose.offset, strict=True)])
        self.pools[0].show_balls(place, 0.014 * pose.size, SITE)


class JointAxes(Layer):
    """Draws an arrow through each hinge, about which it turns by the right-hand rule, and along each slide."""

    name = "Joint axes"
    initially_shown = False

    def build(self, server: viser.ViserServer, session: Session) -> None:
        model = session.model
        if model is None:
            return
        kinds = mujoco.mjtJoint
        self._joints = np.flatnonzero(np.isin(model.jnt_type, (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE)))
        if self._joints.size:
            slides = model.jnt_type[self._joints] == kinds.mjJNT_SLIDE
            self._colours = np.where(slides[:, None], SLIDE, HINGE)
            self.applies = True
            self.pools = [MeshPool(server.scene, "/joints", arrow(), self._joints.size, shadow=False)]

    def draw(self, pose: Pose) -> None:
        at = self._joints
        axes = np.concatenate([data.xaxis[at] for data in pose.bodies])
        anchors = np.concatenate([data.xanchor[at] + by for data, by in zip(pose.bodies, pose.offset, strict=True)])
        long = 0.13 * pose.size
        colours = np.tile(self._colours, (len(pose.bodies), 1))
        turn = quaternions_from_z(axes)
        size = np.full((len(axes), 3), long)
        self.pools[0].show(anchors - axes * long / 2, turn, size, colours)
