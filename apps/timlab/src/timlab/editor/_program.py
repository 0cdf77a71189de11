"""A compiled diagram, and the signature that tells whether another diagram differs in parameters only."""

import hashlib
from collections.abc import Hashable
from typing import Any

import jax
import numpy as np

from timlab.compiler import Plan, plan
from timlab.diagram import Block, Diagram, Outlet, Sink, blocks_of, dumps, kind_of
from timlab.engine import Run, State

Values = dict[str, Any]


class Program:
    """A compiled diagram, with a `run` at tick 0.

    **Arguments:** the diagram; the seeds; the outputs to record. **Raises** `DiagramError` for a diagram that cannot
    run.
    """

    def __init__(self, diagram: Diagram, seeds: list[int], watch: list[str]):
        self.text = dumps(diagram)
        self.signature = signature(diagram)
        self.diagram, self.seeds, self.watch = diagram, seeds, watch
        there = outputs(diagram) if watch else []
        self.run = Run(diagram, seeds, watch=[address for address in watch if address in there])
        self.run.compile()
        self.fixed = next((f"{path}: {why}" for path, why in self.run.no_restore.items()), None)
        """Why the run cannot go back in time; `None` if it can."""


def signature(diagram: Diagram) -> object:
    """A value that is equal for diagrams that differ only in parameters, layout and the drawing of sinks. **Raises**
    `DiagramError`.
    """
    made: Plan = plan(diagram)

    def kind(block: Block) -> Hashable:
        if isinstance(block, Sink):
            return type(block), repr(dict(block.inputs))
        return kind_of(block)

    placed = [(p.path, p.identity, sorted(p.sources.items()), p.ticks, kind(p.block)) for p in made.blocks]
    return made.tick, made.solver, made.moving, placed


def learns(diagram: Diagram) -> bool:
    """Whether a block of the diagram learns."""
    return any(block.category == "learning" for block in blocks_of(diagram).values())


def parameters(diagram: Diagram) -> Values:
    """All parameters by address."""
    return {
        f"{path}.{name}": getattr(block, name)
        for path, block in blocks_of(diagram).items()
        for name in block.parameters
    }


def outputs(diagram: Diagram) -> list[str]:
    """The addresses of all outputs that can be recorded."""
    return [f"{placed.path}.{port}" for placed in plan(diagram).blocks for port in placed.block.outputs]


def sink_at(diagram: Diagram, path: str) -> Any:
    """The sink at a path, if it draws; outlets draw lines."""
    block = blocks_of(diagram).get(path)
    return block if isinstance(block, Sink) and not isinstance(block, Outlet) else None


def digest(state: State) -> str:
    """A hash of a state: equal for states that are equal bit for bit."""
    known = hashlib.sha256()
    for path, leaf in jax.tree_util.tree_leaves_with_path(state):
        array = np.ascontiguousarray(leaf)
        known.update(f"{jax.tree_util.keystr(path)} {array.dtype} {array.shape}".encode())
        known.update(array.tobytes())
    return known.hexdigest()
