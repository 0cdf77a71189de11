"""Pictures of tasks without a body of their own: the states of a finite world, and the pool of motoneurons of a
recruitment task, with the arm that it lifts.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import dataclasses
from typing import Any

import jax
import mujoco
import numpy as np
import viser

from motorgrad.bodies import lift_table
from motorgrad.tasks import ArmRecruitment, FiniteTask
from motorgrad.tasks import Recruitment as RecruitmentTask
from timsim.film import FIRING, SILENT, geom_colours, muscle_colour
from timsim.live import Session
from timsim.scene._bodies import placed_pieces, unit_pieces
from timsim.scene._geometry import ball, identity_quaternions, rod
from timsim.scene._layer import Layer, MeshPool, sent_colour
from timsim.scene._muscles import segments
from timsim.scene._plane import FLOOR
from timsim.scene._pose import Pose
from timsim.scene._surroundings import floor_glb

MAX_DRAWN_PARTS = 3_000  # states or units
NUMBERED = 30  # states up to which each has its number
# m, of the space that the picture fills
WIDE = 1.1
LOW = 0.2
HIGH = 0.95
GOOD = (0.15, 0.55, 0.30)
BAD = (0.75, 0.25, 0.20)
PLAIN = (0.62, 0.65, 0.68)
PRESENT = (0.98, 0.74, 0.10)
"""Colours of states with a reward above and below 0 and without one, and of the present state."""
LINE = (0.45, 0.48, 0.52)
SHOULDER = -0.5  # m, of an arm from the middle of the picture


class States(Layer):
    """Draws the states of a finite world as balls, in rows from the first to the last, with lines for transitions.

    A ball's colour tells the reward of the state, green above 0 and red below; the present state is larger and yellow.
    """

    def build(self, server: viser.ViserServer, session: Session) -> None:
        task: Any = session.task
        world = task.dynamics if isinstance(task, FiniteTask) else None
        self.applies = world is not None and len(world.observations) <= MAX_DRAWN_PARTS
        if world is None or not self.applies:
            return
        count = len(world.observations)
        columns = count if count <= 12 else int(np.ceil(np.sqrt(1.5 * count)))
        rows = -(-count // columns)
        row, column = np.divmod(np.arange(count), columns)
        step = min(WIDE / max(columns - 1, 1), (HIGH - LOW) / max(rows - 1, 1), 0.25)
        across = (column - (columns - 1) / 2) * step
        up = (LOW + HIGH) / 2 - (row - (rows - 1) / 2) * step
        self._place = np.stack([across, np.zeros(count), up], axis=1)
        self._radius = 0.22 * step
        rewards = world.rewards if world.rewards.ndim == 1 else world.rewards.max(axis=0)
        self._colours = np.array([GOOD if each > 0 else BAD if each < 0 else PLAIN for each in rewards])
        scene = server.scene
        scene.add_glb("/states/floor", floor_glb(np.full(2, 60.0), 1.0, FLOOR), cast_shadow=False)
        self.pools = [MeshPool(scene, "/states/balls", ball() if count <= NUMBERED else ball(8), count)]
        if count <= NUMBERED:
            for state, place in enumerate(self._place):
                scene.add_label(f"/states/{state}", str(state), position=place - [0.0, 0.0, 1.8 * self._radius])
            leads = np.argwhere(world.transitions.max(axis=0) > 0)
            ends = leads[leads[:, 0] != leads[:, 1]]
            lines = MeshPool(scene, "/states/lines", rod(), max(len(ends), 1), shadow=False)
            start = self._place[ends[:, 0]]
            end = self._place[ends[:, 1]]
            lines.show_rods(start, end, 0.05 * self._radius, np.broadcast_to(LINE, start.shape))

    def draw(self, pose: Pose) -> None:
        assert pose.snapshot is not None
        colours = self._colours.copy()
        radius = np.full(len(self._colours), self._radius)
        here = pose.snapshot.position[:, 0]
        present = here[np.isfinite(here)].astype(int)
        colours[present] = PRESENT
        radius[present] = 1.5 * self._radius
        self.pools[0].show_balls(self._place, radius, colours)


class MotoneuronPool(Layer):
    """Draws the pool of a recruitment task as columns, of a height by each unit's share of the pool's force.

    Colours from pale to red show the probability that a unit fires at the load on the label.
    """

    def build(self, server: viser.ViserServer, session: Session) -> None:
        task = session.task
        if not isinstance(task, RecruitmentTask):
            return
        self.applies = True
        sizes = task.sizes[:MAX_DRAWN_PARTS]
        count = len(sizes)
        scene = server.scene
        # an arm takes the left half of the picture
        middle, wide = (0.3 * WIDE, 0.4 * WIDE) if isinstance(task, ArmRecruitment) else (0.0, WIDE)
        step = min(wide / count, 0.2)
        self._across = middle + (np.arange(count) - (count - 1) / 2) * step
        self._unit = " kg" if isinstance(task, ArmRecruitment) else ""
        self._tall = (HIGH - LOW) * sizes / sizes.max()
        self._wide = 0.4 * step
        scene.add_glb("/pool/floor", floor_glb(np.full(2, 60.0), 1.0, FLOOR), cast_shadow=False)
        self.pools = [MeshPool(scene, "/pool/units", rod(), count)]
        self._word = scene.add_label("/pool/load", "", position=(middle, 0.0, HIGH + 0.1), anchor="bottom-center")

    def draw(self, pose: Pose) -> None:
        snapshot = pose.snapshot
        assert snapshot is not None
        count = len(self._across)
        part = np.nan_to_num(snapshot.probability[0, :count])[:, None]
        colour = np.array(SILENT) + part * (np.array(FIRING) - np.array(SILENT))
        place = np.stack([self._across, np.zeros(count), LOW / 2 + self._tall / 2], axis=1)
        size = np.stack([np.full(count, self._wide), np.full(count, self._wide), self._tall], axis=1)
        self.pools[0].show(place, identity_quaternions(count), size, colour)
        word = f"load {snapshot.position[0, 0]:.2f}{self._unit}".replace("-", "−")
        if self._word.text != word:
            self._word.text = word


class LiftedArm(Layer):
    """Draws the arm of `ArmRecruitment` with its load, as high as the pool's mean force lifts it.

    Each decision of the task is a whole lift from rest; the picture shows its greatest height. The muscle's colour,
    from pale to red, shows the mean fraction of the pool that fires.
    """

    def build(self, server: viser.ViserServer, session: Session) -> None:
        task = session.task
        if not isinstance(task, ArmRecruitment):
            return
        self.applies = True
        self._body = task.body
        self._sizes = task.sizes
        self._model = dataclasses.replace(task.body, load=1.0).spec().compile()
        self._data = mujoco.MjData(self._model)
        self._lift = jax.jit(lift_table(task.body).lift)
        self._load = self._model.geom("load").id
        self._ball = float(self._model.geom_size[self._load, 0])  # m, of 1 kg
        colours = geom_colours(self._model)[:, :3]
        scene = server.scene
        self._parts = [
            (MeshPool(scene, f"/arm/{kind}", shape, len(pieces.geom)), sent_colour(colours[pieces.geom]))
            for kind, shape, pieces in unit_pieces(self._model)
        ]
        self._muscle = MeshPool(scene, "/arm/muscle", rod(), 1)
        self.pools = [*(pool for pool, _ in self._parts), self._muscle]

    def draw(self, pose: Pose) -> None:
        snapshot, model, data = pose.snapshot, self._model, self._data
        assert snapshot is not None
        load = max(float(np.nan_to_num(snapshot.position[0, 0])), 0.0)  # told or not
        ratio = float(self._sizes @ np.nan_to_num(snapshot.probability[0, : len(self._sizes)]))
        part = float(self._lift(load, ratio * self._body.full_force))
        data.qpos[0] = np.arccos(1 - part * (1 - np.cos(self._body.most_flexion)))  # whose hand is that high
        model.geom_size[self._load, 0] = self._ball * np.cbrt(load)
        mujoco.mj_forward(model, data)
        offset = np.array([SHOULDER - data.geom("harness").xpos[0], 0.0, 0.0])
        for (pool, colour), (_, _, pieces) in zip(self._parts, unit_pieces(model), strict=True):
            place, turn, size = placed_pieces(data, offset, pieces)
            pool.show(place, turn, size, colour)
        run = segments(model, data)
        thick = 0.3 * float(model.geom("upper_arm").size[0]) * (1 + ratio)
        self._muscle.show_rods(run.start + offset, run.end + offset, thick, muscle_colour(np.array([ratio])))
