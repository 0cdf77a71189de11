"""MyoSuite's hand, learned by `sac`: beside bare physics, and its memory."""

from motorgrad._extras import require
from motorgrad.benchmarks._bodies import SUITE, body
from motorgrad.benchmarks._measure import Figures, peak_of
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


def learning(decisions: int, pairs: int) -> Figures:
    """Physics steps per second of the hand while `sac` learns, against `mujoco.batch` alone on the same actions."""
    require(*SUITE)
    task = myosuite(HAND)
    return body(task, 1, decisions, pairs, agent_for(task, preset="sac", steps=STEPS), BEFORE)


def memory() -> Figures:
    """Peak memory of a new process in which `sac` learns the hand."""
    require(*SUITE)
    return peak_of(MEMORY.format(hand=HAND, steps=STEPS, before=BEFORE))
