"""Learners: traces, baselines and critics, estimators, optimizers and metrics, and the agent that they make up."""

from motorgrad._branching import NEVER, any_of, where, where_any
from motorgrad._goal import Goal
from motorgrad._running import RunningMean, add_sample, running_mean, two_sum
from motorgrad.learning import algorithms as _algorithms
from motorgrad.learning._accuracy import Accuracy, AccuracyState
from motorgrad.learning._action_transitions import ActionTransitions
from motorgrad.learning._action_value_ensemble import ActionValueEnsemble, EnsembleState
from motorgrad.learning._advantages import Advantages
from motorgrad.learning._baselines import (
    Advantage,
    Baseline,
    BinnedBaseline,
    Constant,
    FixedStep,
    InputBaseline,
    LinearBaseline,
    LinearState,
    MeanReward,
    ScalarBaseline,
)
from motorgrad.learning._batches import Batch
from motorgrad.learning._bayesian_gradient import GradientPosterior, bayesian_gradient
from motorgrad.learning._centring import Centring, SimpleCentring, ValueBasedCentring
from motorgrad.learning._chain import SGD, Adam, Chain, Optax, Optimizer, PolyakAveraging, Transformation
from motorgrad.learning._conjugate import ConjugateGradient
from motorgrad.learning._conjugate_ascent import ConjugateAscent
from motorgrad.learning._critic_fits import CriticFit, CriticStep, LeastSquares, TemporalDifference
from motorgrad.learning._critics import Critic, CriticState, Features, LinearCritic, NetworkCritic
from motorgrad.learning._demonstrations import Demonstrations
from motorgrad.learning._estimator import Estimator, EstimatorState, entropy_gradient
from motorgrad.learning._fitted_values import FittedReturns
from motorgrad.learning._gradient_learner import (
    GradientLearner,
    averaging_field,
    optimizer_field,
    transformations_field,
)
from motorgrad.learning._gradients import gradient_of
from motorgrad.learning._imitation import Imitation, imitate
from motorgrad.learning._incremental_natural import CompatibleWeights, ShermanMorrison
from motorgrad.learning._intentional import IntentionalStep, IntentionalTemporalDifference
from motorgrad.learning._learned_step import LearnedStep, LearnedStepState
from motorgrad.learning._learned_trace import LearnedTrace
from motorgrad.learning._learner import (
    Decision,
    Learner,
    Needs,
    Transition,
    check_scores,
    first_decision,
    with_decision,
)
from motorgrad.learning._named_estimators import actor_critic, gae, gpomdp, olgarb, olpomdp
from motorgrad.learning._natural import FisherMetric, LimitedMetric, Metric
from motorgrad.learning._natural_regression import EpisodicNatural, LeastSquaresNatural, RegressionMetric
from motorgrad.learning._newton import NewtonMetric, NewtonState
from motorgrad.learning._optimal_baselines import EligibilityBaseline, OptimalBaseline, UnitMean
from motorgrad.learning._overshooting import BoundedTemporalDifference, OvershootingBound, StepBound
from motorgrad.learning._registry import register
from motorgrad.learning._replay import Drawn, Experience, Hindsight, Replay
from motorgrad.learning._replay_learner import ReplayLearner
from motorgrad.learning._reward_criteria import Accumulated, Average, Discounted, Last, Maximum, RewardCriterion
from motorgrad.learning._scaling import NormalizationState, RewardScaling, RootMeanSquare, ScalingState
from motorgrad.learning._schedules import Annealed, at
from motorgrad.learning._stationary_metric import StationaryMetric
from motorgrad.learning._swift import SwiftTemporalDifference
from motorgrad.learning._traces import Episodic, Exponential, LaggedGaussian, Trace, Window
from motorgrad.learning._true_online import TrueOnlineTemporalDifference
from motorgrad.learning.algorithms import *  # noqa: F403
from motorgrad.learning.algorithms._action_value_gradient import ActionValues
from motorgrad.learning.algorithms._choice import Choice, choose
from motorgrad.learning.algorithms._policy_gradient import AgentState
from motorgrad.learning.algorithms._presets import PRESETS, PURPOSES, STEPS, Measured, measured, preset
from motorgrad.learning.algorithms._soft_actor_critic import EntropyState, EntropyTarget
from motorgrad.learning.growth import Clock, Criterion, Growth, GrowthState, Plateau, Visited
from motorgrad.learning.sparse import IndexState, SparseLearner, SparseState, SpatialIndex
from motorgrad.schema import Part, count, inner, number, static

__all__ = [
    "NEVER",
    "PRESETS",
    "PURPOSES",
    "SGD",
    "STEPS",
    "Accumulated",
    "Accuracy",
    "AccuracyState",
    "ActionTransitions",
    "ActionValueEnsemble",
    "ActionValues",
    "Adam",
    "Advantage",
    "Advantages",
    "AgentState",
    "Annealed",
    "Average",
    "Baseline",
    "Batch",
    "BinnedBaseline",
    "BoundedTemporalDifference",
    "Centring",
    "Chain",
    "Choice",
    "Clock",
    "CompatibleWeights",
    "ConjugateAscent",
    "ConjugateGradient",
    "Constant",
    "Criterion",
    "Critic",
    "CriticFit",
    "CriticState",
    "CriticStep",
    "Decision",
    "Demonstrations",
    "Discounted",
    "Drawn",
    "EligibilityBaseline",
    "EnsembleState",
    "EntropyState",
    "EntropyTarget",
    "Episodic",
    "EpisodicNatural",
    "Estimator",
    "EstimatorState",
    "Experience",
    "Exponential",
    "Features",
    "FisherMetric",
    "FittedReturns",
    "FixedStep",
    "Goal",
    "GradientLearner",
    "GradientPosterior",
    "Growth",
    "GrowthState",
    "Hindsight",
    "Imitation",
    "IndexState",
    "InputBaseline",
    "IntentionalStep",
    "IntentionalTemporalDifference",
    "LaggedGaussian",
    "Last",
    "LearnedStep",
    "LearnedStepState",
    "LearnedTrace",
    "Learner",
    "LeastSquares",
    "LeastSquaresNatural",
    "LimitedMetric",
    "LinearBaseline",
    "LinearCritic",
    "LinearState",
    "Maximum",
    "MeanReward",
    "Measured",
    "Metric",
    "Needs",
    "NetworkCritic",
    "NewtonMetric",
    "NewtonState",
    "NormalizationState",
    "Optax",
    "OptimalBaseline",
    "Optimizer",
    "OvershootingBound",
    "Part",
    "Plateau",
    "PolyakAveraging",
    "RegressionMetric",
    "Replay",
    "ReplayLearner",
    "RewardCriterion",
    "RewardScaling",
    "RootMeanSquare",
    "RunningMean",
    "ScalarBaseline",
    "ScalingState",
    "ShermanMorrison",
    "SimpleCentring",
    "SparseLearner",
    "SparseState",
    "SpatialIndex",
    "StationaryMetric",
    "StepBound",
    "SwiftTemporalDifference",
    "TemporalDifference",
    "Trace",
    "Transformation",
    "Transition",
    "TrueOnlineTemporalDifference",
    "UnitMean",
    "ValueBasedCentring",
    "Visited",
    "Window",
    "actor_critic",
    "add_sample",
    "any_of",
    "at",
    "averaging_field",
    "bayesian_gradient",
    "check_scores",
    "choose",
    "count",
    "entropy_gradient",
    "first_decision",
    "gae",
    "gpomdp",
    "gradient_of",
    "imitate",
    "inner",
    "measured",
    "number",
    "olgarb",
    "olpomdp",
    "optimizer_field",
    "preset",
    "register",
    "running_mean",
    "static",
    "transformations_field",
    "two_sum",
    "where",
    "where_any",
    "with_decision",
]
__all__ += [name for name in vars(_algorithms) if not name.startswith("_")]  # pyright: ignore[reportUnsupportedDunderAll]
