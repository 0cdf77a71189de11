"""The registry: the parts of a learner by name. One line here gives a part its name in options, TOML and TimLab."""

from motorgrad.learning._accuracy import Accuracy
from motorgrad.learning._action_transitions import ActionTransitions
from motorgrad.learning._action_value_ensemble import ActionValueEnsemble
from motorgrad.learning._baselines import Baseline, BinnedBaseline, Constant, FixedStep, LinearBaseline, MeanReward
from motorgrad.learning._centring import Centring, SimpleCentring, ValueBasedCentring
from motorgrad.learning._chain import SGD, Adam, Optimizer, PolyakAveraging
from motorgrad.learning._conjugate import ConjugateGradient
from motorgrad.learning._conjugate_ascent import ConjugateAscent
from motorgrad.learning._critic_fits import CriticFit, LeastSquares, TemporalDifference
from motorgrad.learning._critics import Features, LinearCritic, NetworkCritic
from motorgrad.learning._estimator import Estimator
from motorgrad.learning._fitted_values import FittedReturns
from motorgrad.learning._incremental_natural import CompatibleWeights, ShermanMorrison
from motorgrad.learning._intentional import IntentionalStep, IntentionalTemporalDifference
from motorgrad.learning._learned_step import LearnedStep
from motorgrad.learning._learned_trace import LearnedTrace
from motorgrad.learning._natural import FisherMetric, Metric
from motorgrad.learning._natural_regression import EpisodicNatural, LeastSquaresNatural
from motorgrad.learning._newton import NewtonMetric
from motorgrad.learning._optimal_baselines import OptimalBaseline, UnitMean
from motorgrad.learning._overshooting import BoundedTemporalDifference, OvershootingBound, StepBound
from motorgrad.learning._replay import Hindsight, Replay
from motorgrad.learning._reward_criteria import Average, Discounted, Last, Maximum, RewardCriterion
from motorgrad.learning._scaling import RewardScaling, RootMeanSquare
from motorgrad.learning._schedules import Annealed
from motorgrad.learning._stationary_metric import StationaryMetric
from motorgrad.learning._swift import SwiftTemporalDifference
from motorgrad.learning._traces import Episodic, Exponential, LaggedGaussian, Trace, Window
from motorgrad.learning._true_online import TrueOnlineTemporalDifference
from motorgrad.learning.algorithms._action_value_gradient import ActionValues
from motorgrad.learning.algorithms._soft_actor_critic import EntropyTarget
from motorgrad.learning.growth import Clock, Criterion, Growth, Plateau, Visited
from motorgrad.learning.sparse import SpatialIndex
from motorgrad.policies import Architecture, FeatureMap, MultilayerPerceptron, TileCoding
from motorgrad.schema import PART_CLASSES
from motorgrad.schema import register as register

PART_CLASSES.update(
    {
        Accuracy: {"accuracy": Accuracy},
        ActionValueEnsemble: {"action-value-ensemble": ActionValueEnsemble},
        ActionValues: {"action-values": ActionValues},
        Architecture: {"perceptron": MultilayerPerceptron},
        Annealed: {"annealed": Annealed},
        Baseline: {
            "action-transitions": ActionTransitions,
            "binned": BinnedBaseline,
            "constant": Constant,
            "critic": LinearCritic,
            "fixed-step": FixedStep,
            "learned-step": LearnedStep,
            "linear": LinearBaseline,
            "mean": MeanReward,
            "network-critic": NetworkCritic,
            "optimal": OptimalBaseline,
            "unit-mean": UnitMean,
        },
        Centring: {"simple": SimpleCentring, "value-based": ValueBasedCentring},
        Criterion: {"clock": Clock, "plateau": Plateau},
        CriticFit: {
            "bounded-td": BoundedTemporalDifference,
            "fitted-returns": FittedReturns,
            "intentional-td": IntentionalTemporalDifference,
            "least-squares": LeastSquares,
            "swift-td": SwiftTemporalDifference,
            "td": TemporalDifference,
            "true-online-td": TrueOnlineTemporalDifference,
        },
        EntropyTarget: {"entropy-target": EntropyTarget},
        Estimator: {"estimator": Estimator},
        FeatureMap: {"map": FeatureMap},
        Features: {"features": Features},
        Growth: {"constructive": Growth},
        Hindsight: {"hindsight": Hindsight},
        Metric: {
            "compatible": CompatibleWeights,
            "conjugate-gradient": ConjugateGradient,
            "episodic-nac": EpisodicNatural,
            "fisher": FisherMetric,
            "lstd-nac": LeastSquaresNatural,
            "newton": NewtonMetric,
            "sherman-morrison": ShermanMorrison,
            "stationary": StationaryMetric,
        },
        Optimizer: {"adam": Adam, "conjugate-ascent": ConjugateAscent, "sgd": SGD},
        PolyakAveraging: {"polyak": PolyakAveraging},
        Replay: {"replay": Replay},
        RewardCriterion: {"average": Average, "discounted": Discounted, "last": Last, "maximum": Maximum},
        RewardScaling: {"reward-scaling": RewardScaling},
        RootMeanSquare: {"root-mean-square": RootMeanSquare},
        SpatialIndex: {"grid": SpatialIndex},
        StepBound: {"intentional": IntentionalStep, "overshooting": OvershootingBound},
        TileCoding: {"tile-coding": TileCoding},
        Trace: {
            "episodic": Episodic,
            "exponential": Exponential,
            "lagged-gaussian": LaggedGaussian,
            "learned": LearnedTrace,
            "window": Window,
        },
        Visited: {"visited": Visited},
    }
)
