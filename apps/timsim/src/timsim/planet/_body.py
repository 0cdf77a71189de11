"""A body on a planet: its model, its physics in a local frame, and tasks that use it."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import mujoco
import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.bodies import Body, BodyBatch, WrappedBody, compile_model
from motorgrad.tasks import BodyTask, Task
from timsim.planet._geometry import Frame, quaternion
from timsim.planet._planet import FIELD, Planet

PLANET = "planet"
"""The name of the body, without geoms, whose pose is that of the planet in local coordinates."""
_LIGHT = 1e-6  # kg; negligible in the centre of mass


@dataclasses.dataclass(frozen=True)
class OnPlanet(WrappedBody):
    """A body on a planet, whose floor is the patch of ground around it.

    The planet is part of the model, last in `qpos`, so that a posture also tells where on the planet the body is.
    Simulate it with `PlanetBatch`, which moves the patch; otherwise the body falls off its edge.

    **Arguments:** `body`: every part attached to the world must have a free joint; `planet` under it.

    **Raises:** `ValueError` for a body that is attached to the world, or has no geom "floor".
    """

    planet: Planet = dataclasses.field(default_factory=Planet)

    def spec(self) -> mujoco.MjSpec:
        """A fresh, editable `mujoco.MjSpec` of the body, its patch of ground, and the planet."""
        spec = self.body.spec()
        free = mujoco.mjtJoint.mjJNT_FREE
        held = [part.name for part in spec.worldbody.bodies if [joint.type for joint in part.joints] != [free]]
        check(not held, "parts of the body that the world holds", held, "none, each with a free joint, on a planet")
        floor = spec.geom("floor")
        check(floor is not None, "geoms of the body", [geom.name for geom in spec.geoms], "a list with 'floor'")
        check(not spec.hfields, "height fields of the body", len(spec.hfields), "none: the planet has its own terrain")
        plain = compile_model(self.body)
        self.planet.ground.add(spec, floor)
        spec.delete(floor)
        planet = spec.worldbody.add_body(name=PLANET, mass=_LIGHT, inertia=(_LIGHT,) * 3, gravcomp=1.0)
        planet.explicitinertial = True
        planet.add_freejoint(name=PLANET)
        pose, lift = self.planet.start.pose, self.planet.lift
        planet.pos = pose[:3]
        planet.quat = pose[3:]
        parts = plain.jnt_qposadr[plain.jnt_type == free]
        for key in spec.keys:
            position = np.array(key.qpos)
            position[parts + 2] += lift
            key.qpos = np.concatenate([position, pose])
            if len(key.qvel):
                key.qvel = np.concatenate([key.qvel, np.zeros(6)])
        # of the body alone, as viewers scale their scene by it
        for name in ("meanmass", "meansize", "extent", "center"):
            setattr(spec.stat, name, getattr(plain.stat, name))
        return spec


def has_planet(model: mujoco.MjModel) -> bool:
    """Whether a model is that of a body on a planet."""
    named = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) >= 0 for name in (PLANET, FIELD)]
    return all(named)


class PlanetBatch(BodyBatch):
    """The simulation of one body on a planet.

    It is a `BodyBatch` of one seed, as the ground follows one body. At the beginning of a `step`, gravity is turned to
    point down at the body's first part. Where that part is too far from the middle of the patch, the local frame is
    levelled under it, the patch is moved, and all poses and velocities are converted to the new frame: the body's
    motion over the planet stays the same. Local x and y continue, as if the planet rolled away under a plane.

    **Arguments** and attributes are those of `BodyBatch`, for one `OnPlanet`; and

    - `patch_updates`: how often the patch was written.

    **Raises:** `ValueError` for another body, or more seeds than one.

    ```py
    batch = PlanetBatch(OnPlanet(Hexapod(drive="servos"), Planet()), substeps=4)
    batch.step(np.zeros((1, 12)))
    ```
    """

    def __init__(self, body: OnPlanet, seeds: int = 1, substeps: int = 10, threads: int = 1):
        check(isinstance(body, OnPlanet) and not isinstance(body, Sequence), "body", body, "one OnPlanet")
        check(seeds == 1, "seeds", seeds, "1: the ground of a planet follows one body")
        self.patch_updates = 0
        self._ground, self._ellipsoid = body.planet.ground, body.planet.ellipsoid
        self._frame: Frame | None = None
        super().__init__(body, 1, substeps, threads)

    def _bind(self) -> None:
        super()._bind()
        model = self.model
        self._down = float(np.linalg.norm(model.opt.gravity))
        planet = model.joint(PLANET)
        self._pose = slice(int(planet.qposadr[0]), int(planet.qposadr[0]) + 7)
        free = [i for i in range(model.njnt) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_FREE and i != planet.id]
        self._places = [int(model.jnt_qposadr[i]) for i in free]
        self._speeds = [int(model.jnt_dofadr[i]) for i in free]
        self._qpos, self._qvel, self._mocap, self._pushes, self._guess = (
            self._batch.bind(name)[0] for name in ("qpos", "qvel", "mocap_pos", "xfrc_applied", "qacc_warmstart")
        )

    @property
    def frame(self) -> Frame:
        """The local frame."""
        return Frame.of_pose(self._qpos[self._pose])

    @property
    def place(self) -> Float[np.ndarray, " 3"]:
        """The position of the body's first part in the planet's coordinates, m."""
        return self.frame.to_planet(self._root)

    @property
    def _root(self) -> Float[np.ndarray, " 3"]:
        return self._qpos[self._places[0] : self._places[0] + 3].copy()

    def step(self, control: npt.ArrayLike) -> None:
        """Advance by one decision; as `BodyBatch.step`."""
        if np.isfinite(self._root).all():
            self.recentre()
        super().step(control)

    def recentre(self) -> None:
        """Level the frame under the body if it has moved far, and update patch and gravity."""
        frame, root = self.frame, self._root
        planet = self.body.planet
        if np.hypot(*(root - frame.foot(self._ellipsoid))[:2]) > planet.travel * planet.patch:
            self._carry(frame, frame.levelled(self._ellipsoid, root))
        self._update_patch()

    def reset(self, rows: Sequence[int] | np.ndarray | None = None) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the body to its start; as `BodyBatch.reset`."""
        self._update_patch(self.body.planet.start)
        super().reset(rows)
        self._update_patch()

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        """Restore a snapshot; as `BodyBatch.restore`."""
        super().restore(snapshot)
        self._update_patch()

    def _update_patch(self, frame: Frame | None = None) -> None:
        """Write the patch and gravity of a frame, by default the present one, where they have changed."""
        root = np.zeros(3) if frame is not None else self._root
        frame = frame or self.frame
        model, old = self.model, self._frame
        if old is None or not all(np.array_equal(a, b) for a, b in zip(old, frame, strict=True)):
            self._frame = frame
            self._middle = self._ground.write(model, frame)
            self.patch_updates += 1
        model.opt.gravity[:] = -self._down * frame.up(self._ellipsoid, root)
        self.refresh_models()
        self._mocap[...] = self._middle

    def _carry(self, old: Frame, new: Frame) -> None:
        """Convert the state of everything that moves from one frame's coordinates to another's."""
        turn, shift = old.move_to(new)
        turned = quaternion(turn)
        for place, speed in zip(self._places, self._speeds, strict=True):
            position = self._qpos[place : place + 3]
            attitude = self._qpos[place + 3 : place + 7]
            position[:] = turn @ position + shift
            product = np.empty(4)
            mujoco.mju_mulQuat(product, turned, attitude.copy())
            attitude[:] = product
            # angular velocities of a free joint are in its own axes, which turn with it
            for linear in (self._qvel[speed : speed + 3], self._guess[speed : speed + 3]):
                linear[:] = turn @ linear
        for three in (self._pushes[..., :3], self._pushes[..., 3:]):
            three[:] = three @ turn.T
        self._qpos[self._pose] = new.pose
        self._qvel[int(self.model.joint(PLANET).dofadr[0]) :][:6] = 0.0


T = TypeVar("T", bound=Task)


def on_planet(task: T, planet: Planet) -> T:
    """The same task with its body on a planet, for one seed.

    Observations and rewards are measured in local coordinates, in which x and y continue as the body goes around.

    **Raises:** `ValueError` for a task without a body, or one with its own dynamics or terrain.
    """
    check(isinstance(task, BodyTask), "task", getattr(task, "name", task), "a task on a body")
    assert isinstance(task, BodyTask)
    moved = OnPlanet(task.dynamics, planet)
    moved.spec()
    kind: Any = type(task)
    level = kind.batch is BodyTask.batch and kind.begin is BodyTask.begin
    check(
        level, "task", task.name, "a task on level ground that begins in the body's own pose, to be moved to a planet"
    )

    class Moved(kind):
        """The task with its body on a planet."""

        @property
        def dynamics(self) -> Body:
            return moved

        def batch(self, seeds: Sequence[int], threads: int = 0) -> PlanetBatch:
            del threads
            return PlanetBatch(moved, len(seeds), substeps=self.substeps)

    Moved.__name__ = Moved.__qualname__ = f"{kind.__name__}OnPlanet"
    new = copy.copy(task)
    object.__setattr__(new, "__class__", Moved)
    return new
