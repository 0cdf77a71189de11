"""Where a body is put: gravity, physics step, ground, cameras; for bodies of tasks and for any MuJoCo model."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from motorgrad._errors import check, unknown
from motorgrad.bodies import Body, Terrain, WrappedBody
from motorgrad.tasks import BodyTask, Task


@dataclasses.dataclass(frozen=True)
class Camera:
    """A fixed camera of a scene, offered beside the model's own.

    **Arguments:**

    - `position` (m): where it is.
    - `target` (m): what it looks at.
    - `follow`: the body that it moves along with, not turning; both points are then relative to that body.
    - `field_of_view` (degrees): vertical.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    follow: str | None = None
    field_of_view: float = 45.0

    def __post_init__(self) -> None:
        for name in ("position", "target"):
            check(all(map(math.isfinite, getattr(self, name))), name, getattr(self, name), "three finite numbers")
        apart = math.dist(self.position, self.target)
        check(apart > 0, "target", self.target, "elsewhere than the position")
        check(1 <= self.field_of_view <= 170, "field_of_view", self.field_of_view, "from 1 to 170 degrees")

    def add(self, spec: mujoco.MjSpec, name: str) -> None:
        """Add it to a model's description."""
        taken = [camera.name for camera in spec.cameras]
        check(name not in taken, "cameras", name, f"other than the model's own names, {', '.join(taken)}")
        away = np.subtract(self.position, self.target) / math.dist(self.position, self.target)
        side = np.cross((0.0, 0.0, 1.0), away)
        side = side / np.linalg.norm(side) if np.linalg.norm(side) > 1e-6 else np.array((1.0, 0.0, 0.0))
        turn, place = np.stack([side, np.cross(away, side), away], axis=1), np.array(self.position)
        home = spec.worldbody
        if self.follow is not None:
            names = [body.name for body in spec.bodies if body.name not in ("", "world")]
            if self.follow not in names:
                raise unknown(f"body that camera {name!r} follows:", self.follow, names)
            home = spec.body(self.follow)
            at = _attitude(spec, self.follow)
            turn, place = at.T @ turn, at.T @ place
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, turn.ravel())
        camera = home.add_camera(name=name, pos=place, quat=quaternion, fovy=self.field_of_view)
        if self.follow is not None:
            camera.mode = mujoco.mjtCamLight.mjCAMLIGHT_TRACK


@dataclasses.dataclass(frozen=True)
class Stage:
    """What a scene changes of a body's surroundings; nothing by default.

    **Arguments:** `timestep` (s), of the physics; `gravity` (m/s²), a vector; `terrain` in place of the level ground;
    `cameras` by name.
    """

    timestep: float | None = None
    gravity: tuple[float, float, float] | None = None
    terrain: Terrain | None = None
    cameras: Mapping[str, Camera] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        fine = self.timestep is None or 0 < self.timestep <= 0.1
        check(fine, "timestep", self.timestep, "above 0, at most 0.1 s")
        known = self.gravity is None or all(map(math.isfinite, self.gravity))
        check(known, "gravity", self.gravity, "three finite numbers in m/s²")

    @property
    def empty(self) -> bool:
        """Whether it changes nothing."""
        return self == Stage()

    def of_task(self, task: Task) -> Task:
        """The same task on this stage. **Raises** `ValueError` where it has no body."""
        if self.empty:
            return task
        check(isinstance(task, BodyTask), "task", task.name, "one with a body, where a scene changes its surroundings")
        changed: Any = task
        if self.timestep is not None:
            body = dataclasses.replace(changed.body, timestep=self.timestep)
            changed = dataclasses.replace(changed, body=body)
        ground = self.terrain
        if ground is not None and hasattr(changed, "terrain"):
            changed, ground = dataclasses.replace(changed, terrain=ground), None
        rest = dataclasses.replace(self, timestep=None, terrain=ground)
        return with_body(changed, Staged(changed.dynamics, rest))

    def put_into(self, spec: mujoco.MjSpec) -> None:
        """Change a model's description."""
        if self.timestep is not None:
            spec.option.timestep = self.timestep
        if self.gravity is not None:
            spec.option.gravity = self.gravity
        if self.terrain is not None:
            self.terrain.add(spec)
        for name, camera in self.cameras.items():
            camera.add(spec, name)


@dataclasses.dataclass(frozen=True)
class Staged(WrappedBody):
    """A body on a stage: a body like any other."""

    stage: Stage

    def spec(self) -> mujoco.MjSpec:
        """A fresh description of the body on its stage."""
        spec = self.body.spec()
        self.stage.put_into(spec)
        return spec


def with_body(task: BodyTask, body: Body) -> BodyTask:
    """A task of the same numbers, whose dynamics are another body of the same parts."""
    kind = type(task)
    staged = type(kind.__name__, (kind,), {"dynamics": property(lambda self: body), "__module__": kind.__module__})
    values = {field.name: getattr(task, field.name) for field in dataclasses.fields(task)}  # type: ignore[arg-type]
    return staged(**values)


def _attitude(spec: mujoco.MjSpec, body: str) -> np.ndarray:
    """How a body is turned in the model's reference pose."""
    model: Any = spec.copy().compile()
    data: Any = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return data.body(body).xmat.reshape(3, 3).copy()
