"""The reference implementation: a diagram run one block at a time, uncompiled. Compiled runs must agree with it."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.lab.compiler import SPAN, Plan, address_of, draw_span, draw_start, integrated, plan, stack, with_watched
from motorgrad.lab.diagram import Block, Diagram, Host, HostBlock, HostMoment, Moment, Port, Record, Sink
from motorgrad.lab.engine._parameters import Parameters
from motorgrad.lab.engine._state import State, check_state

Values = dict[tuple[int, str], Any]


class Interpreter:
    """One seed of a diagram, run without compilation: slow, but ready at once after an edit.

    It has the interface of a `Run`, and their states are interchangeable.

    **Arguments:** the diagram; the seed; outputs to `watch`, as for a `Run`. `signals` has every output of the last
    tick by address, `"block.port"`.
    """

    def __init__(self, diagram: Diagram, seed: int = 0, watch: Sequence[str] = ()):
        self.plan: Plan = with_watched(plan(diagram), watch)
        self.seed, self.tick = seed, 0
        self._parameters = Parameters(stack(self.plan, stacked=False), {}, 1)
        self._blocks: list[Block] = []
        self._bind()
        self._values: Values = {}
        self._clock: tuple[Any, ...] = (None,)
        self._none = jnp.zeros(0)
        self._jumping = [i for i in sorted(self.plan.moving) if self.plan.blocks[i].block.jumps]
        self._steps = [jnp.asarray(p.ticks * self.plan.tick, jnp.result_type(float)) for p in self.plan.blocks]
        self._drawn: dict[int, tuple[int, np.ndarray]] = {}
        self._states: list[Any] = []
        for block, placed in zip(self._blocks, self.plan.blocks, strict=True):
            numbers = draw_start(seed, placed.stream, block.init_uniforms)
            if isinstance(block, HostBlock):
                self._states.append(block.start(np.array([seed]), np.asarray(numbers)[None], 1))
            else:
                self._states.append(jax.tree.map(jnp.asarray, block.init(numbers)))

    @property
    def signals(self) -> dict[str, np.ndarray]:
        return {f"{self.plan.blocks[i].path}.{port}": np.asarray(v) for (i, port), v in self._values.items()}

    def advance(self, ticks: int) -> Record:
        """Run a number of ticks.

        **Returns** what the sinks recorded, for one seed.
        """
        sinks = [placed for placed in self.plan.blocks if isinstance(placed.block, Sink)]
        ports = {
            address_of(placed, name): (placed.ticks, port)
            for placed in sinks
            for name, port in placed.block.inputs.items()
        }
        seen: dict[str, list[np.ndarray]] = {address: [] for address in ports}
        first, every = self.tick, {address: spacing for address, (spacing, _) in ports.items()}
        for _ in range(ticks):
            for address, value in self._advance().items():
                seen[address].append(value)
        signals = {}
        for address, (_, port) in ports.items():
            signals[address] = np.array(seen[address], port.dtype).reshape(1, -1, *port.shape)
        return Record(first, ticks, self.plan.tick, signals, every)

    def __getitem__(self, address: str) -> Any:
        """The current value of a parameter, by its address `"block.parameter"`."""
        return self._parameters[address]

    def __setitem__(self, address: str, value: Any) -> None:
        """Set a parameter, from the next tick on."""
        self._parameters[address] = value
        self._bind()

    @property
    def state(self) -> State:
        """As `Run.state`, for one seed."""
        state = State(tick=self.tick, blocks={}, parameters=self._parameters.by_block(), hosts={}, last={})
        for i, placed in enumerate(self.plan.blocks):
            if isinstance(placed.block, HostBlock):
                if placed.block.no_restore is not None:
                    raise ValueError(f"{placed.path}: cannot be saved: {placed.block.no_restore}")
                state["hosts"][placed.identity] = self._states[i].snapshot()
                if self.tick:
                    state["last"][placed.identity] = self._kept(i)
                continue
            own = {"state": _lead(self._states[i]), "held": self._kept(i) if placed.ticks > 1 else {}}
            if jax.tree.leaves(own):
                state["blocks"][placed.identity] = own
        return state

    def restore(self, state: State) -> None:
        """As `Run.restore`."""
        check_state(state, self.state)
        self._parameters.restore(state["parameters"])
        self._bind()
        self.tick = int(state["tick"])
        for i, placed in enumerate(self.plan.blocks):
            if isinstance(placed.block, HostBlock):
                self._states[i].restore(state["hosts"][placed.identity])
                kept = state["last"].get(placed.identity, {})
            else:
                own = state["blocks"].get(placed.identity, {"state": (), "held": {}})
                self._states[i] = jax.tree.map(lambda x: jnp.array(x[0]), own["state"])
                kept = own["held"]
            self._values |= {(i, name): jnp.array(value[0]) for name, value in kept.items()}

    def _bind(self) -> None:
        """Bind the current parameters to the blocks."""
        self._blocks = [
            placed.block.bound({name: jnp.asarray(value) for name, value in self._parameters.arrays(i).items()})
            for i, placed in enumerate(self.plan.blocks)
        ]

    def _kept(self, i: int) -> dict[str, np.ndarray]:
        """The held outputs of a block, which are zero before the first tick."""
        ports = self.plan.blocks[i].block.outputs
        return {n: np.array(self._values.get((i, n), jnp.zeros(p.shape, p.dtype)))[None] for n, p in ports.items()}

    def _advance(self) -> dict[str, np.ndarray]:
        """One tick: outputs in order, then the new states."""
        time = self.tick * self.plan.tick
        for i in self.plan.order:
            if self._due(i):
                self._evaluate(i, self._values, self._states[i], time)
        record = {}
        for i, block in enumerate(self._blocks):
            if isinstance(block, Sink) and self._due(i):
                inputs = self._inputs(i, self._values)
                record |= {address_of(self.plan.blocks[i], port): np.asarray(v) for port, v in inputs.items()}
        ends = self._integrated()
        for i, block in enumerate(self._blocks):
            if not self._due(i):
                continue
            inputs, now = self._inputs(i, self._values), self._now(i, time)
            if isinstance(block, HostBlock):
                self._states[i].update(block, _rows(inputs), _host_moment(self.tick, now))
            else:
                after = block.update(ends.get(i, self._states[i]), inputs, now)
                self._states[i] = jax.tree.map(lambda new, old: jnp.asarray(new, old.dtype), after, self._states[i])
        self.tick += 1
        return record

    def _integrated(self) -> dict[int, Any]:
        """The continuous states at the end of the tick: RK4 on the moving blocks, with all others held."""
        movers = {i: self._states[i] for i, block in enumerate(self._blocks) if block.is_continuous}
        step = self.plan.tick / self.plan.substeps
        for substep in range(self.plan.substeps if movers else 0):
            time = self.tick * self.plan.tick + substep * step
            movers = integrated(self._slopes, self._next_jump if self._jumping else None, movers, time, step, _while)
        return movers

    def _slopes(self, movers: dict[int, Any], time: float, start: float) -> dict[int, Any]:
        values = dict(self._values)
        for i in self.plan.order:
            if i in self.plan.moving:
                self._evaluate(i, values, movers.get(i, self._states[i]), time, start)
        return {
            i: self._blocks[i].derivative(state, self._inputs(i, values), self._now(i, time, start))
            for i, state in movers.items()
        }

    def _next_jump(self, time: float) -> float:
        return min(float(self._blocks[i].next_jump(self._now(i, time))) for i in self._jumping)

    def _evaluate(self, i: int, values: Values, state: Any, time: float, start: float | None = None) -> None:
        block, ports = self._blocks[i], self.plan.blocks[i].block.outputs
        inputs, now = self._inputs(i, values, feedthrough=True), self._now(i, time, start)
        if isinstance(block, HostBlock):
            given = self._host(i).output(block, _rows(inputs), _host_moment(self.tick, now))
            given = {name: value[0] for name, value in given.items()}
        else:
            given = block.output(state, inputs, now)
        for name, port in ports.items():
            value = jnp.asarray(given[name])
            values[i, name] = value if value.dtype == port.dtype else value.astype(port.dtype)

    def _host(self, i: int) -> Host:
        return self._states[i]

    def _inputs(self, i: int, values: Values, feedthrough: bool = False) -> dict[str, Any]:
        placed = self.plan.blocks[i]
        return {
            name: self._read(placed.sources.get(name), port, values)
            for name, port in placed.block.inputs.items()
            if port.feedthrough or not feedthrough
        }

    @staticmethod
    def _read(source: Any, port: Port, values: Values) -> Any:
        if source is None:
            return jnp.full(port.shape, port.default or 0.0, port.dtype)
        value = values[source.block, source.port]
        return value if value.dtype == port.dtype else value.astype(port.dtype)

    def _due(self, i: int) -> bool:
        return self.tick % self.plan.blocks[i].ticks == 0

    def _now(self, i: int, time: float, start: float | None = None) -> Moment:
        start = time if start is None else start
        if self._clock[0] != (self.tick, time, start):  # shared by all blocks: making small arrays is slow
            seconds = (jnp.asarray(each, jnp.result_type(float)) for each in (time, start))
            self._clock = (self.tick, time, start), jnp.uint32(self.tick), *seconds
        _, tick, now, begun = self._clock
        return Moment(tick, now, self._steps[i], self._uniforms(i), begun)

    def _uniforms(self, i: int) -> Any:
        span, size = self.tick // SPAN, self._blocks[i].uniforms
        if size == 0:
            return self._none
        if self._drawn.get(i, (None, None))[0] != span:
            self._drawn[i] = span, np.asarray(draw_span(self.seed, self.plan.blocks[i].stream, span, size))
        return jnp.asarray(self._drawn[i][1][self.tick % SPAN])


def _while(condition: Any, body: Any, value: Any) -> Any:
    """`jax.lax.while_loop`, uncompiled."""
    while condition(value):
        value = body(value)
    return value


def _lead(tree: Any) -> Any:
    """Add a leading axis for the one seed."""
    return jax.tree.map(lambda x: np.array(x)[None], tree)


def _rows(inputs: dict[str, Any]) -> dict[str, np.ndarray]:
    return {name: np.array(value)[None] for name, value in inputs.items()}


def _host_moment(tick: int, now: Moment) -> HostMoment:
    return HostMoment(tick, float(now.time), float(now.step), np.asarray(now.uniforms)[None])
