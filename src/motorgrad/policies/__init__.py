"""Stochastic units and the policies they make up."""

from motorgrad.policies._binary import BinaryUnits, SigmoidUnits
from motorgrad.policies._factored import Factored
from motorgrad.policies._gaussian import FreeGaussians, GaussianUnits, LocalGaussians
from motorgrad.policies._graded import GradedMotoneurons, GradedUnits
from motorgrad.policies._grow import grow
from motorgrad.policies._hyperplane import Hyperplanes
from motorgrad.policies._initial import (
    INITIAL,
    Initial,
    gaussians,
    graded_motoneurons,
    hyperplanes,
    initial,
    motoneurons,
    querying_motoneurons,
    softmax,
    tiles,
)
from motorgrad.policies._motoneuron import Motoneurons
from motorgrad.policies._policy import Policy, fixed, split, trainable
from motorgrad.policies._querying import Querying
from motorgrad.policies._softmax import Softmax
from motorgrad.policies._structure import describe, rebuild

__all__ = [
    "INITIAL",
    "BinaryUnits",
    "Factored",
    "FreeGaussians",
    "GaussianUnits",
    "GradedMotoneurons",
    "GradedUnits",
    "Hyperplanes",
    "Initial",
    "LocalGaussians",
    "Motoneurons",
    "Policy",
    "Querying",
    "SigmoidUnits",
    "Softmax",
    "describe",
    "fixed",
    "gaussians",
    "graded_motoneurons",
    "grow",
    "hyperplanes",
    "initial",
    "motoneurons",
    "querying_motoneurons",
    "rebuild",
    "softmax",
    "split",
    "tiles",
    "trainable",
]
