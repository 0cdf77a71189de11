"""Dynamics written in JAX, and the exact oracle of the finite ones."""

from motorgrad.worlds import oracle
from motorgrad.worlds._admission import AdmissionThresholds, call_admission
from motorgrad.worlds._chain import CHAIN_VARIANTS, chain
from motorgrad.worlds._finite import FiniteMDP, action_index
from motorgrad.worlds._three_state import three_state
from motorgrad.worlds._world import World

__all__ = [
    "CHAIN_VARIANTS",
    "AdmissionThresholds",
    "FiniteMDP",
    "World",
    "action_index",
    "call_admission",
    "chain",
    "oracle",
    "three_state",
]
