"""The wires that all diagrams of the gallery share."""

from typing import Any

from motorgrad.lab._block import Block
from motorgrad.lab._diagram import Diagram
from motorgrad.lab.blocks._boundary import Outlet
from motorgrad.lab.blocks.learning import Ascent, EligibilityTrace, GradientSample, MeanBaseline
from motorgrad.lab.blocks.learning._ascent import AscentBlock
from motorgrad.lab.blocks.learning._baselines import BaselineBlock


def learner(
    diagram: Diagram,
    units: Block,
    world: Block,
    decay: float,
    baseline: BaselineBlock | None = None,
    ascent: AscentBlock | None = None,
    **rule: Any,
) -> None:
    """Put units into a world, and what lets them learn around them: trace, baseline, gradient sample and ascent.

    The blocks are called `policy` and `world`, which gives them the random numbers that they have in training.

    **Arguments:** the diagram; the units; the world; the `decay` of their trace; the `baseline`, by default the mean
    reward; the `ascent`, by default steepest, with these settings.
    """
    size = units.outputs["parameters"].shape[0]
    diagram.add("world", world)
    diagram.add("policy", units)
    diagram.add("trace", EligibilityTrace(decay, size=size))
    diagram.add("baseline", baseline or MeanBaseline())
    diagram.add("gradient", GradientSample(size))
    diagram.add("ascent", ascent or Ascent(size=size, **rule))
    for source, target in (
        ("world.observation", "policy.observation"),
        ("policy.action", "world.action"),
        ("policy.score", "trace.score"),
        ("world.ended", "trace.ended"),
        ("world.reward", "baseline.reward"),
        ("world.valid", "baseline.valid"),
        ("baseline.error", "gradient.error"),
        ("trace.trace", "gradient.trace"),
        ("gradient.gradient", "ascent.gradient"),
        ("world.valid", "ascent.due"),
        ("ascent.step", "policy.step"),
    ):
        diagram.connect(source, target)
    record(diagram, "world.reward")


def record(diagram: Diagram, source: str, name: str | None = None) -> None:
    """Record an output by an outlet, called by its port unless another name is given."""
    block, port = source.split(".")
    shown = diagram.nodes[block].block.outputs[port]
    called = diagram.add(name or port, Outlet(shown.shape, shown.kind))
    diagram.connect(source, called)
