"""Presets: learners for any task, in proportion to a budget, whose parts can be changed one by one.

All return an `Agent`, and are called as `natural(task, steps=100_000, changes=None, **more)`, which has the arguments.
"""

from motorgrad.training.presets import (
    PRESETS,
    a2c,
    avg,
    intentional_ac,
    natural,
    natural_network,
    ppo,
    ppo_short_horizon,
    reinforce,
    sac,
    stream_ac,
    trpo,
)

__all__ = [
    "PRESETS",
    "a2c",
    "avg",
    "intentional_ac",
    "natural",
    "natural_network",
    "ppo",
    "ppo_short_horizon",
    "reinforce",
    "sac",
    "stream_ac",
    "trpo",
]
