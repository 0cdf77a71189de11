"""The initial policies that the library has, by name."""

from motorgrad.policies._alternating import InitialAlternatingMotoneurons
from motorgrad.policies._binary import InitialHyperplanes, InitialMotoneurons
from motorgrad.policies._bounded import InitialBoundedHyperplanes
from motorgrad.policies._composed import InitialGated, InitialMixture
from motorgrad.policies._controller import InitialFiniteStateController
from motorgrad.policies._graded import InitialGradedHyperplanes, InitialGradedMotoneurons
from motorgrad.policies._grow_and_prune import InitialGrowing
from motorgrad.policies._hybrid import InitialGradedTiles, InitialPrimitives
from motorgrad.policies._layered import InitialLayered
from motorgrad.policies._local import InitialGaussians, InitialTiles
from motorgrad.policies._mirrored import InitialMirrored
from motorgrad.policies._mixed import InitialMixed
from motorgrad.policies._mosaic import InitialMosaic
from motorgrad.policies._oriented import InitialOrientedBoxes, InitialOrientedGaussians
from motorgrad.policies._querying import InitialQueryingMotoneurons
from motorgrad.policies._recurrent import InitialRecurrent
from motorgrad.policies._soft_shapes import InitialSoftBoxes, InitialSoftSpheres
from motorgrad.policies._softmax import InitialSoftmax
from motorgrad.policies._spiking import InitialSpiking
from motorgrad.policies._starting import INITIAL
from motorgrad.policies._tied import InitialTiedMotoneurons

INITIAL.update(
    {
        "alternating-motoneurons": InitialAlternatingMotoneurons,
        "bounded-hyperplanes": InitialBoundedHyperplanes,
        "finite-state-controller": InitialFiniteStateController,
        "gated": InitialGated,
        "gaussians": InitialGaussians,
        "graded-hyperplanes": InitialGradedHyperplanes,
        "graded-motoneurons": InitialGradedMotoneurons,
        "graded-tiles": InitialGradedTiles,
        "growing": InitialGrowing,
        "hyperplanes": InitialHyperplanes,
        "layered": InitialLayered,
        "mirrored": InitialMirrored,
        "mixed": InitialMixed,
        "mixture": InitialMixture,
        "mosaic": InitialMosaic,
        "motoneurons": InitialMotoneurons,
        "oriented-boxes": InitialOrientedBoxes,
        "oriented-gaussians": InitialOrientedGaussians,
        "primitives": InitialPrimitives,
        "querying-motoneurons": InitialQueryingMotoneurons,
        "recurrent": InitialRecurrent,
        "soft-boxes": InitialSoftBoxes,
        "soft-spheres": InitialSoftSpheres,
        "softmax": InitialSoftmax,
        "spiking": InitialSpiking,
        "tied-motoneurons": InitialTiedMotoneurons,
        "tiles": InitialTiles,
    }
)

IMPLIED: dict[str, dict[str, str]] = {"growing": {"growth": "clock"}}
"""Settings of the learner that an initial policy implies, by its name."""
