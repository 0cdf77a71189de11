"""The registry: the parts of a learner by name. One line here gives a part its name in options, TOML and TimLab."""

from motorgrad._tree import KINDS
from motorgrad._tree import register as register
from motorgrad.learning._agent import Agent
from motorgrad.learning._baselines import Baseline, BinnedBaseline, Constant, FixedStep, LinearBaseline, MeanReward
from motorgrad.learning._chain import SGD, Adam, Optimizer, PolyakAveraging
from motorgrad.learning._conjugate import ConjugateGradient
from motorgrad.learning._critic_fits import CriticFit, LeastSquares, TemporalDifference
from motorgrad.learning._critics import Features, LinearCritic, NetworkCritic
from motorgrad.learning._estimator import Estimator, RootMeanSquare
from motorgrad.learning._fitted_values import FittedReturns
from motorgrad.learning._natural import FisherMetric, Metric
from motorgrad.learning._overshooting import BoundedTemporalDifference, OvershootingBound
from motorgrad.learning._schedules import Annealed
from motorgrad.learning._traces import Episodic, Exponential, LaggedGaussian, Trace, Window
from motorgrad.learning._true_online import TrueOnlineTemporalDifference
from motorgrad.learning.growth import Clock, Criterion, Growth, Plateau, Visited
from motorgrad.learning.sparse import SparseAgent, SpatialIndex
from motorgrad.policies import Architecture, FeatureMap, MultilayerPerceptron

KINDS.update(
    {
        Agent: {"dense": Agent, "sparse": SparseAgent},
        Architecture: {"perceptron": MultilayerPerceptron},
        Annealed: {"annealed": Annealed},
        Baseline: {
            "binned": BinnedBaseline,
            "constant": Constant,
            "critic": LinearCritic,
            "fixed-step": FixedStep,
            "linear": LinearBaseline,
            "mean": MeanReward,
            "network-critic": NetworkCritic,
        },
        Criterion: {"clock": Clock, "plateau": Plateau},
        CriticFit: {
            "bounded-td": BoundedTemporalDifference,
            "fitted-returns": FittedReturns,
            "least-squares": LeastSquares,
            "td": TemporalDifference,
            "true-online-td": TrueOnlineTemporalDifference,
        },
        Estimator: {"estimator": Estimator},
        FeatureMap: {"map": FeatureMap},
        Features: {"features": Features},
        Growth: {"constructive": Growth},
        Metric: {"conjugate-gradient": ConjugateGradient, "fisher": FisherMetric},
        Optimizer: {"adam": Adam, "sgd": SGD},
        OvershootingBound: {"overshooting": OvershootingBound},
        PolyakAveraging: {"polyak": PolyakAveraging},
        RootMeanSquare: {"root-mean-square": RootMeanSquare},
        SpatialIndex: {"grid": SpatialIndex},
        Trace: {
            "episodic": Episodic,
            "exponential": Exponential,
            "lagged-gaussian": LaggedGaussian,
            "window": Window,
        },
        Visited: {"visited": Visited},
    }
)
