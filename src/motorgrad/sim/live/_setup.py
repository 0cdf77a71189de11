"""What is to be simulated: a learner of a task, or a bare MuJoCo model."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)

import dataclasses
from pathlib import Path
from typing import Any

import jax
import mujoco
import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import Arm, Body, Hexapod, Hopper, compile_model
from motorgrad.learning import Agent
from motorgrad.policies import Policy, describe
from motorgrad.sim.live._stage import Stage
from motorgrad.sim.planet import Planet, on_planet
from motorgrad.tasks import BodyTask, Task
from motorgrad.training import Run, check_training, load

BODIES: dict[str, type[Body]] = {"arm": Arm, "hexapod": Hexapod, "hopper": Hopper}
"""The bodies that can be looked at without a task."""


@dataclasses.dataclass(frozen=True, eq=False)
class Setup:
    """What a worker simulates; it crosses to its process whole.

    - `name`: the title of the page.
    - `task`, `agent`, `seed`: the learner; `task` None for a bare model.
    - `initial`: the policy to begin from, along a leading axis of one, or None for the agent's own; `memory`, what the
      task remembered when it had been learnt.
    - `frozen`: whether to begin without learning.
    - `model`: of the body in view, with the page's cameras; None for worlds in JAX.
    """

    name: str
    task: Task | None = None
    agent: Agent | None = None
    seed: int = 0
    initial: Policy | None = None
    memory: Any = None
    frozen: bool = False
    model: mujoco.MjModel | None = None


def learner(
    task: Task | str,
    agent: Any = None,
    seed: int = 0,
    *,
    run: Run | Path | str | None = None,
    frozen: bool = False,
    stage: Stage | None = None,
    planet: Planet | None = None,
) -> Setup:
    """The set-up of a learner.

    **Arguments:**

    - `task` and `agent` as `motorgrad.train` takes them.
    - `seed`: of the run that it goes on from, or of a new one.
    - `run`: a run, or the directory of one, of the same task, whose policy of this seed is the first.
    - `frozen`: whether to begin without learning.
    - `stage`: surroundings other than the task's own; `planet`: a round world instead of level ground.

    **Raises** `ValueError` for what does not fit together.
    """
    asked = check_training(task, agent, seeds=[seed])
    staged = (stage or Stage()).of_task(asked.task)
    if planet is not None:
        check(isinstance(staged, BodyTask), "planet", planet, "left out where the task has no body")
        staged = on_planet(staged, planet)  # type: ignore[type-var]
    initial, memory = (None, None) if run is None else _learnt(run, asked.task, asked.agent, seed)
    if initial is not None:
        check_training(staged, asked.agent, seeds=[seed], initial=initial)
    model = compile_model(staged.dynamics) if isinstance(staged, BodyTask) else None
    return Setup(staged.name, staged, asked.agent, seed, initial, memory, frozen, model)


def bare(subject: Body | mujoco.MjModel | Path | str, stage: Stage | None = None) -> Setup:
    """The set-up of a model without a learner.

    **Arguments:** `subject`: the path of an MJCF file, a body or the name of one, or a compiled model, which has its
    surroundings already; `stage`: other surroundings.

    **Raises** `ValueError` that names the file, for one that MuJoCo does not take.
    """
    stage = stage or Stage()
    if isinstance(subject, mujoco.MjModel):
        check(stage.empty, "stage", stage, "left out where the model is compiled")
        return Setup("model", model=subject)
    if isinstance(subject, str) and subject in BODIES:
        name, spec = subject, BODIES[subject]().spec()
    elif isinstance(subject, Path | str):
        name, spec = Path(subject).stem, _read(Path(subject))
    else:
        name, spec = type(subject).__name__.lower(), subject.spec()
    try:
        stage.put_into(spec)
        model = compile_model(spec)
    except ValueError as error:
        where = f"{subject}: " if isinstance(subject, Path | str) else ""
        raise ValueError(where + " ".join(str(error).split())) from None
    return Setup(name, model=model)


def acting(run: Run, seed: int) -> Agent:
    """An agent with a run's policy that can act, for runs whose own learner cannot be made again."""
    return Agent(run.policy(seed))


def _read(path: Path) -> mujoco.MjSpec:
    check(path.is_file(), "model", str(path), "a file that exists")
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from None


def _learnt(run: Run | Path | str, task: Task, agent: Agent, seed: int) -> tuple[Policy, Any]:
    """The policy of a run's seed, along a leading axis of one, and what the task remembered."""
    run = run if isinstance(run, Run) else load(run)
    where = run.path or "the run"
    if run.task.name != task.name:
        raise ValueError(f"{where}: a run of the task {run.task.name!r}, but this is {task.name!r}")
    policy, row = run.policy(seed), run.seeds.index(seed)
    wanted = jax.eval_shape(agent.init, jax.random.key(0)).policy
    if describe(policy) != describe(wanted):
        raise ValueError(f"{where}: its policy, {_said(policy)}, is not of the learner's structure, {_said(wanted)}")
    memory = run.memory
    picked = None if memory is None else jax.tree.map(lambda leaf: leaf[row : row + 1], memory)
    return jax.tree.map(lambda leaf: np.asarray(leaf)[None], policy), picked


def _said(policy: Policy) -> str:
    return f"{type(policy).__name__}({policy.inputs} inputs, {policy.outputs} outputs)"
