"""OLGARB on the three-state MDP, beside a hand-written compiled loop of the same learner."""

import numpy as np

from motorgrad.benchmarks._beside_loop import loop_row
from motorgrad.benchmarks._measure import Row
from motorgrad.benchmarks._three_state_loop import three_state_loop
from motorgrad.tasks import ThreeState
from motorgrad.training import settings_for


def three_state_row(seeds: int, decisions: int, pairs: int = 5, wanted: str = "") -> Row:
    """Updates per second in total, against the loop's on one core."""
    task = ThreeState()
    settings, world, single = settings_for(task), task.dynamics, np.float32
    inputs = (
        world.observations.astype(single),
        world._cumulative.astype(single),
        world._successors,
        world.rewards.astype(single),
        settings.decay,
        settings.rate,
    )
    name = "three-state OLGARB"
    return loop_row(name, task, lambda steps: three_state_loop(steps, 1, *inputs), seeds, decisions, pairs, wanted)
