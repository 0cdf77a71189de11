"""Dynamics written in JAX, and exact answers for the finite ones."""

from motorgrad.worlds import oracle
from motorgrad.worlds._curvature import biased_hessian, hessian
from motorgrad.worlds._episodes import episode_gradient, episode_value
from motorgrad.worlds._finite import (
    CHAIN_VARIANTS,
    AdmissionThresholds,
    FiniteMDP,
    action_index,
    call_admission,
    chain,
    episodes,
    load_unload,
    parity,
    t_maze,
    three_state,
)
from motorgrad.worlds._particle import Particle, ParticleFactors, ParticlePhysics, ParticleStart, ParticleState
from motorgrad.worlds._particle_forces import CircularField, Walls
from motorgrad.worlds._recruitment import (
    Attempt,
    QueriedLoads,
    RepeatedLoads,
    SweepingLoads,
    UniformLoads,
    immediate_gradient,
    immediate_reward,
    mean_field,
)
from motorgrad.worlds._transition_posterior import TransitionPosterior
from motorgrad.worlds._world import World

__all__ = [
    "CHAIN_VARIANTS",
    "AdmissionThresholds",
    "Attempt",
    "CircularField",
    "FiniteMDP",
    "Particle",
    "ParticleFactors",
    "ParticlePhysics",
    "ParticleStart",
    "ParticleState",
    "QueriedLoads",
    "RepeatedLoads",
    "SweepingLoads",
    "TransitionPosterior",
    "UniformLoads",
    "Walls",
    "World",
    "action_index",
    "biased_hessian",
    "call_admission",
    "chain",
    "episode_gradient",
    "episode_value",
    "episodes",
    "hessian",
    "immediate_gradient",
    "immediate_reward",
    "load_unload",
    "mean_field",
    "oracle",
    "parity",
    "t_maze",
    "three_state",
]
