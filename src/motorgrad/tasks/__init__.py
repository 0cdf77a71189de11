"""Tasks: observations, rewards and ends of episodes over a world or a body."""

from motorgrad.tasks import terms
from motorgrad.tasks._arm_recruitment import ArmRecruitment
from motorgrad.tasks._composed import Composed, compose
from motorgrad.tasks._finite import CallAdmission, Chain, FiniteTask, LoadUnload, Parity, ThreeState, TMaze
from motorgrad.tasks._hopper import Hopper
from motorgrad.tasks._host_task import BodyTask, HostBatch, HostTask
from motorgrad.tasks._myosuite import myosuite, myosuite_ids
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
from motorgrad.tasks._recruitment import Drift, LinearRecruitment, Recruitment, spacing_error
from motorgrad.tasks._registry import TASKS, load, make, settings_in
from motorgrad.tasks._suggestions import suggestions
from motorgrad.tasks._task import Mirror, Outcome, Reading, Task, observe, outcome, scale_action
from motorgrad.tasks.gymnasium._batch import EnvironmentBatch, EnvironmentState
from motorgrad.tasks.gymnasium._gymnasium import EnvironmentMemory, Gymnasium, from_gymnasium
from motorgrad.tasks.gymnasium._making import make_environment
from motorgrad.tasks.gymnasium._pictures import EnvironmentPictures, physics_of, renders
from motorgrad.tasks.hexapod._hexapod import Hexapod, HexapodProprioception, HexapodSynergy
from motorgrad.tasks.hexapod._primitive import HexapodPrimitive
from motorgrad.tasks.hexapod._stride import HexapodStride
from motorgrad.tasks.hexapod._synergies import Synergies, find_synergies, synergy_matrix
from motorgrad.tasks.hexapod._walking import TRIPOD_SYNERGIES

__all__ = [
    "LAYOUTS",
    "TASKS",
    "TRIPOD_SYNERGIES",
    "ArmRecruitment",
    "BodyTask",
    "CallAdmission",
    "Chain",
    "Composed",
    "Drift",
    "EnvironmentBatch",
    "EnvironmentMemory",
    "EnvironmentPictures",
    "EnvironmentState",
    "FallingParticle",
    "FiniteTask",
    "Gymnasium",
    "Hexapod",
    "HexapodPrimitive",
    "HexapodProprioception",
    "HexapodStride",
    "HexapodSynergy",
    "Hopper",
    "HostBatch",
    "HostTask",
    "LinearRecruitment",
    "LoadUnload",
    "Mirror",
    "Outcome",
    "Parity",
    "ParticleNavigation",
    "ParticleOrbit",
    "ParticleTask",
    "Reading",
    "Recruitment",
    "Region",
    "Synergies",
    "TMaze",
    "Task",
    "ThreeState",
    "around",
    "compose",
    "find_synergies",
    "from_gymnasium",
    "load",
    "make",
    "make_environment",
    "myosuite",
    "myosuite_ids",
    "observe",
    "outcome",
    "physics_of",
    "region_reward",
    "renders",
    "scale_action",
    "settings_in",
    "spacing_error",
    "suggestions",
    "synergy_matrix",
    "terms",
]
