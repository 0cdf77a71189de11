"""Driving one block by given signals, and one continuous block by a wave in a diagram."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from timlab import BLOCKS, Block, Diagram, Moment, Outlet, Port, Run

SETTINGS: dict[str, Any] = {}
"""Arguments for types that have no defaults for all; a test sets those of the data file."""


def of(name: str, *arguments: Any, **settings: Any) -> Block:
    """A block of the registry."""
    return BLOCKS[name](*arguments, **settings)


def arrays(block: Block) -> Block:
    """A block as its functions see it."""
    return block.bound({name: jnp.asarray(value) for name, value in block.values().items()})


def signal(port: Port, value: Any = None) -> jax.Array:
    value = (port.default or 0.0) if value is None else value
    return jnp.broadcast_to(jnp.asarray(value, port.dtype), port.shape)


def drive(block: Block, ticks: int, step: float = 0.1, **inputs: Any) -> dict[str, np.ndarray]:
    """Every output over so many evaluations, of a block that is no continuous one.

    **Arguments:** the inputs by name, with a leading axis of ticks; those left out are at their defaults.
    """
    own, ports = arrays(block), block.inputs

    def once(state: Any, given: Any) -> Any:
        tick, row = given
        time = tick * jnp.asarray(step)
        now = Moment(tick, time, jnp.asarray(step), jnp.zeros(block.uniforms), time)
        signals = {name: signal(port, row.get(name)) for name, port in ports.items()}
        outputs = own.output(state, {n: u for n, u in signals.items() if ports[n].feedthrough}, now)
        return own.update(state, signals, now), outputs

    rows = {name: jnp.asarray(values) for name, values in inputs.items()}
    start = own.init(jnp.zeros(block.init_uniforms))
    _, seen = jax.lax.scan(once, start, (jnp.arange(ticks, dtype=jnp.uint32), rows))
    return {name: np.asarray(values) for name, values in seen.items()}


def alone(source: Block, ticks: int, tick: float = 0.01, seeds: int = 1, port: str = "y") -> np.ndarray:
    """What a source gives in a diagram, `(seeds, ticks, …)`."""
    diagram = Diagram(tick)
    diagram.add("source", source)
    declared = source.outputs[port]
    diagram.add("out", Outlet(declared.shape, declared.kind))
    diagram.connect(f"source.{port}", "out")
    return Run(diagram, seeds).advance(ticks)["out.u"]


def answer(block: Block, source: Block, ticks: int, tick: float = 0.01, substeps: int = 1) -> np.ndarray:
    """What a block with one input and one output makes of a source, `(ticks, …)`."""
    diagram = Diagram(tick, substeps)
    diagram.add("source", source)
    diagram.add("block", block)
    diagram.add("out", Outlet(block.outputs["y"].shape))
    diagram.connect("source", "block.u")
    diagram.connect("block", "out")
    return Run(diagram).advance(ticks)["out.u"][0]
