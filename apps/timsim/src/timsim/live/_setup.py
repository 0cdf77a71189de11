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
from motorgrad._limits import MAX_MOTION_SECONDS
from motorgrad._myosuite import is_of_myosuite, models
from motorgrad.bodies import BODIES, BUNDLED, Body, Mjcf, Terrain, WrappedBody, compile_model, start_key
from motorgrad.learning import Agent, Learner
from motorgrad.policies import Policy
from motorgrad.schema import Settings, inner, number, static
from motorgrad.tasks import TASKS, BodyTask, Composed, Gymnasium, Task, load, myosuite, myosuite_ids
from motorgrad.training import Run, check_training
from timsim.film import Motion, read_motion
from timsim.live._beside import Beside, beside_of
from timsim.live._foreign import appearance_of
from timsim.live._policy import load_policy, policy_of_run

if TYPE_CHECKING:
    from timsim.planet import Planet


MYOSUITE = "myosuite:"
"""What precedes the id of an environment of MyoSuite whose model is meant, without its task."""


@dataclasses.dataclass(frozen=True)
class Camera(Settings):
    """A fixed camera of a scene, offered beside the model's own."""

    position: tuple[float, float, float] = static(unit="m", help="of the camera")
    target: tuple[float, float, float] = static((0.0, 0.0, 0.0), unit="m", help="the point that it looks at")
    follow: str | None = static(
        None, help="the body that it moves along with, without turning; both points are then relative to that body"
    )
    field_of_view: float = number(45.0, 1, 170, unit="degrees", help="vertical")

    def validate(self) -> None:
        apart = math.dist(self.position, self.target)
        check(apart > 0, "target", self.target, "a point other than the position")

    def add(self, spec: mujoco.MjSpec, name: str) -> None:
        """Add the camera to a model's description."""
        taken = [camera.name for camera in spec.cameras]
        check(name not in taken, "cameras", name, f"other than the model's own names, {', '.join(taken)}")
        away = np.subtract(self.position, self.target) / math.dist(self.position, self.target)
        side = np.cross((0.0, 0.0, 1.0), away)
        side = side / np.linalg.norm(side) if np.linalg.norm(side) > 1e-6 else np.array((1.0, 0.0, 0.0))
        turn = np.stack([side, np.cross(away, side), away], axis=1)
        place = np.array(self.position)
        home = spec.worldbody
        if self.follow is not None:
            names = [body.name for body in spec.bodies if body.name not in ("", "world")]
            if self.follow not in names:
                raise unknown(f"body that camera {name!r} follows:", self.follow, names)
            home = spec.body(self.follow)
            at = _attitude(spec, self.follow)
            turn = at.T @ turn
            place = at.T @ place
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, turn.ravel())
        camera = home.add_camera(name=name, pos=place, quat=quaternion, fovy=self.field_of_view)
        if self.follow is not None:
            camera.mode = mujoco.mjtCamLight.mjCAMLIGHT_TRACK


@dataclasses.dataclass(frozen=True)
class Stage(Settings):
    """Changes to a body's surroundings; none by default."""

    timestep: float | None = number(None, 0, 0.1, open_low=True, unit="s", help="time step of the physics")
    gravity: tuple[float, float, float] | None = static(None, unit="m/s²", help="a vector")
    terrain: Terrain | None = inner(None, help="in place of the level ground")
    cameras: Mapping[str, Camera] = static(factory=dict, help="further cameras, by name")

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
            changed = dataclasses.replace(changed, terrain=ground)
            ground = None
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
    - `body`: of which a bare model was made, so that tasks can be composed on it; None for a compiled model.
    - `stage`: of the body.
    - `motion`: a stored motion of a bare model, which is played instead of a simulation.
    """

    name: str
    task: Task | None = None
    agent: Learner | None = None
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
    body: Any = None
    stage: Stage = dataclasses.field(default_factory=Stage)
    motion: Motion | None = None


Simulated = Task | Body | mujoco.MjModel | mujoco.MjSpec | Path | str
"""What a run is of, as `setup_of` describes it."""


def setup_of(
    subject: Simulated,
    agent: Learner | Mapping[str, Any] | None = None,
    seed: int = 0,
    *,
    run: Run | Path | str | None = None,
    frozen: bool = False,
    stage: Stage | None = None,
    planet: Planet | None = None,
    beside: Mapping[str, Any] | None = None,
    label: str = "",
    motion: Motion | Path | str | None = None,
    partial: bool = False,
    trust: bool = False,
) -> Setup:
    """The setup of a learner or of a model without one.

    **Arguments:**

    - `subject`: for a learner a task, its name, the file of a composed task (.toml), or the id of an environment of
      MyoSuite that `motorgrad.tasks.myosuite` rebuilds; or a body or its name, a MuJoCo model or its description, the
      path of an MJCF file, or the id of another environment of MyoSuite, whose model is meant, or the name of a model
      of MyoSuite, such as `"myofullbody"`. `"myosuite:ID"` is the model of an environment without the task.
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
    - `motion`: a stored motion of a model, or its file (`timsim.read_motion`), to be played without a
      simulation; `partial`: whether its columns and the joints may differ.
    - `trust`: whether files of stable-baselines3 among `beside` may be loaded, which runs code that they hold.

    **Raises** `ValueError` for anything else, for parts that do not fit together, and for a file that MuJoCo refuses;
    `NotTrusted` for a file of stable-baselines3 without `trust`.

    ```py
    session = live.Session(live.setup_of("hopper", seed=3))
    ```
    """
    subject = named_subject(subject)
    if isinstance(subject, Task) or (isinstance(subject, str) and subject in TASKS):
        check(motion is None, "motion", motion, "left out with a task, whose learner moves the body: give its model")
        found = _of_task(subject, agent, seed, run, frozen, stage or Stage(), planet)
        assert found.task is not None
        assert found.agent is not None
        others = beside_of(found.task, found.agent, beside or {}, seed, trust)
        return dataclasses.replace(found, beside=others, label=label or ("learned" if frozen else "learning"))
    check(planet is None, "planet", planet, "left out where there is no task: only a learner walks on a planet")
    if isinstance(subject, str) and not is_path(subject) and subject not in BODIES:
        raise unknown("task or body", subject, {*TASKS, *BODIES, *BUNDLED})
    for name, value in (("agent", agent), ("run", run), ("beside", beside)):
        check(value is None, name, value, "left out where there is a model but no task")
    known = isinstance(subject, Path | str | mujoco.MjModel | mujoco.MjSpec) or hasattr(subject, "spec")
    check(known, "task", subject, "a task, a body, a MuJoCo model, or the path of one")
    found = _of_model(subject, stage or Stage())
    return found if motion is None else with_motion(found, motion, partial)


def with_motion(setup: Setup, motion: Motion | Path | str, partial: bool = False) -> Setup:
    """A bare model that plays a stored motion, given or in a file. **Raises** `ValueError` for one that does not
    fit."""
    model: Any = setup.model
    if not isinstance(motion, Motion):
        motion = read_motion(motion, model, partial)
    fits = motion.position.shape[1] == model.nq and motion.activation.shape[1] == model.nu
    check(fits, "motion", f"of {motion.position.shape[1]} coordinates", f"of the model, which has {model.nq}")
    check(motion.seconds <= MAX_MOTION_SECONDS, "length of the motion", motion.seconds, f"<= {MAX_MOTION_SECONDS:,} s")
    return dataclasses.replace(setup, motion=dataclasses.replace(motion, model=model))


def named_subject(subject: Simulated) -> Any:
    """The task or body that a file or an id of MyoSuite stands for; anything else is returned as it is."""
    if isinstance(subject, Path | str) and str(subject).lower().endswith(".toml"):
        return load(subject)
    if not isinstance(subject, str) or subject in TASKS or subject in BODIES:
        return subject
    if is_of_myosuite(subject):
        return myosuite(subject) if subject in myosuite_ids() else Mjcf(f"{MYOSUITE}{subject}")
    if subject.startswith("myo") and subject in models():
        return Mjcf(f"{MYOSUITE}{subject}")
    return Mjcf(subject) if subject in BUNDLED or subject.startswith(MYOSUITE) else subject


def _of_task(
    task: Task | str,
    agent: Learner | Mapping[str, Any] | None,
    seed: int,
    run: Run | Path | str | None,
    frozen: bool,
    stage: Stage,
    planet: Planet | None,
) -> Setup:
    asked = check_training(task, agent, seeds=[seed])
    staged = stage.of_task(asked.task)
    if planet is not None:
        from timsim.planet import on_planet

        check(isinstance(staged, BodyTask), "planet", planet, "left out where the task has no body")
        staged = on_planet(staged, planet)
    initial = None
    memory = None
    folder = None
    if run is not None:
        folder = run.path if isinstance(run, Run) else Path(run)
        shape = jax.eval_shape(asked.agent.init, jax.random.key(0)).policy
        read: Any = policy_of_run if isinstance(run, Run) else load_policy
        initial, memory = read(run, shape, asked.task.name, seed)
        check_training(staged, asked.agent, seeds=[seed], initial=initial)
    model, rendered = (compile_model(staged.dynamics), False) if isinstance(staged, BodyTask) else appearance_of(staged)
    shown: Any = {"model": model, "rendered": rendered, "stage": stage}
    return Setup(_title(staged), staged, asked.agent, seed, initial, memory, frozen, folder=folder, **shown)


def _title(task: Task) -> str:
    """The name of a task, of the environment behind it, or of the body of a composed one."""
    if isinstance(task, Gymnasium):
        return task.env_id
    name = _name_of(task.body) if isinstance(task, Composed) else ""
    return task.name if name in ("", "MuJoCo Model") else name  # MuJoCo's own name for a model without one


def _name_of(body: Body) -> str:
    """The name of a body: MyoSuite's id, otherwise the name in its description."""
    source = str(getattr(body, "source", ""))
    return source.removeprefix(MYOSUITE) if source.startswith(MYOSUITE) else body.spec().modelname


def _of_model(subject: Body | mujoco.MjModel | mujoco.MjSpec | Path | str, stage: Stage) -> Setup:
    if isinstance(subject, mujoco.MjModel):
        check(stage.empty, "stage", stage, "left out where the model is compiled")
        return Setup("model", model=subject)
    if isinstance(subject, Path | str) and subject not in BODIES:
        name = Path(subject).stem
        body = Mjcf(Path(subject))
    else:
        body: Any = BODIES[subject]() if isinstance(subject, str) else subject
        body = Mjcf(body) if isinstance(body, mujoco.MjSpec) else body  # type: ignore[arg-type]
        name = subject if isinstance(subject, str) else type(subject).__name__.lower()
        name = _name_of(body) if isinstance(body, Mjcf) else name
    spec = body.spec()
    stage.put_into(spec)
    model = compile_model(spec)
    return Setup(name, model=model, key=start_key(body, model), body=body, stage=stage)


def acting(run: Run, seed: int) -> Learner:
    """An agent that only acts, with a run's policy, for runs whose learner cannot be made again."""
    return Agent(run.policy(seed))


def is_path(subject: object) -> bool:
    """Whether this names a model's file."""
    return isinstance(subject, Path) or (isinstance(subject, str) and subject.lower().endswith((".xml", ".mjcf")))
