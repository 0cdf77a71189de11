"""Stochastic units and the policies they make up."""

from motorgrad.policies._binary import BinaryUnits, SigmoidUnits
from motorgrad.policies._box import SoftBoxes
from motorgrad.policies._factored import Factored
from motorgrad.policies._gated import Gated
from motorgrad.policies._gaussian import FreeGaussians, GaussianUnits, LocalGaussians
from motorgrad.policies._graded import GradedMotoneurons, GradedUnits
from motorgrad.policies._graded_hyperplane import GradedHyperplanes
from motorgrad.policies._graded_pool import GradedPool
from motorgrad.policies._grow import grow
from motorgrad.policies._hyperplane import Hyperplanes
from motorgrad.policies._initial import IMPLIED, INITIAL, Initial, initial
from motorgrad.policies._initial_composed import gated, mirrored, mixture, primitives
from motorgrad.policies._initial_global import (
    graded_hyperplanes,
    graded_motoneurons,
    hyperplanes,
    motoneurons,
    querying_motoneurons,
    softmax,
)
from motorgrad.policies._initial_local import gaussians, graded_tiles, growing, soft_boxes, soft_spheres, tiles
from motorgrad.policies._masked import Masked
from motorgrad.policies._mirrored import Mirrored
from motorgrad.policies._motoneuron import Motoneurons
from motorgrad.policies._policy import Policy, fixed, split, trainable
from motorgrad.policies._primitives import Primitives
from motorgrad.policies._prune import activity, prune, reach
from motorgrad.policies._querying import Querying
from motorgrad.policies._softmax import Softmax
from motorgrad.policies._sphere import SoftSpheres
from motorgrad.policies._structure import describe, rebuild

__all__ = [
    "IMPLIED",
    "INITIAL",
    "BinaryUnits",
    "Factored",
    "FreeGaussians",
    "Gated",
    "GaussianUnits",
    "GradedHyperplanes",
    "GradedMotoneurons",
    "GradedPool",
    "GradedUnits",
    "Hyperplanes",
    "Initial",
    "LocalGaussians",
    "Masked",
    "Mirrored",
    "Motoneurons",
    "Policy",
    "Primitives",
    "Querying",
    "SigmoidUnits",
    "SoftBoxes",
    "SoftSpheres",
    "Softmax",
    "activity",
    "describe",
    "fixed",
    "gated",
    "gaussians",
    "graded_hyperplanes",
    "graded_motoneurons",
    "graded_tiles",
    "grow",
    "growing",
    "hyperplanes",
    "initial",
    "mirrored",
    "mixture",
    "motoneurons",
    "primitives",
    "prune",
    "querying_motoneurons",
    "reach",
    "rebuild",
    "soft_boxes",
    "soft_spheres",
    "softmax",
    "split",
    "tiles",
    "trainable",
]
