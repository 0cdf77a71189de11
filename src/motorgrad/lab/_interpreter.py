"""The reference: a diagram run one block at a time, uncompiled. It is what the compiled form must agree with."""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.lab._block import Block, Moment
from motorgrad.lab._diagram import Diagram
from motorgrad.lab._host import Host, HostBlock, HostMoment
from motorgrad.lab._integrate import rk4
from motorgrad.lab._plan import Plan, plan
from motorgrad.lab._port import Port
from motorgrad.lab._sink import Sink
from motorgrad.lab._streams import SPAN, draw_span, draw_start

Values = dict[tuple[int, str], Any]


class Interpreter:
    """One seed of a diagram in motion, to be stepped at once after an edit; slow, and plain.

    **Arguments:** the diagram and the seed. `signals` has every output of the last tick by address, `"block.port"`.
    """

    def __init__(self, diagram: Diagram, seed: int = 0):
        self.plan: Plan = plan(diagram)
        self.seed, self.tick = seed, 0
        self.blocks: list[Block] = [placed.block.bound(arrays(placed.block)) for placed in self.plan.blocks]
        self.states: list[Any] = []
        self._values: Values = {}
        self._drawn: dict[int, tuple[int, np.ndarray]] = {}
        for block, placed in zip(self.blocks, self.plan.blocks, strict=True):
            numbers = draw_start(seed, placed.stream, block.init_uniforms)
            if isinstance(block, HostBlock):
                self.states.append(block.start(np.array([seed]), np.asarray(numbers)[None], 1))
            else:
                self.states.append(jax.tree.map(jnp.asarray, block.init(numbers)))

    @property
    def signals(self) -> dict[str, np.ndarray]:
        return {f"{self.plan.blocks[i].path}.{port}": np.asarray(v) for (i, port), v in self._values.items()}

    def advance(self, ticks: int) -> dict[str, np.ndarray]:
        """Make so many ticks.

        **Returns** what the sinks saw, by address, along a leading axis of their ticks.
        """
        seen: dict[str, list[np.ndarray]] = {}
        for _ in range(ticks):
            for address, value in self._advance().items():
                seen.setdefault(address, []).append(value)
        return {address: np.stack(values) for address, values in seen.items()}

    def _advance(self) -> dict[str, np.ndarray]:
        """One tick: outputs in order, then the new states."""
        time = self.tick * self.plan.tick
        for i in self.plan.order:
            if self._due(i):
                self._evaluate(i, self._values, self.states[i], time)
        record = {}
        for i, block in enumerate(self.blocks):
            if isinstance(block, Sink) and self._due(i):
                inputs = self._inputs(i, self._values)
                record |= {f"{self.plan.blocks[i].path}.{port}": np.asarray(v) for port, v in inputs.items()}
        ends = self._integrated()
        for i, block in enumerate(self.blocks):
            if not self._due(i):
                continue
            inputs, now = self._inputs(i, self._values), self._now(i, time)
            if isinstance(block, HostBlock):
                self.states[i].update(block, _rows(inputs), _host_moment(self.tick, now))
            else:
                after = block.update(ends.get(i, self.states[i]), inputs, now)
                self.states[i] = jax.tree.map(lambda new, old: jnp.asarray(new, old.dtype), after, self.states[i])
        self.tick += 1
        return record

    def _integrated(self) -> dict[int, Any]:
        """The continuous states at the end of the tick: RK4 on the blocks that move, all others held."""
        movers = {i: self.states[i] for i, block in enumerate(self.blocks) if block.is_continuous}
        step = self.plan.tick / self.plan.substeps
        for substep in range(self.plan.substeps if movers else 0):
            movers = rk4(self._slopes, movers, self.tick * self.plan.tick + substep * step, step)
        return movers

    def _slopes(self, movers: dict[int, Any], time: float) -> dict[int, Any]:
        values = dict(self._values)
        for i in self.plan.order:
            if i in self.plan.moving:
                self._evaluate(i, values, movers.get(i, self.states[i]), time)
        return {
            i: self.blocks[i].derivative(state, self._inputs(i, values), self._now(i, time))
            for i, state in movers.items()
        }

    def _evaluate(self, i: int, values: Values, state: Any, time: float) -> None:
        block, ports = self.blocks[i], self.plan.blocks[i].block.outputs
        inputs, now = self._inputs(i, values, feedthrough=True), self._now(i, time)
        if isinstance(block, HostBlock):
            given = self._host(i).output(block, _rows(inputs), _host_moment(self.tick, now))
            given = {name: value[0] for name, value in given.items()}
        else:
            given = block.output(state, inputs, now)
        for name, port in ports.items():
            values[i, name] = jnp.asarray(given[name], port.dtype)

    def _host(self, i: int) -> Host:
        return self.states[i]

    def _inputs(self, i: int, values: Values, feedthrough: bool = False) -> dict[str, Any]:
        placed = self.plan.blocks[i]
        return {
            name: self._read(placed.sources.get(name), port, values)
            for name, port in placed.block.inputs.items()
            if port.feedthrough or not feedthrough
        }

    @staticmethod
    def _read(source: Any, port: Port, values: Values) -> Any:
        value = jnp.full(port.shape, port.default or 0.0) if source is None else values[source.block, source.port]
        return jnp.asarray(value, port.dtype)

    def _due(self, i: int) -> bool:
        return self.tick % self.plan.blocks[i].ticks == 0

    def _now(self, i: int, time: float) -> Moment:
        real, step = jnp.result_type(float), self.plan.blocks[i].ticks * self.plan.tick
        return Moment(jnp.uint32(self.tick), jnp.asarray(time, real), jnp.asarray(step, real), self._uniforms(i))

    def _uniforms(self, i: int) -> Any:
        span, size = self.tick // SPAN, self.blocks[i].uniforms
        if size == 0:
            return jnp.zeros(0)
        if self._drawn.get(i, (None, None))[0] != span:
            self._drawn[i] = span, np.asarray(draw_span(self.seed, self.plan.blocks[i].stream, span, size))
        return jnp.asarray(self._drawn[i][1][self.tick % SPAN])


def arrays(block: Block) -> Mapping[str, Any]:
    """A block's parameters as JAX arrays."""
    return {name: jnp.asarray(value) for name, value in block.values().items()}


def _rows(inputs: dict[str, Any]) -> dict[str, np.ndarray]:
    return {name: np.array(value)[None] for name, value in inputs.items()}


def _host_moment(tick: int, now: Moment) -> HostMoment:
    return HostMoment(tick, float(now.time), float(now.step), np.asarray(now.uniforms)[None])
