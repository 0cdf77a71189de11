"""The wires that all diagrams of the gallery share."""

from typing import Any

from motorgrad.lab.blocks import Ascent, DiscreteLag, EligibilityTrace, GradientSample, MeanBaseline, Scope
from motorgrad.lab.blocks._policy_map import PolicyMap
from motorgrad.lab.diagram import Block, Diagram


def connect(diagram: Diagram, *wires: tuple[str, str]) -> None:
    """Lead wires, each from an output to an input."""
    for source, target in wires:
        diagram.connect(source, target)


def learner(
    diagram: Diagram,
    units: Block,
    world: Block | None,
    decay: float,
    baseline: Block | None = None,
    ascent: Block | None = None,
    **rule: Any,
) -> None:
    """Put units into a diagram, and around them what lets them learn: trace, baseline, gradient sample and ascent.

    With a world they are wired to it, and the two are called `policy` and `world`, which gives them the random numbers
    that they have in training. Without one, `policy.observation`, `policy.action` and `baseline.reward` are left open;
    what is led there as a reward is of the actions *before* this tick.

    **Arguments:** the diagram; the units; the world, or `None`; the `decay` of the trace; the `baseline`, by default
    the mean reward; the `ascent`, by default steepest, with these settings.
    """
    size = units.outputs["parameters"].shape[0]
    if world is not None:
        diagram.add("world", world)
    diagram.add("policy", units)
    diagram.add("trace", EligibilityTrace(decay, size=size))
    diagram.add("baseline", baseline or MeanBaseline())
    diagram.add("gradient", GradientSample(size))
    diagram.add("ascent", ascent or Ascent(size=size, **rule))
    connect(
        diagram,
        ("policy.score", "trace.score"),
        ("baseline.error", "gradient.error"),
        ("trace.trace", "gradient.trace"),
        ("gradient.gradient", "ascent.gradient"),
        ("ascent.step", "policy.step"),
    )
    if world is not None:
        connect(
            diagram,
            ("world.observation", "policy.observation"),
            ("policy.action", "world.action"),
            ("world.ended", "trace.ended"),
            ("world.reward", "baseline.reward"),
            ("world.valid", "baseline.valid"),
            ("world.valid", "ascent.due"),
        )


def smoothed(diagram: Diagram, source: str, over: float, every: int = 10) -> None:
    """Show an output, smoothed over so many seconds, in a scope that looks once in so many ticks."""
    name = source.split(".")[-1]
    diagram.add(f"mean {name}", DiscreteLag(constant=over))
    diagram.add(f"{name} over time", Scope((name,), every=every, window=50 * over))
    connect(diagram, (source, f"mean {name}"), (f"mean {name}", f"{name} over time"))


def map_of(
    diagram: Diagram, units: int, forces: tuple[tuple[float, float], ...], place: str, grows: bool = False
) -> None:
    """Show local units in the plane, with the forces they push with, dealt out in turn; and where the learner goes."""
    pushes = tuple(forces[unit % len(forces)] for unit in range(units))
    box = (-0.1, 1.1)
    diagram.add("map", PolicyMap(units, 2, forces=pushes, across=box, up=box, every=5))
    connect(diagram, ("policy.parameters", "map.parameters"), (place, "map.place"))
    if grows:
        diagram.connect("policy.units", "map.units")
