"""The data of a replay: the shapes of the body once, and their positions and the muscles' in each frame."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from timsim.film import (
    MARK,
    MARK_OPACITY,
    geom_colours,
    height_grid,
    muscle_radius,
    nice_step,
    tendon_activation,
    visible_geoms,
)
from timsim.film._appearance import SWELL, set_posture, tendon_paths
from timsim.film._framing import frame_motions

if TYPE_CHECKING:
    import mujoco

STEPS = 32767  # of a length or of a quaternion's number, to each side
PASSIVE = 255  # the level of a tendon without an actuator; activations are from 0 to 254
FINEST = 96  # points of a height field along a side
MAX_CAMERAS = 6


def recorded(
    model: mujoco.MjModel, position: np.ndarray, activation: np.ndarray, marks: np.ndarray
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Describe a motion for the player.

    **Arguments:** `position` `(frames, nq)`, `activation` `(frames, nu)`, `marks` `(frames, marks, 4)` m.

    **Returns:** what holds for all frames, and arrays. Places are int16, in steps of `scale` m from `origin`
    `(frames, 3)` m, the centre of mass.
    """
    import mujoco

    data = mujoco.MjData(model)
    frames = len(position)
    seen = visible_geoms(model)
    parts = np.unique(model.geom_bodyid[seen])
    origin = np.zeros((frames, 3))
    turns = np.zeros((frames, len(parts), 4))
    places = np.zeros((frames, len(parts), 3))
    levels = np.full((frames, model.ntendon), PASSIVE, np.uint8)
    eyes = np.zeros((frames, min(model.ncam, MAX_CAMERAS), 12), np.float32)
    paths = []
    for frame in range(frames):
        set_posture(model, data, position[frame])
        origin[frame] = data.subtree_com[0]
        places[frame] = data.xpos[parts]
        turns[frame] = data.xquat[parts]
        level = tendon_activation(model, activation[frame])
        levels[frame] = np.where(np.isnan(level), PASSIVE, np.round(254 * np.nan_to_num(level)))
        eyes[frame, :, :3] = data.cam_xpos[:MAX_CAMERAS]
        eyes[frame, :, 3:] = data.cam_xmat[:MAX_CAMERAS]
        paths.append(tendon_paths(model, data))
    pieces, points = _of_equal_length(paths)
    turns = _continuous(turns)
    offsets = [places - origin[:, None], points - origin[:, None]]
    scale = max(1e-6, *(float(np.abs(each).max(initial=0.0)) for each in offsets)) / STEPS
    view = frame_motions([model], [position], [marks], None, 1.6)
    size = 2 * float(np.linalg.norm(view.half))
    shapes, arrays = _shapes(model, seen, parts)
    radius = muscle_radius(model, size)
    about = {
        "scale": scale,
        "shapes": shapes,
        "bodies": [model.body(part).name for part in parts],
        "named": [bool(model.body_weldid[part]) for part in parts],
        "pieces": [[tendon, count, float(radius[tendon])] for tendon, count in pieces],
        "swell": SWELL,
        "angles": [view.azimuth, view.elevation],
        "half": view.half.tolist(),
        "mark": [*MARK.tolist(), MARK_OPACITY],
        "grid": nice_step(size),
        "cameras": [model.camera(i).name or f"camera {i}" for i in range(eyes.shape[1])],
        "fovy": [float(each) for each in model.cam_fovy[: eyes.shape[1]]],
    }
    arrays |= {
        "origin": origin.astype(np.float32),
        "places": np.round(offsets[0] / scale).astype(np.int16),
        "turns": np.round(turns * STEPS).astype(np.int16),
        "paths": np.round(offsets[1] / scale).astype(np.int16),
        "levels": levels,
        "marks": marks.astype(np.float32),
        "centres": np.asarray(view.centres[0], np.float32),
        "eyes": eyes,
    }
    return about, arrays


def _of_equal_length(paths: list[list[tuple[int, np.ndarray]]]) -> tuple[list[tuple[int, int]], np.ndarray]:
    """The pieces of tendons with as many points in every frame: `(tendon, points)` of each, and `(frames, points, 3)`.

    A path has more points while it is wrapped around something; the last point of a shorter one is repeated.
    """
    most: dict[tuple[int, int], int] = {}
    keyed = []
    for pieces in paths:
        seen: dict[int, int] = {}
        named = {}
        for tendon, points in pieces:
            key = tendon, seen.setdefault(tendon, 0)
            seen[tendon] += 1
            named[key] = points
            most[key] = max(most.get(key, 0), len(points))
        keyed.append(named)
    order = sorted(most)
    every = np.zeros((len(paths), sum(most.values()), 3))
    for frame, named in enumerate(keyed):
        start = 0
        for key in order:
            points = named.get(key, np.zeros((1, 3)))
            every[frame, start : start + len(points)] = points
            every[frame, start + len(points) : start + most[key]] = points[-1]
            start += most[key]
    return [(key[0], most[key]) for key in order], every


def _continuous(turns: np.ndarray) -> np.ndarray:
    """Quaternions `(frames, bodies, 4)` with the sign of the frame before, for interpolation."""
    same = np.sum(turns[1:] * turns[:-1], axis=2) >= 0
    sign = np.cumprod(np.where(same, 1.0, -1.0), axis=0)
    return np.concatenate([turns[:1], turns[1:] * sign[:, :, None]])


def _shapes(
    model: mujoco.MjModel, seen: np.ndarray, parts: np.ndarray
) -> tuple[list[dict[str, Any]], dict[str, np.ndarray]]:
    """The geoms, in the frames of their bodies, and the vertices and triangles of meshes and height fields."""
    import mujoco

    kinds = mujoco.mjtGeom
    simple = {
        int(kinds.mjGEOM_PLANE): "plane",
        int(kinds.mjGEOM_SPHERE): "ball",
        int(kinds.mjGEOM_CAPSULE): "capsule",
        int(kinds.mjGEOM_ELLIPSOID): "egg",
        int(kinds.mjGEOM_CYLINDER): "rod",
        int(kinds.mjGEOM_BOX): "block",
    }
    colours = geom_colours(model)
    shapes = []
    arrays = {}
    for geom in seen:
        kind = int(model.geom_type[geom])
        index = int(model.geom_dataid[geom])
        shape = simple.get(kind)
        if shape is None and kind in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF):
            shape = f"mesh{index}"
            if f"{shape}.points" not in arrays:
                points = slice(model.mesh_vertadr[index], model.mesh_vertadr[index] + model.mesh_vertnum[index])
                faces = slice(model.mesh_faceadr[index], model.mesh_faceadr[index] + model.mesh_facenum[index])
                arrays[f"{shape}.points"] = np.asarray(model.mesh_vert[points], np.float32)
                arrays[f"{shape}.faces"] = np.asarray(model.mesh_face[faces], np.uint32)
        elif shape is None and kind == kinds.mjGEOM_HFIELD:
            shape = f"field{index}"
            arrays[f"{shape}.points"], arrays[f"{shape}.faces"] = _field(model, index)
        if shape is None:
            continue
        shapes.append(
            {
                "shape": shape,
                "body": int(np.searchsorted(parts, model.geom_bodyid[geom])),
                "size": model.geom_size[geom].tolist(),
                "place": model.geom_pos[geom].tolist(),
                "turn": model.geom_quat[geom].tolist(),
                "colour": colours[geom].tolist(),
            }
        )
    return shapes, arrays


def _field(model: mujoco.MjModel, index: int) -> tuple[np.ndarray, np.ndarray]:
    """A height field as a mesh: points `(n, 3)` and triangles `(m, 3)`."""
    wide, long, up, _ = model.hfield_size[index]
    grid = height_grid(model, index)
    rows, columns = (np.unique(np.linspace(0, n - 1, min(n, FINEST)).astype(int)) for n in grid.shape)
    y, x = np.meshgrid(
        (2 * rows / (grid.shape[0] - 1) - 1) * long, (2 * columns / (grid.shape[1] - 1) - 1) * wide, indexing="ij"
    )
    points = np.stack([x, y, up * grid[np.ix_(rows, columns)]], 2).reshape(-1, 3)
    at = np.arange(x.size).reshape(x.shape)
    a = at[:-1, :-1]
    b = at[:-1, 1:]
    c = at[1:, 1:]
    d = at[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3), np.stack([a, c, d], 2).reshape(-1, 3)])
    return points.astype(np.float32), faces.astype(np.uint32)
