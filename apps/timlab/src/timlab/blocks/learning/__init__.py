"""Parts of a learner as blocks: units, traces, baselines, optimizers, to be wired anew; and a whole learner.

    observation ─▶ units ─ action ─▶ world ─ reward ─▶ baseline ─ error ─┐
                   ▲  └─ score ─▶ trace ────────────────────────▶ gradient sample ─▶ optimizer ─ step ─┐
                   └────────────────────────────────────────────────────────────────────────────────┘

The reward at a tick is for the actions before it. Within a tick, the world outputs its observation and the reward of
the last action; the error times the trace of the actions so far is the gradient sample, and the units take its step at
once; then they act. The trace takes in the new score for the next tick, which cuts the loop. This is the order of
`motorgrad.train`, and leads to the same parameters.

Traces, baselines, optimizers and normalizations have a block for every part in the library's registry. A part that is
registered by `motorgrad.learning.register` has one too: `timlab.BLOCKS["my-trace trace"]`.
"""

from typing import Any

from motorgrad import learning
from timlab.blocks.learning._estimators import (
    NormalizationBlock,
    TraceBlock,
    baseline_block,
)
from timlab.blocks.learning._growing import GrowingGaussians
from timlab.blocks.learning._learner import Learner
from timlab.blocks.learning._named_policies import NamedPolicy, Network
from timlab.blocks.learning._optimizers import OptimizerBlock, WeightDecay
from timlab.blocks.learning._parts import PartBlocks
from timlab.blocks.learning._samples import GradientMean, GradientSample
from timlab.blocks.learning._units import Gaussians, Hyperplanes, Motoneurons, Softmax

PART_BLOCKS = PartBlocks(
    {
        learning.Trace: ("{} trace", lambda part: TraceBlock),
        learning.Baseline: ("{} baseline", baseline_block),
        learning.RootMeanSquare: ("{} normalization", lambda part: NormalizationBlock),
        learning.Optimizer: ("{}", lambda part: OptimizerBlock),
    }
)
"""The types of blocks of all registered traces, baselines, normalizations and optimizers, by name."""

__all__ = [
    "PART_BLOCKS",
    "Gaussians",
    "GradientMean",
    "GradientSample",
    "GrowingGaussians",
    "Hyperplanes",
    "Learner",
    "Motoneurons",
    "NamedPolicy",
    "Network",
    "Softmax",
    "WeightDecay",
]


def __getattr__(title: str) -> Any:
    """The block of a registered part by the name of its class, such as `EligibilityTrace`."""
    return PART_BLOCKS.by_title(title)
