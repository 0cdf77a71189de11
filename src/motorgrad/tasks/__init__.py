"""Tasks: observations, rewards and ends of episodes over a world or a body."""

from motorgrad.tasks._arm_recruitment import ArmRecruitment
from motorgrad.tasks._finite import CallAdmission, Chain, FiniteTask, ThreeState
from motorgrad.tasks._hopper import Hopper, HopperMemory
from motorgrad.tasks._host_task import BodyTask, HostBatch, HostTask
from motorgrad.tasks._particle import (
    LAYOUTS,
    FallingParticle,
    ParticleNavigation,
    ParticleOrbit,
    ParticleTask,
    Region,
    around,
    region_reward,
)
from motorgrad.tasks._recruitment import Drift, LinearRecruitment, Recruitment, RecruitmentMemory, spacing_error
from motorgrad.tasks._registry import TASKS, make
from motorgrad.tasks._task import Mirror, Outcome, Reading, Task, outcome
from motorgrad.tasks.gymnasium import (
    EnvironmentBatch,
    EnvironmentMemory,
    EnvironmentState,
    Gymnasium,
    from_gymnasium,
)
from motorgrad.tasks.hexapod import (
    TRIPOD_SYNERGIES,
    Hexapod,
    HexapodMemory,
    HexapodPrimitive,
    HexapodStride,
    HexapodSynergy,
    PrimitiveMemory,
    StrideMemory,
    Synergies,
    find_synergies,
    synergy_matrix,
)

__all__ = [
    "LAYOUTS",
    "TASKS",
    "TRIPOD_SYNERGIES",
    "ArmRecruitment",
    "BodyTask",
    "CallAdmission",
    "Chain",
    "Drift",
    "EnvironmentBatch",
    "EnvironmentMemory",
    "EnvironmentState",
    "FallingParticle",
    "FiniteTask",
    "Gymnasium",
    "Hexapod",
    "HexapodMemory",
    "HexapodPrimitive",
    "HexapodStride",
    "HexapodSynergy",
    "Hopper",
    "HopperMemory",
    "HostBatch",
    "HostTask",
    "LinearRecruitment",
    "Mirror",
    "Outcome",
    "ParticleNavigation",
    "ParticleOrbit",
    "ParticleTask",
    "PrimitiveMemory",
    "Reading",
    "Recruitment",
    "RecruitmentMemory",
    "Region",
    "StrideMemory",
    "Synergies",
    "Task",
    "ThreeState",
    "around",
    "find_synergies",
    "from_gymnasium",
    "make",
    "outcome",
    "region_reward",
    "spacing_error",
    "synergy_matrix",
]
