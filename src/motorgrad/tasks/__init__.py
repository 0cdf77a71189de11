"""Tasks: an observation, a reward and an episode's rule over a world or a body."""

from motorgrad.tasks._arm_recruitment import ArmRecruitment
from motorgrad.tasks._body_task import BodyTask
from motorgrad.tasks._drift import Drift
from motorgrad.tasks._finite import CallAdmission, Chain, FiniteTask, ThreeState
from motorgrad.tasks._gymnasium import EnvironmentMemory, Gymnasium, from_gymnasium
from motorgrad.tasks._gymnasium_batch import EnvironmentBatch, EnvironmentState
from motorgrad.tasks._hexapod import TRIPOD_SYNERGIES, Hexapod, HexapodSynergy, March
from motorgrad.tasks._hexapod_primitive import HexapodPrimitive, Steps
from motorgrad.tasks._hexapod_stride import HexapodStride, Stride
from motorgrad.tasks._hopper import Flight, Hopper
from motorgrad.tasks._host_task import HostBatch, HostTask
from motorgrad.tasks._linear_recruitment import LinearRecruitment, spacing_error
from motorgrad.tasks._mirror import Mirror
from motorgrad.tasks._outcome import Outcome, outcome
from motorgrad.tasks._particle import FallingParticle
from motorgrad.tasks._particle_navigation import ParticleNavigation
from motorgrad.tasks._particle_orbit import ParticleOrbit
from motorgrad.tasks._particle_task import ParticleTask, around
from motorgrad.tasks._recruitment import Pull, Recruitment
from motorgrad.tasks._regions import LAYOUTS, Region, region_reward
from motorgrad.tasks._registry import TASKS, make
from motorgrad.tasks._synergies import Synergies, find_synergies, synergy_matrix
from motorgrad.tasks._task import Reading, Task
from motorgrad.tasks._timed_body_task import TimedBodyTask

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
    "Flight",
    "Gymnasium",
    "Hexapod",
    "HexapodPrimitive",
    "HexapodStride",
    "HexapodSynergy",
    "Hopper",
    "HostBatch",
    "HostTask",
    "LinearRecruitment",
    "March",
    "Mirror",
    "Outcome",
    "ParticleNavigation",
    "ParticleOrbit",
    "ParticleTask",
    "Pull",
    "Reading",
    "Recruitment",
    "Region",
    "Steps",
    "Stride",
    "Synergies",
    "Task",
    "ThreeState",
    "TimedBodyTask",
    "around",
    "find_synergies",
    "from_gymnasium",
    "make",
    "outcome",
    "region_reward",
    "spacing_error",
    "synergy_matrix",
]
