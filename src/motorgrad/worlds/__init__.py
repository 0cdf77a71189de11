"""Dynamics written in JAX, and the exact oracle of the finite ones."""

from motorgrad.worlds import oracle
from motorgrad.worlds._admission import AdmissionThresholds, call_admission
from motorgrad.worlds._chain import CHAIN_VARIANTS, chain
from motorgrad.worlds._circular_field import CircularField
from motorgrad.worlds._finite import FiniteMDP, action_index
from motorgrad.worlds._immediate import immediate_gradient, immediate_reward, mean_field
from motorgrad.worlds._particle import Particle, ParticleStart, ParticleState
from motorgrad.worlds._particle_physics import ParticlePhysics
from motorgrad.worlds._recruitment import QueriedLoads, SweepingLoads, UniformLoads
from motorgrad.worlds._three_state import three_state
from motorgrad.worlds._walls import Walls
from motorgrad.worlds._world import World

__all__ = [
    "CHAIN_VARIANTS",
    "AdmissionThresholds",
    "CircularField",
    "FiniteMDP",
    "Particle",
    "ParticlePhysics",
    "ParticleStart",
    "ParticleState",
    "QueriedLoads",
    "SweepingLoads",
    "UniformLoads",
    "Walls",
    "World",
    "action_index",
    "call_admission",
    "chain",
    "immediate_gradient",
    "immediate_reward",
    "mean_field",
    "oracle",
    "three_state",
]
