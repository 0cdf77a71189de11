"""Learning, taken apart: units, traces, baselines, ascent, to be wired anew.

    observation ─▶ units ─ action ─▶ world ─ reward ─▶ baseline ─ error ─┐
                   ▲  └─ score ─▶ trace ─────────────────────────▶ gradient sample ─▶ ascent ─ step ─┐
                   └──────────────────────────────────────────────────────────────────────────────┘

What is paid at a tick is paid for the actions before it. So within a tick: the world shows what the last action led to
and what it pays; the error times the trace of the actions so far is the gradient sample, whose step the units take in
at once; then they act. The trace takes in the new score for the next tick, which is where the loop is cut. This is the
order of `motorgrad.train`, and leads to the same parameters.
"""

from motorgrad.lab.blocks.learning._ascent import Adam, Ascent, WeightDecay
from motorgrad.lab.blocks.learning._baselines import ConstantBaseline, FixedStepBaseline, MeanBaseline
from motorgrad.lab.blocks.learning._credit import AdvantageScale, GradientMean, GradientSample
from motorgrad.lab.blocks.learning._critic import Critic
from motorgrad.lab.blocks.learning._gaussians import Gaussians
from motorgrad.lab.blocks.learning._growing import GrowingGaussians
from motorgrad.lab.blocks.learning._hyperplanes import Hyperplanes
from motorgrad.lab.blocks.learning._learner import Learner
from motorgrad.lab.blocks.learning._motoneurons import Motoneurons
from motorgrad.lab.blocks.learning._policy import NamedPolicy
from motorgrad.lab.blocks.learning._softmax import Softmax
from motorgrad.lab.blocks.learning._traces import EligibilityTrace, EpisodicTrace, LaggedTrace, WindowTrace
from motorgrad.lab.diagram import Block

BLOCKS: tuple[type[Block], ...] = (
    Adam,
    AdvantageScale,
    Ascent,
    ConstantBaseline,
    Critic,
    EligibilityTrace,
    EpisodicTrace,
    FixedStepBaseline,
    Gaussians,
    GradientMean,
    GradientSample,
    GrowingGaussians,
    Hyperplanes,
    LaggedTrace,
    Learner,
    MeanBaseline,
    Motoneurons,
    NamedPolicy,
    Softmax,
    WeightDecay,
    WindowTrace,
)
"""The types of learning blocks."""
