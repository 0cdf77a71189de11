"""What to simulate: a learner of a task or a bare MuJoCo model, on a stage with its own gravity, ground and cameras."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import mujoco
import numpy as np

from motorgrad._errors import check, unknown
from motorgrad.bodies import BODIES, Body, Mjcf, Terrain, WrappedBody, compile_model, start_key
from motorgrad.learning import Agent
from motorgrad.policies import Policy
from motorgrad.sim.live._beside import Beside, beside_of
from motorgrad.sim.live._foreign import look_of
from motorgrad.sim.live._policy import load_policy, policy_of_run
from motorgrad.tasks import TASKS, BodyTask, Composed, Gymnasium, Task
from motorgrad.training import Run, check_training

if TYPE_CHECKING:
    from motorgrad.sim.planet import Planet


@dataclasses.dataclass(frozen=True)
class Camera:
    """A fixed camera of a scene, offered beside the model's own.

    **Arguments:**

    - `position` (m): of the camera.
    - `target` (m): the point that it samples at.
    - `follow`: the body that it moves along with, without turning; both points are then relative to that body.
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
        check(apart > 0, "target", self.target, "a point other than the position")
        check(1 <= self.field_of_view <= 170, "field_of_view", self.field_of_view, "from 1 to 170 degrees")

    def add(self, spec: mujoco.MjSpec, name: str) -> None:
        """Add the camera to a model's description."""
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
    """Changes of a body's surroundings; none by default.

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
        """The same task on this stage. **Raises** `ValueError` where the task has no body."""
        if self.empty:
            return task
        check(isinstance(task, BodyTask), "task", task.name, "a task with a body, as a stage changes its surroundings")
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
    """A body on a stage."""

    stage: Stage

    def spec(self) -> mujoco.MjSpec:
        """A fresh description of the body on its stage."""
        spec = self.body.spec()
        self.stage.put_into(spec)
        return spec


def with_body(task: BodyTask, body: Body) -> BodyTask:
    """The same task with another body of the same parts."""
    kind = type(task)
    staged = type(kind.__name__, (kind,), {"dynamics": property(lambda self: body), "__module__": kind.__module__})
    values = {field.name: getattr(task, field.name) for field in dataclasses.fields(task)}  # type: ignore[arg-type]
    return staged(**values)


def _attitude(spec: mujoco.MjSpec, body: str) -> np.ndarray:
    """The rotation of a body in the model's reference pose."""
    model: Any = compile_model(spec.copy())
    data: Any = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return data.body(body).xmat.reshape(3, 3).copy()


@dataclasses.dataclass(frozen=True, eq=False)
class Setup:
    """What a worker simulates; it is sent to the worker's process as a whole.

    - `name`: the title of the page.
    - `task`, `agent`, `seed`: the learner; `task` is None for a bare model.
    - `initial`: the policy to start from, along a leading axis of one, or None for the agent's own; `memory`: what the
      task remembers from when that policy was learned.
    - `frozen`: whether to start without learning.
    - `model`: of the body in view, with the page's cameras; None for worlds in JAX.
    - `folder`: of the run whose policy is the first.
    - `rendered`: whether it is a Gymnasium environment with a picture of its own, and no body.
    - `key`: the keyframe in which a bare model starts; −1 for its reference pose.
    - `label`: of the body, where others stand beside it; `beside`: those others, which act and do not learn.
    """

    name: str
    task: Task | None = None
    agent: Agent | None = None
    seed: int = 0
    initial: Policy | None = None
    memory: Any = None
    frozen: bool = False
    model: mujoco.MjModel | None = None
    folder: Path | None = None
    key: int = 0
    label: str = "learning"
    beside: tuple[Beside, ...] = ()
    rendered: bool = False


def setup_of(
    subject: Task | Body | mujoco.MjModel | Path | str,
    agent: Any = None,
    seed: int = 0,
    *,
    run: Run | Path | str | None = None,
    frozen: bool = False,
    stage: Stage | None = None,
    planet: Planet | None = None,
    beside: Mapping[str, Any] | None = None,
    label: str = "",
) -> Setup:
    """The setup of a learner or of a model without one.

    **Arguments:**

    - `subject`: a task or its name, for a learner; or a body or its name, a compiled MuJoCo model, or the path of an
      MJCF file.
    - `agent`: as `motorgrad.train` takes it.
    - `seed`: of the learner, or of the run that it continues.
    - `run`: a run of the same task, its directory, or a saved policy (.npz): the first policy.
    - `frozen`: whether to start without learning.
    - `stage`: surroundings other than the subject's own.
    - `planet`: a round world instead of level ground, for a task.
    - `beside`: other policies on the same task, by the label of their bodies: a run, its directory, or a pair of one
      and a seed; a policy, or a file of one (.npz); a model of stable-baselines3, or a file of one (.zip); anything
      with a method `predict(observation)`, or such a function; or `"untrained"`. Actions are those of the task's
      Gymnasium environment. They act and do not learn.
    - `label`: of the body itself beside these, by default "learning", or "learned" where it starts `frozen`.

    **Raises** `ValueError` for anything else, for parts that do not fit together, and for a file that MuJoCo refuses.

    ```py
    session = live.Session(live.setup_of("hopper", seed=3))
    ```
    """
    if isinstance(subject, Task) or (isinstance(subject, str) and subject in TASKS):
        found = _of_task(subject, agent, seed, run, frozen, stage or Stage(), planet)
        assert found.task is not None
        assert found.agent is not None
        others = beside_of(found.task, found.agent, beside or {}, seed)
        return dataclasses.replace(found, beside=others, label=label or ("learned" if frozen else "learning"))
    check(planet is None, "planet", planet, "left out where there is no task: only a learner walks on a planet")
    if isinstance(subject, str) and not is_path(subject) and subject not in BODIES:
        raise unknown("task or body", subject, {*TASKS, *BODIES})
    for name, value in (("agent", agent), ("run", run), ("beside", beside)):
        check(value is None, name, value, "left out where there is a model but no task")
    known = isinstance(subject, Path | str | mujoco.MjModel) or hasattr(subject, "spec")
    check(known, "task", subject, "a task, a body, a MuJoCo model, or the path of one")
    return _of_model(subject, stage or Stage())


def _of_task(
    task: Task | str, agent: Any, seed: int, run: Any, frozen: bool, stage: Stage, planet: Planet | None
) -> Setup:
    asked = check_training(task, agent, seeds=[seed])
    staged = stage.of_task(asked.task)
    if planet is not None:
        from motorgrad.sim.planet import on_planet

        check(isinstance(staged, BodyTask), "planet", planet, "left out where the task has no body")
        staged = on_planet(staged, planet)
    initial, memory, folder = None, None, None
    if run is not None:
        folder = run.path if isinstance(run, Run) else Path(run)
        shape = jax.eval_shape(asked.agent.init, jax.random.key(0)).policy
        read: Any = policy_of_run if isinstance(run, Run) else load_policy
        initial, memory = read(run, shape, asked.task.name, seed)
        check_training(staged, asked.agent, seeds=[seed], initial=initial)
    model, rendered = (compile_model(staged.dynamics), False) if isinstance(staged, BodyTask) else look_of(staged)
    shown: Any = {"model": model, "rendered": rendered}
    return Setup(_title(staged), staged, asked.agent, seed, initial, memory, frozen, folder=folder, **shown)


def _title(task: Task) -> str:
    """The name of a task, of the environment behind it, or of the body of a composed one."""
    if isinstance(task, Gymnasium):
        return task.env_id
    name = task.body.spec().modelname if isinstance(task, Composed) else ""
    return task.name if name in ("", "MuJoCo Model") else name  # MuJoCo's own name for a model without one


def _of_model(subject: Any, stage: Stage) -> Setup:
    if isinstance(subject, mujoco.MjModel):
        check(stage.empty, "stage", stage, "left out where the model is compiled")
        return Setup("model", model=subject)
    if isinstance(subject, Path | str) and subject not in BODIES:
        name, body = Path(subject).stem, Mjcf(Path(subject))
    else:
        body: Any = BODIES[subject]() if isinstance(subject, str) else subject
        name = subject if isinstance(subject, str) else type(subject).__name__.lower()
    spec = body.spec()
    stage.put_into(spec)
    model = compile_model(spec)
    return Setup(name, model=model, key=start_key(body, model))


def acting(run: Run, seed: int) -> Agent:
    """An agent that only acts, with a run's policy, for runs whose learner cannot be made again."""
    return Agent(run.policy(seed))


def is_path(subject: Any) -> bool:
    """Whether this names a model's file."""
    return isinstance(subject, Path) or (isinstance(subject, str) and subject.lower().endswith((".xml", ".mjcf")))
