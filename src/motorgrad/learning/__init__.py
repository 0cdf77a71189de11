"""Learners: traces, baselines and critics, estimators, optimizers and metrics, and the agent that they make up."""

from motorgrad._running import RunningMean, add_sample, running_mean, two_sum
from motorgrad._tree import Part, count, number, static
from motorgrad.learning._agent import Agent, AgentState, Decision
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
    Transition,
)
from motorgrad.learning._branching import NEVER
from motorgrad.learning._chain import SGD, Adam, Chain, Optax, Optimizer, PolyakAveraging, Transformation
from motorgrad.learning._conjugate import ConjugateGradient
from motorgrad.learning._critic_fits import CriticFit, CriticStep, LeastSquares, TemporalDifference
from motorgrad.learning._critics import Critic, CriticState, Features, LinearCritic, NetworkCritic
from motorgrad.learning._estimator import (
    Estimator,
    EstimatorState,
    NormalizationState,
    RootMeanSquare,
    entropy_gradient,
    gae,
    gpomdp,
    olgarb,
    olpomdp,
)
from motorgrad.learning._fitted_values import FittedReturns
from motorgrad.learning._natural import FisherMetric, Metric
from motorgrad.learning._overshooting import BoundedTemporalDifference, OvershootingBound
from motorgrad.learning._registry import register
from motorgrad.learning._schedules import Annealed
from motorgrad.learning._traces import Episodic, Exponential, LaggedGaussian, Trace, Window
from motorgrad.learning._true_online import TrueOnlineTemporalDifference
from motorgrad.learning.growth import Clock, Criterion, Growth, GrowthState, Plateau, Visited
from motorgrad.learning.sparse import IndexState, SparseAgent, SpatialIndex

__all__ = [
    "NEVER",
    "SGD",
    "Adam",
    "Advantage",
    "Agent",
    "AgentState",
    "Annealed",
    "Baseline",
    "BinnedBaseline",
    "BoundedTemporalDifference",
    "Chain",
    "Clock",
    "ConjugateGradient",
    "Constant",
    "Criterion",
    "Critic",
    "CriticFit",
    "CriticState",
    "CriticStep",
    "Decision",
    "Episodic",
    "Estimator",
    "EstimatorState",
    "Exponential",
    "Features",
    "FisherMetric",
    "FittedReturns",
    "FixedStep",
    "Growth",
    "GrowthState",
    "IndexState",
    "InputBaseline",
    "LaggedGaussian",
    "LeastSquares",
    "LinearBaseline",
    "LinearCritic",
    "LinearState",
    "MeanReward",
    "Metric",
    "NetworkCritic",
    "NormalizationState",
    "Optax",
    "Optimizer",
    "OvershootingBound",
    "Part",
    "Plateau",
    "PolyakAveraging",
    "RootMeanSquare",
    "RunningMean",
    "ScalarBaseline",
    "SparseAgent",
    "SpatialIndex",
    "TemporalDifference",
    "Trace",
    "Transformation",
    "Transition",
    "TrueOnlineTemporalDifference",
    "Visited",
    "Window",
    "add_sample",
    "count",
    "entropy_gradient",
    "gae",
    "gpomdp",
    "number",
    "olgarb",
    "olpomdp",
    "register",
    "running_mean",
    "static",
    "two_sum",
]
