"""Wiring shared by the diagrams of the gallery."""

from typing import Any

from timlab.blocks import DiscreteLag, GradientSample, Scope
from timlab.blocks._policy_map import PolicyMap
from timlab.blocks.learning import SGD, EligibilityTrace, MeanBaseline
from timlab.diagram import Block, Diagram


def connect(diagram: Diagram, *wires: tuple[str, str]) -> None:
    """Connect outputs to inputs."""
    for source, target in wires:
        diagram.connect(source, target)


def learner(
    diagram: Diagram,
    units: Block,
    world: Block | None,
    decay: float,
    baseline: Block | None = None,
    optimizer: Block | None = None,
    trace: Block | None = None,
    **settings: Any,
) -> None:
    """Add units to a diagram with what lets them learn: trace, baseline, gradient sample and optimizer.

    With a world, the two are wired to each other and named `policy` and `world`, which gives them the random numbers
    that they have in training. Without one, `policy.observation`, `policy.action` and `baseline.reward` are left open;
    the reward must be that of the actions *before* the current tick.

    **Arguments:**

    - `diagram`, `units`: the diagram and the units.
    - `world`: the world, or `None`.
    - `decay`: of the trace.
    - `baseline`: a baseline or critic, by default the mean reward.
    - `optimizer`: by default SGD with these `settings`.
    - `trace`: by default an eligibility trace of this `decay`.
    """
    size = units.outputs["parameters"].shape[0]
    compared: Block = MeanBaseline() if baseline is None else baseline
    splits = "newest" in compared.outputs
    if world is not None:
        diagram.add("world", world)
    diagram.add("policy", units)
    filters = EligibilityTrace(decay, size=size, newest=splits) if trace is None else trace
    diagram.add("trace", filters)
    diagram.add("baseline", compared)
    diagram.add("gradient", GradientSample(size))
    diagram.add("optimizer", optimizer or SGD(size=size, **settings))
    connect(
        diagram,
        ("policy.score", "trace.score"),
        ("baseline.error", "gradient.error"),
        ("trace.trace", "gradient.trace"),
        ("gradient.gradient", "optimizer.gradient"),
        ("optimizer.step", "policy.step"),
    )
    if splits:
        connect(diagram, ("baseline.newest", "gradient.newest_error"), ("trace.newest", "gradient.newest_score"))
    if "error" in filters.inputs:
        connect(diagram, ("baseline.error", "trace.error"))
    if world is not None:
        if "valid" in filters.inputs:
            connect(diagram, ("world.valid", "trace.valid"))
        if "restart" in units.inputs:
            connect(diagram, ("world.ended", "policy.restart"))
        connect(
            diagram,
            ("world.observation", "policy.observation"),
            ("policy.action", "world.action"),
            ("world.ended", "trace.ended"),
            ("world.reward", "baseline.reward"),
            ("world.valid", "baseline.valid"),
            ("world.valid", "optimizer.due"),
        )
        seen = ("observation", "next_observation", "terminated", "ended")
        connect(diagram, *((f"world.{port}", f"baseline.{port}") for port in seen if port in compared.inputs))


def smoothed(diagram: Diagram, source: str, over: float, every: int = 10) -> None:
    """Plot an output, smoothed over a number of seconds, in a scope that samples once in `every` ticks."""
    name = source.split(".")[-1]
    diagram.add(f"mean {name}", DiscreteLag(constant=over))
    diagram.add(f"{name} over time", Scope((name,), every=every, window=50 * over))
    connect(diagram, (source, f"mean {name}"), (f"mean {name}", f"{name} over time"))


def map_of(
    diagram: Diagram, units: int, forces: tuple[tuple[float, float], ...], place: str, grows: bool = False
) -> None:
    """Show local units in the plane, with the forces they push with, assigned in turn; and the path of the learner."""
    pushes = tuple(forces[unit % len(forces)] for unit in range(units))
    box = (-0.1, 1.1)
    diagram.add("map", PolicyMap(units, 2, forces=pushes, across=box, up=box, every=5))
    connect(diagram, ("policy.parameters", "map.parameters"), (place, "map.place"))
    if grows:
        diagram.connect("policy.units", "map.units")
