"""Tasks of MyoSuite: learning beside bare physics, MyoSuite's own step, and the memory of a hand that learns."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)

from typing import Any

import gymnasium
import mujoco
import numpy as np

from motorgrad._extras import require
from motorgrad.benchmarks._bodies import SUITE, body, composed
from motorgrad.benchmarks._measure import Figures, in_turn, peak_of
from motorgrad.tasks import myosuite
from motorgrad.training import agent_for

HAND = "myoHandReachRandom-v0"
STEPS = 300_000
"""The budget of the learner, by which its replay is sized."""
BEFORE = 1_000
"""Decisions before any that is measured: the preset learns from the 500th on."""
MEMORY = """
import motorgrad as mg
task = mg.tasks.myosuite("{hand}")
mg.train(task, mg.presets.sac(task, steps={steps}), steps={before}, seeds=1, progress=False)
"""
ONE_DECISION = """
import motorgrad as mg
task = mg.tasks.myosuite("{task}", actions="{actions}")
mg.train(task, mg.presets.{preset}(task, steps=1_000), steps=1, progress=False)
"""
"""A first decision of a preset in a task of MyoSuite, which `motorgrad train` does not know by an id."""


def suite(env_id: str, learner: str, seeds: int, decisions: int, pairs: int) -> Figures:
    """Learning in a task of MyoSuite, rebuilt, as `composed`."""
    require(*SUITE)
    return composed(myosuite(env_id, actions="binary"), learner, seeds, decisions, pairs)


def suite_step(env_id: str, decisions: int, pairs: int) -> Figures:
    """MyoSuite's own steps per second, against `mujoco.mj_step` alone."""
    require(*SUITE)
    myosuite(env_id, actions="binary")  # registers the ids
    theirs = gymnasium.make(env_id)
    theirs.reset(seed=0)
    inner: Any = theirs.unwrapped
    data = mujoco.MjData(inner.model)
    controls = np.random.default_rng(0).uniform(size=(decisions, inner.model.nu))
    actions = (2 * controls - 1).astype(np.float32)

    def own() -> None:
        for action in actions:
            if any(theirs.step(action)[2:4]):
                theirs.reset()

    def bare() -> None:
        for control in controls:
            data.ctrl[:] = control
            mujoco.mj_step(inner.model, data, inner.frame_skip)

    return in_turn("physics steps/s", decisions * inner.frame_skip, own, bare, pairs=pairs)


def hand(decisions: int, pairs: int) -> Figures:
    """Physics steps per second of the hand while `sac` learns, against `mujoco.batch` alone on the same actions."""
    require(*SUITE)
    task = myosuite(HAND)
    return body(task, 1, decisions, pairs, agent_for(task, preset="sac", steps=STEPS), BEFORE)


def hand_memory() -> Figures:
    """Peak memory of a new process in which `sac` learns the hand."""
    require(*SUITE)
    return peak_of(MEMORY.format(hand=HAND, steps=STEPS, before=BEFORE))
