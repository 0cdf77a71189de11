"""OLGARB on the three-state MDP, beside a hand-written compiled loop of the same learner."""

import numpy as np

from motorgrad.benchmarks._measure import Row, in_turn
from motorgrad.benchmarks._three_state_loop import three_state_loop
from motorgrad.tasks import ThreeState
from motorgrad.training import settings_for, stepper_of


def three_state_row(seeds: int, decisions: int, pairs: int = 5, wanted: str = "") -> Row:
    """Updates per second in total, against the loop's on one core."""
    task = ThreeState()
    settings = settings_for(task)
    learner = stepper_of(task, settings.agent(task), range(seeds))
    learner.advance(decisions)  # compiles
    world, single = task.dynamics, np.float32
    inputs = (
        world.observations.astype(single),
        world._cumulative.astype(single),
        world._successors,
        world.rewards.astype(single),
        settings.decay,
        settings.rate,
    )
    three_state_loop(10, 0, *inputs)  # compiles
    loop_steps = 4_000_000
    name = f"three-state OLGARB ÷ compiled loop, {seeds:,} seed{'s' * (seeds > 1)}"
    return in_turn(
        name,
        "updates/s",
        decisions * seeds,
        lambda: learner.advance(decisions),
        lambda: three_state_loop(loop_steps, 1, *inputs),
        loop_steps,
        pairs,
        wanted,
    )
