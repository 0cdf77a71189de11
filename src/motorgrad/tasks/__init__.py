"""Tasks: observations, rewards and ends of episodes over a world or a body."""

from motorgrad.tasks import terms
from motorgrad.tasks._arm_recruitment import ArmRecruitment
from motorgrad.tasks._composed import Composed, compose
from motorgrad.tasks._finite import CallAdmission, Chain, FiniteTask, LoadUnload, Parity, ThreeState, TMaze
from motorgrad.tasks._holding import Held, HoldingWarning, held_poses, spread_poses
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
from motorgrad.tasks._registry import ENVIRONMENT, TASKS, is_environment, load, make, settings_in
from motorgrad.tasks._suggestions import suggestions
from motorgrad.tasks._task import Metric, Mirror, Outcome, Task, observe, outcome
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
    "ENVIRONMENT",
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
    "Held",
    "Hexapod",
    "HexapodPrimitive",
    "HexapodProprioception",
    "HexapodStride",
    "HexapodSynergy",
    "HoldingWarning",
    "Hopper",
    "HostBatch",
    "HostTask",
    "LinearRecruitment",
    "LoadUnload",
    "Metric",
    "Mirror",
    "Outcome",
    "Parity",
    "ParticleNavigation",
    "ParticleOrbit",
    "ParticleTask",
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
    "held_poses",
    "is_environment",
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
    "settings_in",
    "spacing_error",
    "spread_poses",
    "suggestions",
    "synergy_matrix",
    "terms",
]
