"""Muscles as tubes along their wrapped path: colour by activation, thickness by tension."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
import viser

from motorgrad.bodies import hill_actuators
from timsim.film import muscle_colour, muscle_radius, muscle_width, tendon_activation
from timsim.live import Session
from timsim.scene._geometry import ball, tube
from timsim.scene._layer import Layer, MeshPool, sent_colour
from timsim.scene._pose import Pose

ARC = 8  # straight segments of an arc
PULLEY = -2  # MuJoCo's mark for a pulley, which cuts a path; -1 is a site, 0 and more the wrapped geom


class Segments(NamedTuple):
    """Straight segments of all paths: from `start` `(n, 3)` to `end` `(n, 3)`, of `tendon` `(n,)`; `last` `(n,)` is
    true where no other segment continues.
    """

    start: np.ndarray
    end: np.ndarray
    tendon: np.ndarray
    last: np.ndarray


def most_segments(model: mujoco.MjModel) -> tuple[int, int]:
    """The most segments that a model's paths can have together, and the number of ends that no segment continues."""
    kinds = mujoco.mjtWrap
    sites = int(np.sum(model.wrap_type == kinds.mjWRAP_SITE))
    wraps = int(np.sum(np.isin(model.wrap_type, (kinds.mjWRAP_SPHERE, kinds.mjWRAP_CYLINDER))))
    spatial = model.wrap_type[model.tendon_adr] != kinds.mjWRAP_JOINT
    pieces = int(np.sum(spatial)) + int(np.sum(model.wrap_type == kinds.mjWRAP_PULLEY))
    # a geom adds two points, with an arc between them
    return sites - pieces + (1 + ARC) * wraps, pieces


def segments(model: mujoco.MjModel, data: mujoco.MjData) -> Segments:
    """The paths of all spatial tendons in the posture of `data`: the engine's own points, with arcs around wrapped
    geoms.
    """
    count = data.ten_wrapnum
    rows = np.arange(count.sum()) + np.repeat(data.ten_wrapadr - (np.cumsum(count) - count), count)
    points = data.wrap_xpos.reshape(-1, 3)[rows]
    kinds = data.wrap_obj.reshape(-1)[rows]
    tendon = np.repeat(np.arange(model.ntendon), count)
    joined = (tendon[1:] == tendon[:-1]) & (kinds[1:] != PULLEY) & (kinds[:-1] != PULLEY)
    at = np.flatnonzero(joined)
    goes_on = np.append(joined[1:], False)[at]
    bent = (kinds[at] >= 0) & (kinds[at] == kinds[at + 1])
    start = points[at]
    end = points[at + 1]
    steps = np.where(bent, ARC, 1)
    whole = np.repeat(np.arange(len(at)), steps)
    # the number of each segment within its arc
    part = np.arange(len(whole)) - np.repeat(np.cumsum(steps) - steps, steps)
    starts = start[whole]
    ends = end[whole]
    if bent.any():
        arcs = _arcs(model, data, kinds[at[bent]], points[at[bent] - 1], start[bent], end[bent])
        curved = bent[whole]
        starts[curved] = arcs[:, :-1].reshape(-1, 3)
        ends[curved] = arcs[:, 1:].reshape(-1, 3)
    last = ~goes_on[whole] & (part == steps[whole] - 1)
    return Segments(starts, ends, tendon[at][whole], last)


def _arcs(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geoms: np.ndarray,
    before: np.ndarray,
    start: np.ndarray,
    end: np.ndarray,
) -> np.ndarray:
    """Points `(n, ARC + 1, 3)` along arcs around spheres and cylinders, to which a path comes straight from `before`.

    The path touches the geom tangentially, which tells the direction of the arc even where that is the longer one.
    Along a cylinder's axis it advances evenly.
    """
    centre = data.geom_xpos[geoms]
    axis = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, :, 2]
    axis = np.where((model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_SPHERE.value)[:, None], 0.0, axis)

    def across(vector: np.ndarray) -> np.ndarray:
        return vector - np.sum(vector * axis, 1, keepdims=True) * axis

    first = across(start - centre)
    second = across(end - centre)
    normal = np.cross(first, across(start - before))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    angle = np.arctan2(np.sum(np.cross(first, second) * normal, 1), np.sum(first * second, 1)) % (2 * np.pi)
    angle = np.where(angle > 2 * np.pi - 1e-6, 0.0, angle)[:, None]
    part = np.linspace(0, 1, ARC + 1)
    turn = (part * angle)[..., None]
    bow = np.cos(turn) * first[:, None] + np.sin(turn) * np.cross(normal, first)[:, None]
    along = np.sum((start - centre) * axis, 1)[:, None] + part * np.sum((end - start) * axis, 1)[:, None]
    arcs = centre[:, None] + bow + along[..., None] * axis[:, None]
    arcs[:, 0], arcs[:, -1] = start, end  # the engine's own points, bit for bit
    return arcs


def peak_force(model: mujoco.MjModel) -> np.ndarray:
    """The greatest force `(nu,)` of each actuator in N: a muscle's strength; 0 if the model does not define it."""
    kinds = mujoco.mjtGain
    gain = np.abs(model.actuator_gainprm[:, 0])
    most = np.abs(model.actuator_ctrlrange).max(axis=1, initial=0.0)
    peak = np.select(
        [
            hill_actuators(model),
            model.actuator_gaintype == kinds.mjGAIN_USER.value,
            model.actuator_gaintype == kinds.mjGAIN_MUSCLE.value,
            model.actuator_forcelimited > 0,
            model.actuator_ctrllimited > 0,
        ],
        [
            model.actuator_biasprm[:, 0],
            gain,
            _strength(model),
            np.abs(model.actuator_forcerange).max(axis=1, initial=0.0),
            gain * most,
        ],
        0.0,
    )
    return peak


def _strength(model: mujoco.MjModel) -> np.ndarray:
    """The peak force of MuJoCo's own muscle: given, or derived from the acceleration it causes."""
    given = model.actuator_gainprm[:, 2]
    scale = model.actuator_gainprm[:, 3]
    return np.where(given > 0, given, scale / np.maximum(model.actuator_acc0, 1e-9))


def tendon_tension(model: mujoco.MjModel, force: np.ndarray) -> np.ndarray:
    """The tension of each tendon, `(ntendon,)`, as a share in [0, 1] of the most that its actuators can pull together.

    **Arguments:** `force` `(nu,)`, MuJoCo's `actuator_force`: negative where it pulls.
    """
    pulls = np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON.value)
    which = model.actuator_trnid[pulls, 0]
    pull = np.zeros(model.ntendon)
    most = np.zeros(model.ntendon)
    np.add.at(pull, which, np.maximum(-force[pulls] * np.sign(model.actuator_gear[pulls, 0]), 0.0))
    np.add.at(most, which, peak_force(model)[pulls])
    return np.clip(pull / np.where(most > 0, most, np.inf), 0, 1)


SLICES = 12  # facets around a tube


class Muscles(Layer):
    """Draws every spatial tendon as a tube: rods along its path, balls where they meet.

    The pools have room for everything that can wrap, so that a muscle that begins to wrap adds no mesh.
    """

    name = "Muscles"

    def build(self, server: viser.ViserServer, session: Session) -> None:
        model = session.model
        if model is None or not model.nwrap:
            return
        most, ends = most_segments(model)
        self.applies = True
        self._tendons = np.zeros(0, int)
        self.pools = [
            MeshPool(server.scene, "/muscles/tubes", tube(SLICES), most),
            MeshPool(server.scene, "/muscles/joints", ball(SLICES), most + ends),
        ]

    def clickable(self) -> list[tuple[Any, np.ndarray]]:
        """viser's handle of the tubes, and of which tendon each copy is in the picture drawn last."""
        return [(self.pools[0].handle, self._tendons)] if self.applies and self.pools[0].handle is not None else []

    def draw(self, pose: Pose) -> None:
        model = pose.model
        assert model is not None
        radius = muscle_radius(model, pose.size / 2)
        tubes = []
        joints = []
        tendons = []
        for data, offset, activation in zip(pose.bodies, pose.offset, pose.activation, strict=True):
            run = segments(model, data)
            level = tendon_activation(model, activation)
            thick = radius * muscle_width(tendon_tension(model, data.actuator_force))
            colour = sent_colour(muscle_colour(level))
            of = run.tendon
            tendons.append(of)
            tubes.append((run.start + offset, run.end + offset, thick[of], colour[of]))
            knots = np.concatenate([run.start, run.end[run.last]]) + offset
            at = np.concatenate([of, of[run.last]])
            joints.append((knots, thick[at], colour[at]))
        self._tendons = np.concatenate(tendons)
        self.pools[0].show_rods(*(np.concatenate(column) for column in zip(*tubes, strict=True)))
        self.pools[1].show_balls(*(np.concatenate(column) for column in zip(*joints, strict=True)))
