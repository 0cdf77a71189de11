"""Our tasks as Gymnasium environments beside bare physics, and our learners beside bare foreign environments."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)

import gymnasium
import mujoco
import numpy as np

import motorgrad  # noqa: F401 (makes the ids known)
from motorgrad.benchmarks._measure import Row, in_turn
from motorgrad.bodies import BodyBatch, compile_model
from motorgrad.tasks import Hopper, from_gymnasium
from motorgrad.training import settings_for, stepper_of

HOPPER = "motorgrad/Hopper-v0"


def vector_row(copies: int, decisions: int, pairs: int) -> Row:
    """Decisions per second of the vector form, against `BodyBatch` alone on the same actions."""
    task = Hopper()
    actions = np.random.default_rng(0).integers(0, 2, (decisions, copies, 2), dtype=np.int8)
    environment = gymnasium.make_vec(HOPPER, num_envs=copies)
    environment.reset(seed=0)
    bare = BodyBatch(task.dynamics, copies, substeps=task.substeps)

    def ours() -> None:
        for action in actions:
            environment.step(action)

    def other() -> None:
        for action in actions.astype(np.float32):
            bare.step(action)

    ours()  # compiles
    name = f"{HOPPER}, vector of {copies} ÷ bare physics"
    return in_turn(name, "decisions/s", decisions * copies, ours, other, pairs=pairs)


def single_row(decisions: int, pairs: int) -> Row:
    """Decisions per second of the single form as `make` gives it, against `mujoco.mj_step` with the muscle law."""
    task = Hopper()
    actions = np.random.default_rng(0).integers(0, 2, (decisions, 2), dtype=np.int8)
    environment = gymnasium.make(HOPPER)
    environment.reset(seed=0)
    body = task.dynamics
    model, group_of = compile_model(body), [body.groups.index(muscle.group) for muscle in body.muscles]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)

    def ours() -> None:
        for action in actions:
            if any(environment.step(action)[2:4]):
                environment.reset()

    def other() -> None:
        for action in actions[:, group_of]:
            data.ctrl[:] = action
            mujoco.mj_step(model, data, task.substeps)

    ours()  # compiles
    return in_turn(f"{HOPPER}, single ÷ mj_step", "decisions/s", decisions, ours, other, pairs=pairs)


def foreign_row(seeds: int, decisions: int, pairs: int) -> Row:
    """Decisions per second of learning in CartPole, against stepping the bare environments at random."""
    task = from_gymnasium("CartPole-v1")
    learner = stepper_of(task, settings_for(task).agent(task), range(seeds))
    learner.advance(decisions)  # compiles
    bare = [gymnasium.make("CartPole-v1") for _ in range(seeds)]
    for seed, environment in enumerate(bare):
        environment.reset(seed=seed)
    actions = np.random.default_rng(0).integers(0, 2, (decisions, seeds))

    def other() -> None:
        for row in actions:
            for environment, action in zip(bare, row, strict=True):
                if any(environment.step(int(action))[2:4]):
                    environment.reset()

    name = f"CartPole-v1, learning ÷ bare environments, {seeds} seeds"
    return in_turn(name, "decisions/s", decisions * seeds, lambda: learner.advance(decisions), other, pairs=pairs)
