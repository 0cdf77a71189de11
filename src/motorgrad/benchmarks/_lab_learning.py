"""Learning diagrams of many seeds in one call, compared with the library's own training."""

from motorgrad.benchmarks._lab import rate
from motorgrad.benchmarks._measure import Row, in_turn
from motorgrad.lab import Diagram, Run, Sink
from motorgrad.lab.gallery import example
from motorgrad.tasks import make
from motorgrad.training import agent_for, stepper_for


def learning_diagram_row(name: str, seeds: int, ticks: int, runs: int = 5, wanted: str = "") -> Row:
    """Learning ticks per second of a diagram of the gallery, of all seeds together in one call."""
    run = Run(without_sinks(example(name)), seeds)
    run.advance(128)  # compiles
    return Row(
        f"diagram {name} that learns, {seeds:,} seeds",
        rate(run, ticks, runs) * seeds,
        None,
        "ticks/s",
        None,
        None,
        wanted,
    )


def beside_training_row(name: str, seeds: int, ticks: int, pairs: int = 5, wanted: str = "") -> Row:
    """The diagram's speed divided by that of `motorgrad.train`'s own loop on the task of that name."""
    run = Run(without_sinks(example(name)), seeds)
    task = make(name)
    whole = stepper_for(task, agent_for(task), range(seeds))
    run.advance(ticks)
    whole.advance(ticks)
    title = f"diagram {name} ÷ training, {seeds:,} seeds"
    return in_turn(
        title,
        "ticks/s",
        ticks * seeds,
        lambda: run.advance(ticks),
        lambda: whole.advance(ticks),
        pairs=pairs,
        wanted=wanted,
    )


def without_sinks(diagram: Diagram) -> Diagram:
    """The diagram without its sinks, so that nothing is recorded."""
    for name in [name for name, node in diagram.nodes.items() if isinstance(node.block, Sink)]:
        diagram.remove(name)
    return diagram
