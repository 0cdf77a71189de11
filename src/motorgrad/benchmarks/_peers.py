"""Learners of ours beside PPO of SBX, which is compiled by JAX too, on the same environment of Gymnasium."""

# pyright: reportMissingImports=false
# (SBX belongs to no extra: it is installed for these rows alone)

from typing import Any

import gymnasium

from motorgrad._extras import MissingExtra, installed
from motorgrad.benchmarks._measure import Figures, in_turn
from motorgrad.learning import Agent
from motorgrad.tasks import from_gymnasium
from motorgrad.training import agent_for, stepper_for

ENVIRONMENT = "Pendulum-v1"
SHORT = "pendulum"
PRESETS = ("ppo", "natural-network", "stream-ac")
BATCH = 2048
"""Decisions between two updates of the peer, by its defaults."""


def learning(preset: str, batches: int, pairs: int) -> Figures:
    """Decisions per second of a preset, against those of SBX's PPO with its defaults; one environment each, by so many
    batches of the peer at a time, and about as many decisions in whole batches of ours. **Raises** `MissingExtra`
    without SBX."""
    if not installed("sbx"):
        raise MissingExtra("this row needs the package sbx: pip install sbx-rl")
    from sbx import PPO

    task = from_gymnasium(ENVIRONMENT)
    agent: Any = agent_for(task, preset=preset, steps=100 * BATCH)
    own = agent.estimator.update_every if isinstance(agent, Agent) else agent.update_every
    assert isinstance(own, int), "the presets have batches of a fixed length"
    theirs = batches * BATCH
    decisions = theirs // own * own
    ours = stepper_for(task, agent, [0])
    peer = PPO("MlpPolicy", gymnasium.make(ENVIRONMENT), seed=0, device="cpu")

    def learn() -> None:
        peer.learn(theirs, reset_num_timesteps=False)

    ours.advance(decisions)  # compiles
    learn()
    return in_turn("decisions/s", decisions, lambda: ours.advance(decisions), learn, theirs, pairs)
