"""Stochastic units, and the policies composed of them."""

from motorgrad._interface import ActionCode, Interface, ObservationCode, Statistics
from motorgrad.policies import abilities
from motorgrad.policies._actor import Actor, decide
from motorgrad.policies._alternating import Alternating, InitialAlternatingMotoneurons, alternating_motoneurons
from motorgrad.policies._architectures import ACTIVATIONS, Architecture, MultilayerPerceptron
from motorgrad.policies._arguments import sizes
from motorgrad.policies._autoregressive import Autoregressive
from motorgrad.policies._binary import (
    BinaryUnits,
    Hyperplanes,
    InitialHyperplanes,
    InitialMotoneurons,
    Motoneurons,
    SigmoidUnits,
    hyperplanes,
    motoneurons,
)
from motorgrad.policies._bounded import BoundedHyperplanes, BoundedUnits, InitialBoundedHyperplanes, bounded_hyperplanes
from motorgrad.policies._composed import Factored, Gated, InitialGated, InitialMixture, gated, mixture
from motorgrad.policies._controller import FiniteStateController, InitialFiniteStateController, finite_state_controller
from motorgrad.policies._featured import Featured, Network
from motorgrad.policies._features import FeatureMap
from motorgrad.policies._frozen import frozen, thawed, with_frozen_functions
from motorgrad.policies._graded import (
    GradedHyperplanes,
    GradedMotoneurons,
    GradedUnits,
    InitialGradedHyperplanes,
    InitialGradedMotoneurons,
    graded_hyperplanes,
    graded_motoneurons,
)
from motorgrad.policies._grow_and_prune import InitialGrowing, Masked, activity, grow, growing, prune, reach
from motorgrad.policies._hybrid import (
    GradedPool,
    InitialGradedTiles,
    InitialPrimitives,
    Primitives,
    graded_tiles,
    primitives,
)
from motorgrad.policies._initial import IMPLIED
from motorgrad.policies._layered import InitialLayered, Layered, Sequential, layered
from motorgrad.policies._local import (
    FreeGaussians,
    GaussianUnits,
    InitialGaussians,
    InitialTiles,
    LocalGaussians,
    LocalUnits,
    PrintedGaussians,
    gaussians,
    tiles,
)
from motorgrad.policies._mirrored import InitialMirrored, Mirrored, mirrored
from motorgrad.policies._mixed import InitialMixed, Mixed, mixed
from motorgrad.policies._mosaic import InitialMosaic, Mosaic, mosaic
from motorgrad.policies._oriented import (
    InitialOrientedBoxes,
    InitialOrientedGaussians,
    OrientedBoxes,
    OrientedGaussians,
    oriented_boxes,
    oriented_gaussians,
)
from motorgrad.policies._parameters import fixed, split, trainable
from motorgrad.policies._policy import Policy, with_interface
from motorgrad.policies._products import in_batches
from motorgrad.policies._querying import InitialQueryingMotoneurons, Querying, querying_motoneurons
from motorgrad.policies._recurrent import InitialRecurrent, Recurrence, Recurrent, recurrent
from motorgrad.policies._soft_shapes import (
    InitialSoftBoxes,
    InitialSoftSpheres,
    SoftBoxes,
    SoftSpheres,
    soft_boxes,
    soft_spheres,
)
from motorgrad.policies._softmax import InitialSoftmax, Softmax, softmax
from motorgrad.policies._spiking import InitialSpiking, SpikingUnits, spiking
from motorgrad.policies._standardisation import Standardisation, adapted
from motorgrad.policies._starting import INITIAL, Initial, InitialPolicy, initial
from motorgrad.policies._structure import describe, rebuild
from motorgrad.policies._tied import InitialTiedMotoneurons, Tied, tied_motoneurons
from motorgrad.policies._tile_coding import TileCoding
from motorgrad.policies.abilities import Regions

__all__ = [
    "ACTIVATIONS",
    "IMPLIED",
    "INITIAL",
    "ActionCode",
    "Actor",
    "Alternating",
    "Architecture",
    "Autoregressive",
    "BinaryUnits",
    "BoundedHyperplanes",
    "BoundedUnits",
    "Factored",
    "FeatureMap",
    "Featured",
    "FiniteStateController",
    "FreeGaussians",
    "Gated",
    "GaussianUnits",
    "GradedHyperplanes",
    "GradedMotoneurons",
    "GradedPool",
    "GradedUnits",
    "Hyperplanes",
    "Initial",
    "InitialAlternatingMotoneurons",
    "InitialBoundedHyperplanes",
    "InitialFiniteStateController",
    "InitialGated",
    "InitialGaussians",
    "InitialGradedHyperplanes",
    "InitialGradedMotoneurons",
    "InitialGradedTiles",
    "InitialGrowing",
    "InitialHyperplanes",
    "InitialLayered",
    "InitialMirrored",
    "InitialMixed",
    "InitialMixture",
    "InitialMosaic",
    "InitialMotoneurons",
    "InitialOrientedBoxes",
    "InitialOrientedGaussians",
    "InitialPolicy",
    "InitialPrimitives",
    "InitialQueryingMotoneurons",
    "InitialRecurrent",
    "InitialSoftBoxes",
    "InitialSoftSpheres",
    "InitialSoftmax",
    "InitialSpiking",
    "InitialTiedMotoneurons",
    "InitialTiles",
    "Interface",
    "Layered",
    "LocalGaussians",
    "LocalUnits",
    "Masked",
    "Mirrored",
    "Mixed",
    "Mosaic",
    "Motoneurons",
    "MultilayerPerceptron",
    "Network",
    "ObservationCode",
    "OrientedBoxes",
    "OrientedGaussians",
    "Policy",
    "Primitives",
    "PrintedGaussians",
    "Querying",
    "Recurrence",
    "Recurrent",
    "Regions",
    "Sequential",
    "SigmoidUnits",
    "SoftBoxes",
    "SoftSpheres",
    "Softmax",
    "SpikingUnits",
    "Standardisation",
    "Statistics",
    "Tied",
    "TileCoding",
    "abilities",
    "activity",
    "adapted",
    "alternating_motoneurons",
    "bounded_hyperplanes",
    "decide",
    "describe",
    "finite_state_controller",
    "fixed",
    "frozen",
    "gated",
    "gaussians",
    "graded_hyperplanes",
    "graded_motoneurons",
    "graded_tiles",
    "grow",
    "growing",
    "hyperplanes",
    "in_batches",
    "initial",
    "layered",
    "mirrored",
    "mixed",
    "mixture",
    "mosaic",
    "motoneurons",
    "oriented_boxes",
    "oriented_gaussians",
    "primitives",
    "prune",
    "querying_motoneurons",
    "reach",
    "rebuild",
    "recurrent",
    "sizes",
    "soft_boxes",
    "soft_spheres",
    "softmax",
    "spiking",
    "split",
    "thawed",
    "tied_motoneurons",
    "tiles",
    "trainable",
    "with_frozen_functions",
    "with_interface",
]
