"""The initial policies that the library has, by name."""

from motorgrad.policies._binary import hyperplanes, motoneurons
from motorgrad.policies._bounded import bounded_hyperplanes
from motorgrad.policies._composed import gated, mixture
from motorgrad.policies._controller import finite_state_controller
from motorgrad.policies._graded import graded_hyperplanes, graded_motoneurons
from motorgrad.policies._grow_and_prune import growing
from motorgrad.policies._hybrid import graded_tiles, primitives
from motorgrad.policies._layered import layered
from motorgrad.policies._local import gaussians, tiles
from motorgrad.policies._mirrored import mirrored
from motorgrad.policies._mixed import mixed
from motorgrad.policies._querying import querying_motoneurons
from motorgrad.policies._recurrent import recurrent
from motorgrad.policies._registry import INITIAL
from motorgrad.policies._soft_shapes import soft_boxes, soft_spheres
from motorgrad.policies._softmax import softmax

INITIAL.update(
    {
        "bounded-hyperplanes": bounded_hyperplanes,
        "finite-state-controller": finite_state_controller,
        "gated": gated,
        "gaussians": gaussians,
        "graded-hyperplanes": graded_hyperplanes,
        "graded-motoneurons": graded_motoneurons,
        "graded-tiles": graded_tiles,
        "growing": growing,
        "hyperplanes": hyperplanes,
        "layered": layered,
        "mirrored": mirrored,
        "mixed": mixed,
        "mixture": mixture,
        "motoneurons": motoneurons,
        "primitives": primitives,
        "querying-motoneurons": querying_motoneurons,
        "recurrent": recurrent,
        "soft-boxes": soft_boxes,
        "soft-spheres": soft_spheres,
        "softmax": softmax,
        "tiles": tiles,
    }
)

IMPLIED: dict[str, dict[str, str]] = {"growing": {"growth": "clock"}}
"""Settings of the learner that an initial policy implies, by its name."""
