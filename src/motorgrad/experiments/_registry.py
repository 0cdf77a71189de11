"""All experiments by name, in the order of the source."""

from motorgrad.experiments._experiment import Experiment
from motorgrad.experiments.appendix_a.figure_a_1 import Wrapping
from motorgrad.experiments.appendix_a.figure_a_2 import Circular
from motorgrad.experiments.chapter_2.figure_2_1 import Process
from motorgrad.experiments.chapter_2.figure_2_2 import HillClimbing
from motorgrad.experiments.chapter_3.figure_3_1 import Learner
from motorgrad.experiments.chapter_3.section_3_2_1 import Baselines
from motorgrad.experiments.chapter_4.beyond_4_3_1_pools import LargePools
from motorgrad.experiments.chapter_4.figure_4_1 import ForceGrading
from motorgrad.experiments.chapter_4.figure_4_2 import RecruitmentTask
from motorgrad.experiments.chapter_4.figure_4_3 import LinearPolicies
from motorgrad.experiments.chapter_4.figure_4_4 import LinearPerformance
from motorgrad.experiments.chapter_4.figure_4_5 import ArmBody
from motorgrad.experiments.chapter_4.figure_4_6 import HeightFunction
from motorgrad.experiments.chapter_4.figure_4_7 import RewardSurface
from motorgrad.experiments.chapter_4.figure_4_8 import ArmPolicies
from motorgrad.experiments.chapter_4.figure_4_9 import ChainExploration
from motorgrad.experiments.chapter_4.section_4_4.active_learning import ActiveLearning
from motorgrad.experiments.chapter_4.section_4_4.figure_4_10 import LocalEffect
from motorgrad.experiments.chapter_4.section_4_4.forgetting_baseline import ForgettingBaseline
from motorgrad.experiments.chapter_4.section_4_4.gain_decay import GainDecay
from motorgrad.experiments.chapter_4.section_4_4.growth import Growth
from motorgrad.experiments.chapter_4.section_4_4.large_loads import LargeLoads
from motorgrad.experiments.chapter_4.section_4_4.negative_inputs import NegativeInputs
from motorgrad.experiments.chapter_4.section_4_4.rate_modulation import RateModulation
from motorgrad.experiments.chapter_4.section_4_4.size_principle import SizePrinciple
from motorgrad.experiments.chapter_5.extensions.beyond_5_3_4_muscles import Muscles
from motorgrad.experiments.chapter_5.extensions.beyond_5_4_1_synergies import FoundSynergies
from motorgrad.experiments.chapter_5.extensions.section_5_3_3_forces import Forces
from motorgrad.experiments.chapter_5.extensions.section_5_3_3_morphology import Morphology
from motorgrad.experiments.chapter_5.extensions.section_5_4_1_primitive import LearnedPrimitives
from motorgrad.experiments.chapter_5.extensions.section_5_4_1_stride import StridePeriod
from motorgrad.experiments.chapter_5.figure_5_1 import MusclePair
from motorgrad.experiments.chapter_5.figure_5_2 import HopperBody
from motorgrad.experiments.chapter_5.figure_5_3 import HopperBehaviour
from motorgrad.experiments.chapter_5.figure_5_4 import HopperDynamics
from motorgrad.experiments.chapter_5.figure_5_5 import HopperWeights
from motorgrad.experiments.chapter_5.hexapod.figure_5_6 import HexapodBody
from motorgrad.experiments.chapter_5.hexapod.figure_5_7 import StateMachine
from motorgrad.experiments.chapter_5.hexapod.figure_5_8 import TwoGaits
from motorgrad.experiments.chapter_5.hexapod.figure_5_9 import BiomimeticHexapod
from motorgrad.experiments.chapter_5.hexapod.section_5_3_3_terrain import RoughGround
from motorgrad.experiments.chapter_5.hexapod.section_5_3_4_gaits import LearnedGaits
from motorgrad.experiments.chapter_5.section_5_2_2 import ActionPeriod
from motorgrad.experiments.chapter_6.beyond_6_2_natural import NaturalStep
from motorgrad.experiments.chapter_6.figure_6_1 import Approximators
from motorgrad.experiments.chapter_6.figure_6_2 import Partition
from motorgrad.experiments.chapter_6.figure_6_3 import ParticlePolicy
from motorgrad.experiments.chapter_6.figure_6_4 import InitialPolicy
from motorgrad.experiments.chapter_6.figure_6_5 import LocalPolicies
from motorgrad.experiments.chapter_6.figure_6_6 import AnyUnitFires
from motorgrad.experiments.chapter_6.section_6_1_1_forgetting import Forgetting
from motorgrad.experiments.chapter_6.section_6_3_noise import Noise
from motorgrad.experiments.chapter_6.section_6_4.figure_6_7 import GrowingPolicy
from motorgrad.experiments.chapter_6.section_6_4.figure_6_8 import GrowingReward
from motorgrad.experiments.chapter_6.section_6_4.figure_6_9 import Orbits
from motorgrad.experiments.chapter_6.section_6_4.section_6_4_criteria import Criteria
from motorgrad.experiments.chapter_6.section_6_4.section_6_4_placement import Placement
from motorgrad.experiments.chapter_6.section_6_5.hierarchy import Hierarchy
from motorgrad.experiments.chapter_6.section_6_5.local_hopper import LocalHopper
from motorgrad.experiments.chapter_6.section_6_5.mixtures import Mixtures
from motorgrad.experiments.chapter_6.section_6_5.navigation import Navigation
from motorgrad.experiments.chapter_6.section_6_5.pruning import Pruning
from motorgrad.experiments.chapter_6.section_6_5.spatial_index import Index

EXPERIMENTS: dict[str, type[Experiment]] = {
    kind.name: kind
    for kind in (
        Process,
        HillClimbing,
        Learner,
        Baselines,
        ForceGrading,
        RecruitmentTask,
        LinearPolicies,
        LinearPerformance,
        ArmBody,
        HeightFunction,
        RewardSurface,
        ArmPolicies,
        ChainExploration,
        NegativeInputs,
        LargeLoads,
        Growth,
        LocalEffect,
        ForgettingBaseline,
        GainDecay,
        ActiveLearning,
        RateModulation,
        SizePrinciple,
        LargePools,
        MusclePair,
        HopperBody,
        HopperBehaviour,
        HopperDynamics,
        HopperWeights,
        ActionPeriod,
        HexapodBody,
        StateMachine,
        RoughGround,
        Morphology,
        Forces,
        TwoGaits,
        LearnedGaits,
        Muscles,
        LearnedPrimitives,
        FoundSynergies,
        BiomimeticHexapod,
        StridePeriod,
        Approximators,
        Forgetting,
        Partition,
        NaturalStep,
        ParticlePolicy,
        Noise,
        InitialPolicy,
        LocalPolicies,
        AnyUnitFires,
        Criteria,
        Placement,
        GrowingPolicy,
        GrowingReward,
        Orbits,
        Mixtures,
        Pruning,
        Hierarchy,
        Navigation,
        Index,
        LocalHopper,
        Wrapping,
        Circular,
    )
}
"""A new experiment is one file and one entry in this table."""
