"""Place a camera so that a whole motion stays in the picture."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from motorgrad._errors import unknown
from timsim.film._motion import NO_MARKS

if TYPE_CHECKING:
    import mujoco


# The share of half the picture that motion may fill: the top is kept for the caption, the rest is a margin.
SIDEWAYS = 0.90
DOWNWARDS = 0.84
UPWARDS = 0.72
FOLLOW = 3.0  # a path longer than this many body sizes is followed; framed whole, the body would be too small
ABOVE = 90.0, -90.0  # azimuth and elevation of a camera that looks along z at x and y: x to the right, y up
LAST_VISIBLE_GROUP = 2  # MuJoCo's convention: geom groups 3 to 5 are hidden


@dataclass(frozen=True)
class View:
    """A line of sight and what it must contain.

    `camera` is the index of a camera of the model, or -1 for a free camera with the given angles (degrees, MuJoCo's
    convention: at azimuth 90 and elevation 0 it looks along +y, with x to the right). `centres` holds one array
    `(frames, 3)` for each motion; everything that moves stays within `half` `(3,)` metres of it.
    """

    camera: int
    azimuth: float
    elevation: float
    centres: tuple[np.ndarray, ...]
    half: np.ndarray

    @property
    def axes(self) -> np.ndarray:
        """Rows: the picture's right, its up, and towards the viewer; `(3, 3)`."""
        return camera_axes(self.azimuth, self.elevation)

    @property
    def corners(self) -> np.ndarray:
        """The corners of the box `half`, in the picture's axes: `(8, 3)`."""
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        return signs * self.half @ self.axes.T


def camera_axes(azimuth: float, elevation: float) -> np.ndarray:
    """Right, up and towards the viewer, as rows `(3, 3)`, of a camera at these angles in degrees."""
    a, e = np.radians([azimuth, elevation])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    towards = -np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
    return np.stack([right, np.cross(towards, right), towards])


def visible_geoms(model: mujoco.MjModel) -> np.ndarray:
    """The indices of geoms that are neither in a hidden group nor transparent."""
    alpha = np.where(model.geom_matid >= 0, 1.0, model.geom_rgba[:, 3])
    if model.nmat:
        alpha = np.where(model.geom_matid >= 0, model.mat_rgba[model.geom_matid, 3], alpha)
    return np.flatnonzero((alpha > 0) & (model.geom_group <= LAST_VISIBLE_GROUP))


def find_camera(model: mujoco.MjModel, name: str) -> int:
    """The index of the camera called `name`; `ValueError` suggests the nearest name."""
    known = [model.camera(index).name for index in range(model.ncam)]
    if name not in known:
        raise unknown("camera", name, known)
    return known.index(name)


def frame_motions(
    models: Sequence[mujoco.MjModel],
    positions: Sequence[np.ndarray],
    marks: Sequence[np.ndarray],
    camera: str | float | None,
    aspect: float,
) -> View:
    """The view of one or several motions of one kind of body: same angle, same scale.

    **Arguments:** `models`, their `positions` `(frames, nq)` and their `marks` `(frames, marks, 4)`; `camera` as of
    `write_film`; `aspect`: width over height.
    """
    model = models[0]
    chosen = find_camera(model, camera) if isinstance(camera, str) else -1
    if camera is None and "side" in (model.camera(index).name for index in range(model.ncam)):
        chosen = find_camera(model, "side")
    surveys = [_survey(*each, chosen) for each in zip(models, positions, marks, strict=True)]
    boxes = [survey[0] for survey in surveys]
    # a camera given by name is the user's choice; the default must contain the motion
    if camera is None and chosen >= 0 and not all(_holds(model, chosen, survey, aspect) for survey in surveys):
        chosen = -1
    azimuth, elevation = natural_angles(model)
    if chosen >= 0:
        right, _, towards = surveys[0][2][0].T
        azimuth = float(np.degrees(np.arctan2(right[0], -right[1])))
        elevation = float(-np.degrees(np.arcsin(np.clip(towards[2], -1, 1))))
    elif isinstance(camera, int | float):
        azimuth = float(camera)
    centres, half = _centres(boxes, camera_axes(azimuth, elevation)[0])
    return View(chosen, azimuth, elevation, centres, half)


class Outline:
    """Which parts of a model a picture must contain: all that moves, muscles included, and the still parts that are no
    larger than it, such as a shoulder; not the ground, and not a rail.

    **Arguments:** `model`.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        import mujoco

        seen = visible_geoms(model)
        flat = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
        solid = seen[~np.isin(model.geom_type[seen], flat)]
        moves = model.body_weldid[model.geom_bodyid[solid]] != 0
        self._model = model
        self._geoms = solid[moves] if moves.any() else solid
        self._sites = model.wrap_objid[model.wrap_type == mujoco.mjtWrap.mjWRAP_SITE]
        if moves.any() and not moves.all():
            data = mujoco.MjData(model)
            if model.nkey:
                mujoco.mj_resetDataKeyframe(model, data, 0)
            mujoco.mj_kinematics(model, data)
            size = np.linalg.norm(np.ptp(self.box(data), axis=0))
            still = solid[~moves]
            small = 2 * np.linalg.norm(model.geom_aabb[still, 3:], axis=1) <= size
            self._geoms = np.concatenate([self._geoms, still[small]])

    def box(self, data: mujoco.MjData, marks: np.ndarray = NO_MARKS[0]) -> np.ndarray:
        """The lowest and highest corner `(2, 3)` in m, after `mj_kinematics`, of these parts and of `marks`."""
        turn = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        middle = self._model.geom_aabb[self._geoms, :3]
        size = self._model.geom_aabb[self._geoms, 3:]
        centre = data.geom_xpos[self._geoms] + np.einsum("gij,gj->gi", turn, middle)
        reach = np.einsum("gij,gj->gi", np.abs(turn), size)
        points = np.concatenate([centre - reach, centre + reach, data.site_xpos[self._sites]])
        points = points if len(points) else data.xpos
        ball = marks[:, :3]
        radius = marks[:, 3:]
        points = np.concatenate([points, ball - radius, ball + radius])
        return np.stack([points.min(0), points.max(0)])


def bounding_box(model: mujoco.MjModel, position: np.ndarray, marks: np.ndarray = NO_MARKS[0]) -> np.ndarray:
    """The lowest and highest corner `(2, 3)` in m of what a picture must contain in one posture `(nq,)`, with marks."""
    return _survey(model, position[None], marks[None], -1)[0][0]


def _survey(
    model: mujoco.MjModel, positions: np.ndarray, marks: np.ndarray, camera: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Boxes `(frames, 2, 3)` around bodies and marks; the places `(frames, 3)` and axes of the camera."""
    import mujoco

    data = mujoco.MjData(model)
    outline = Outline(model)
    boxes = np.empty((len(positions), 2, 3))
    places = np.zeros((len(positions), 3))
    turns = np.zeros((len(positions), 3, 3))
    for row, position in enumerate(positions):
        data.qpos[:] = position
        mujoco.mj_kinematics(model, data)
        boxes[row] = outline.box(data, marks[row])
        if camera >= 0:
            mujoco.mj_comPos(model, data)
            mujoco.mj_camlight(model, data)
            places[row] = data.cam_xpos[camera]
            turns[row] = data.cam_xmat[camera].reshape(3, 3)
    # a box without size would put the camera inside the body
    thin = np.maximum(0.02 * model.stat.extent - (boxes[:, 1] - boxes[:, 0]), 0) / 2
    boxes[:, 0] -= thin
    boxes[:, 1] += thin
    return boxes, places, turns


def natural_angles(model: mujoco.MjModel) -> tuple[float, float]:
    """Azimuth and elevation: along the hinges where all are parallel (a planar body; along z with y up, `ABOVE`), else
    from the side and slightly above.
    """
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hinges = data.xaxis[model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE]
    turning = np.isin(model.jnt_type, (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL)).any()
    if turning or not len(hinges):
        return (115.0, -14.0) if turning else (90.0, -6.0)
    axis = np.abs(hinges).min(0)  # near 1 only where all hinges are parallel to it
    if axis[2] > 0.98:
        return ABOVE
    return (180.0, -6.0) if axis[0] > 0.98 else (90.0, -6.0)


def _holds(
    model: mujoco.MjModel, camera: int, survey: tuple[np.ndarray, np.ndarray, np.ndarray], aspect: float
) -> bool:
    """Whether every box stays inside the picture of a camera of the model."""
    boxes, places, turns = survey
    pick = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    corners = boxes[:, pick, np.arange(3)]  # (frames, 8, 3)
    local = np.einsum("fcj,fji->fci", corners - places[:, None], turns)
    fovy = model.cam_fovy[camera]
    if getattr(model, "cam_projection", np.zeros(model.ncam))[camera]:  # orthographic: fovy is the height in metres
        tall: np.ndarray | float = fovy / 2
    else:
        tall = -local[..., 2] * np.tan(np.radians(fovy) / 2)
    return bool(np.all(np.abs(local[..., 1]) < tall) and np.all(np.abs(local[..., 0]) < tall * aspect))


def _centres(boxes: Sequence[np.ndarray], right: np.ndarray) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """What the camera looks at in each frame, and how far the motion reaches from there."""
    every = np.concatenate(boxes)
    low = every[:, 0].min(0)
    high = every[:, 1].max(0)
    body = (every[:, 1] - every[:, 0]).max()
    if np.abs(right) @ (high - low) <= FOLLOW * body:
        return tuple(np.tile((low + high) / 2, (len(box), 1)) for box in boxes), (high - low) / 2
    centres = []
    for box in boxes:
        centre = _smooth(box.mean(1))
        centre[:, 2] = (low + high)[2] / 2  # keep the ground still
        centres.append(centre)
    reach = np.abs(every - np.concatenate(centres)[:, None])
    return tuple(centres), reach.max((0, 1))


def _smooth(path: np.ndarray, span: int = 15) -> np.ndarray:
    """A moving average over 2 `span` + 1 frames, mirrored at the ends so that steady motion has no lag."""
    span = min(span, len(path) - 1)
    padded = np.pad(path, ((span, span), (0, 0)), mode="reflect", reflect_type="odd")
    total = np.cumsum(np.concatenate([np.zeros((1, 3)), padded]), 0)
    width = 2 * span + 1
    return (total[width:] - total[:-width]) / width
