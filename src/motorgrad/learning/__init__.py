"""Traces, baselines, estimators, metrics and ascent rules, and the learner that they make up."""

from motorgrad._running import RunningMean, add_sample, running_mean, two_sum
from motorgrad.learning._agent import Agent
from motorgrad.learning._agent_state import AgentState, Decision
from motorgrad.learning._ascent import DecayState, SgdState, adam, decayed, sgd
from motorgrad.learning._baselines import Baseline, Constant, FixedStep, MeanReward, NoBaseline
from motorgrad.learning._choose import NEVER
from motorgrad.learning._critic import CriticState, Features, LinearCritic
from motorgrad.learning._critic_fit import LeastSquares, TemporalDifference
from motorgrad.learning._entropy import entropy_gradient
from motorgrad.learning._estimator import Estimator, Gae, Gpomdp, Olgarb, Olpomdp
from motorgrad.learning._growth import Growth, GrowthState
from motorgrad.learning._growth_criteria import Clock, Criterion, Plateau, PlateauState
from motorgrad.learning._index import SpatialIndex
from motorgrad.learning._indexed import IndexedAgent, IndexState
from motorgrad.learning._input_baselines import BinnedBaseline, InputBaseline, LinearBaseline, LinearState
from motorgrad.learning._natural import FisherMetric, FisherState
from motorgrad.learning._scale import RootMeanSquare, ScaleState
from motorgrad.learning._schedule import Annealed
from motorgrad.learning._traces import Episodic, Exponential, LaggedGaussian, Trace, Window
from motorgrad.learning._visited import Visited, VisitedState
from motorgrad.learning._weight_average import WeightAverage

__all__ = [
    "NEVER",
    "Agent",
    "AgentState",
    "Annealed",
    "Baseline",
    "BinnedBaseline",
    "Clock",
    "Constant",
    "Criterion",
    "CriticState",
    "DecayState",
    "Decision",
    "Episodic",
    "Estimator",
    "Exponential",
    "Features",
    "FisherMetric",
    "FisherState",
    "FixedStep",
    "Gae",
    "Gpomdp",
    "Growth",
    "GrowthState",
    "IndexState",
    "IndexedAgent",
    "InputBaseline",
    "LaggedGaussian",
    "LeastSquares",
    "LinearBaseline",
    "LinearCritic",
    "LinearState",
    "MeanReward",
    "NoBaseline",
    "Olgarb",
    "Olpomdp",
    "Plateau",
    "PlateauState",
    "RootMeanSquare",
    "RunningMean",
    "ScaleState",
    "SgdState",
    "SpatialIndex",
    "TemporalDifference",
    "Trace",
    "Visited",
    "VisitedState",
    "WeightAverage",
    "Window",
    "adam",
    "add_sample",
    "decayed",
    "entropy_gradient",
    "running_mean",
    "sgd",
    "two_sum",
]
