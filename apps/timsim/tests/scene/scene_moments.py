"""Moments of bodies to look at."""

import mujoco
import numpy as np

from timsim.live import Snapshot


def moment(position, *, velocity=None, activation=None, control=None, decision=0, model=None, marks=()):
    """A snapshot of bodies `(bodies, nq)` of which nothing but the motion is known."""
    position = np.atleast_2d(np.asarray(position, float))
    count = len(position)
    sizes = {"velocity": model.nv, "activation": model.na, "control": model.nu}
    given = {"velocity": velocity, "activation": activation, "control": control}
    rows = {
        name: np.broadcast_to(np.zeros(size) if given[name] is None else given[name], (count, size)).astype(float)
        for name, size in sizes.items()
    }
    unknown, none = np.full(count, np.nan), np.zeros((count, 0))
    return Snapshot(
        decision=decision,
        seconds=decision / 50,
        playing=True,
        frozen=False,
        speed=1.0,
        position=position,
        **rows,
        observation=none,
        memory=none,
        probability=none,
        reward=unknown,
        baseline=unknown,
        gradient_norm=unknown,
        parameters=none,
        fixed=none,
        marks=np.broadcast_to(np.ravel(marks), (count, np.size(marks))),
        reset_count=0,
        oldest=0,
        newest=decision,
        labels=("learning", "untrained", "other", "another")[:count],
    )


def walk(model, steps, seed=0):
    """A posture that the physics reaches with random muscles: position, velocity, control."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    random = np.random.default_rng(seed)
    for step in range(steps):
        if step % 20 == 0:
            data.ctrl[:] = random.integers(0, 2, model.nu)
        mujoco.mj_step(model, data)
    return data.qpos.copy(), data.qvel.copy(), data.ctrl.copy()


def standing(model):
    """The body at rest on its feet, muscles silent: position, velocity, control."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(4000):
        mujoco.mj_step(model, data)
    return data.qpos.copy(), data.qvel.copy(), data.ctrl.copy()
