"""The reference implementation: a diagram run one block at a time, uncompiled. Compiled runs must agree with it."""

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.flatten_util import ravel_pytree

from motorgrad._arguments import check_arguments
from timlab.compiler import (
    LOST,
    NONE,
    SPAN,
    Plan,
    address_of,
    draw_span,
    draw_start,
    is_mode,
    plan,
    root,
    stack,
    with_watched,
)
from timlab.diagram import (
    Block,
    Diagram,
    HostBlock,
    HostMoment,
    Moment,
    Port,
    Record,
    Sink,
    clock,
    crossings_of,
    sampled,
)
from timlab.engine._fault import RunFault, finite, limit_reached, not_finite, worst
from timlab.engine._parameters import Parameters
from timlab.engine._state import State, check_state, precisely
from timlab.engine._tick import Tick, while_loop

Values = dict[tuple[int, str], Any]


class Interpreter:
    """One seed of a diagram, run without compilation: slow, but ready at once after an edit.

    It has the interface of a `Run`, and their states are interchangeable.

    **Arguments:** the diagram; the seed; outputs to `watch`, as for a `Run`. `signals` has every output of the last
    tick by address, `"block.port"`.
    """

    def __init__(self, diagram: Diagram, seed: int = 0, watch: Sequence[str] = ()):
        check_arguments(Interpreter, locals())
        self.plan: Plan = with_watched(plan(diagram), watch)
        self.seed = seed
        self.tick = 0
        self._begin()

    @precisely
    def _begin(self) -> None:
        self._parameters = Parameters(stack(self.plan, stacked=False), {}, 1)
        self.blocks: list[Block] = []
        self._bind()
        self.values: Values = {}
        self._clock: tuple[Any, ...] = (None,)
        self._none = jnp.zeros(0)
        moving = sorted(self.plan.moving)
        adapts = self.plan.solver.adapts
        continuous = any(block.is_continuous for block in self.blocks)
        self.jumping = [i for i in moving if self.blocks[i].jumps]
        self.modes = [i for i in moving if is_mode(self.blocks[i])]
        watched = [i for i in moving if adapts or (self.blocks[i].is_continuous and self.blocks[i].switches)]
        numbers = {i: crossings_of(self.plan.blocks[i].block) for i in watched if continuous}
        self.above = {i: jnp.zeros(number, bool) for i, number in numbers.items() if number}
        """Which zero crossings count as not negative, by block."""
        switching = [i for i in self.above if adapts and self.blocks[i].switches]
        holding = [i for i in switching if range(self.above[i].size)[self.blocks[i].slides]]
        self.shares = {i: jnp.full(self.above[i].shape, -1, jnp.result_type(float)) for i in holding}
        """For crossings that may be held: the share of the present mode, −1 where it is not held; by block."""
        self.fault: Any = {}
        self._goes_on = False
        """Whether it went on after a fault."""
        self.pace = {"step": jnp.zeros(())} if adapts and continuous else {}
        self._steps = [jnp.asarray(p.ticks * self.plan.tick, jnp.result_type(float)) for p in self.plan.blocks]
        self._drawn: dict[int, tuple[int, np.ndarray]] = {}
        self.states: list[Any] = []
        for block, placed in zip(self.blocks, self.plan.blocks, strict=True):
            uniforms = draw_start(self.seed, placed.stream, block.init_uniforms)
            if isinstance(block, HostBlock):
                self.states.append(block.start(np.array([self.seed]), np.asarray(uniforms)[None], 1))
            else:
                self.states.append(jax.tree.map(jnp.asarray, block.init(uniforms)))

    @property
    def signals(self) -> dict[str, np.ndarray]:
        return {f"{self.plan.blocks[i].path}.{port}": np.asarray(v) for (i, port), v in self.values.items()}

    @precisely
    def advance(self, ticks: int) -> Record:
        """Run a number of ticks.

        **Returns** what the sinks recorded, for one seed. **Raises** `RunFault` as `Run.advance` does; it is then at
        the tick after.
        """
        sinks = [placed for placed in self.plan.blocks if isinstance(placed.block, Sink)]
        ports = {
            address_of(placed, name): (placed.ticks, port)
            for placed in sinks
            for name, port in placed.block.inputs.items()
        }
        seen: dict[str, list[np.ndarray]] = {address: [] for address in ports}
        first = self.tick
        every = {address: spacing for address, (spacing, _) in ports.items()}

        def record(made: int) -> Record:
            signals = {}
            for address, (spacing, port) in ports.items():
                values = seen[address][: len(sampled(first, made, spacing))]
                signals[address] = np.array(values, port.dtype).reshape(1, -1, *port.shape)
            return Record(first, made, self.plan.tick, signals, every)

        for made in range(ticks):
            before = list(self.states)
            for address, value in self._advance().items():
                seen[address].append(value)
            fault = None if self._goes_on else self._fault(before)
            if fault is not None and self.plan.on_fault == "stop":
                fault.record = record(made)
                raise fault
            if fault is not None:
                self._goes_on = True
                warnings.warn(str(fault.problem), RuntimeWarning, stacklevel=3)
        return record(ticks)

    def _fault(self, before: list[Any]) -> RunFault | None:
        """What was not sound in the last tick, given the states before it."""
        tick = self.tick - 1
        kind = int(self.fault["kind"]) if self.fault else NONE
        within = float(self.fault["within"]) if kind else 0.0
        if kind not in (NONE, LOST):
            system = Tick(self)
            own = {i: self.states[i] for i in Tick(self).movers}
            block = worst(kind, system.owners, own, *system.changes_at(within))
            return limit_reached(self.plan, kind, block, tick, within, self.seed, False)
        hosts = {i for i, block in enumerate(self.blocks) if isinstance(block, HostBlock)}
        states = {i: (before[i], self.states[i]) for i in range(len(self.blocks)) if i not in hosts}
        states = {i: pair for i, pair in states.items() if finite(pair[0])}
        signals = self.signals
        if kind == LOST:
            signals = Tick(self).signals_at(within)
        elif finite(signals) and all(finite(after) for _, after in states.values()):
            return None
        return not_finite(self.plan, signals, states, tick, within, self.seed, False)

    def __getitem__(self, address: str) -> Any:
        """The current value of a parameter, by its address `"block.parameter"`."""
        return self._parameters[address]

    @precisely
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
                state["hosts"][placed.identity] = self.states[i].snapshot()
                if self.tick:
                    state["last"][placed.identity] = self._kept(i)
                continue
            kept = placed.ticks > 1 or i in self.plan.torn
            own = {"state": _lead(self.states[i]), "held": self._kept(i) if kept else {}}
            own |= {"above": _lead(self.above[i])} if i in self.above else {}
            own |= {"shares": _lead(self.shares[i])} if i in self.shares else {}
            if jax.tree.leaves(own):
                state["blocks"][placed.identity] = own
        return state | ({"pace": _lead(self.pace)} if self.pace else {})

    @precisely
    def restore(self, state: State) -> None:
        """As `Run.restore`."""
        check_state(state, self.state)
        self._parameters.restore(state["parameters"])
        self._bind()
        self.tick = int(state["tick"])
        for i, placed in enumerate(self.plan.blocks):
            if isinstance(placed.block, HostBlock):
                self.states[i].restore(state["hosts"][placed.identity])
                kept = state["last"].get(placed.identity, {})
            else:
                own = state["blocks"].get(placed.identity, {"state": (), "held": {}})
                self.states[i] = jax.tree.map(lambda x: jnp.array(x[0]), own["state"])
                kept = own["held"]
                if i in self.above:
                    self.above[i] = jnp.array(own["above"][0])
                if i in self.shares:
                    self.shares[i] = jnp.array(own["shares"][0])
            self.values |= {(i, name): jnp.array(value[0]) for name, value in kept.items()}
        self.pace = {name: jnp.array(state["pace"][name][0]) for name in self.pace}

    def _bind(self) -> None:
        """Bind the current parameters to the blocks."""
        self.blocks = [
            placed.block.bound({name: jnp.asarray(value) for name, value in self._parameters.arrays(i).items()})
            for i, placed in enumerate(self.plan.blocks)
        ]

    def _kept(self, i: int) -> dict[str, np.ndarray]:
        """The held outputs of a block, which are zero before the first tick."""
        ports = self.plan.blocks[i].block.outputs
        return {n: np.array(self.values.get((i, n), jnp.zeros(p.shape, p.dtype)))[None] for n, p in ports.items()}

    def _advance(self) -> dict[str, np.ndarray]:
        """One tick: outputs in order, then the new states."""
        due = [i for i in self.plan.order if self._due(i)]

        def evaluate(values: Values) -> None:
            for i in due:
                now = self.now(i)._replace(shares=self.shares.get(i))
                self.evaluate(i, values, self.states[i], now)

        self.settle(self.values, evaluate, [i for i in due if i in self.plan.torn])
        record = {}
        for i, block in enumerate(self.blocks):
            if isinstance(block, Sink) and self._due(i):
                inputs = self.inputs(i, self.values)
                record |= {address_of(self.plan.blocks[i], port): np.asarray(v) for port, v in inputs.items()}
        ends, self.above = Tick(self).advance()
        for i, block in enumerate(self.blocks):
            if not self._due(i):
                continue
            inputs = self.inputs(i, self.values)
            if isinstance(block, HostBlock):
                self.states[i].update(block, _rows(inputs), self._host_moment(i))
            else:
                after = ends[i] if i in self.modes else block.update(ends.get(i, self.states[i]), inputs, self.now(i))
                self.states[i] = jax.tree.map(lambda new, old: jnp.asarray(new, old.dtype), after, self.states[i])
        self.tick += 1
        return record

    def evaluate(self, i: int, values: Values, state: Any, now: Moment) -> None:
        """Compute the outputs of a block from those of others."""
        block = self.blocks[i]
        ports = self.plan.blocks[i].block.outputs
        inputs = self.inputs(i, values, feedthrough=True)
        if isinstance(block, HostBlock):
            given = self.states[i].output(block, _rows(inputs), self._host_moment(i))
            given = {name: value[0] for name, value in given.items()}
        else:
            given = block.output(state, inputs, now)
        for name, port in ports.items():
            value = jnp.asarray(given[name])
            values[i, name] = value if value.dtype == port.dtype else value.astype(port.dtype)

    def settle(self, values: Values, evaluate: Callable[[Values], None], torn: list[int]) -> None:
        """Evaluate blocks, updating `values`, such that the outputs of the `torn` ones agree with what was read of
        them.
        """
        ports = {f"{i}.{n}": ((i, n), p) for i in torn for n, p in self.plan.blocks[i].block.outputs.items()}
        if not ports:
            return evaluate(values)
        kept = {name: values.get(key, jnp.zeros(port.shape, port.dtype)) for name, (key, port) in ports.items()}
        guess, unravel = ravel_pytree(kept)

        def after(guess: Any) -> Values:
            there = values | {ports[name][0]: value for name, value in unravel(guess).items()}
            evaluate(there)
            return there

        def residual(guess: Any) -> Any:
            there = after(guess)
            return ravel_pytree({name: there[key] for name, (key, _) in ports.items()})[0] - guess

        x, found = root(residual, jnp.where(jnp.isfinite(guess), guess, 0.0), while_loop)
        values |= after(jnp.where(found, x, jnp.nan))
        return None

    def _host_moment(self, i: int) -> HostMoment:
        """The moment for a host, as compiled runs have it: its time does not depend on the precision of signals."""
        length = self.plan.tick
        ticks = self.plan.blocks[i].ticks
        return HostMoment(self.tick, self.tick * length, ticks * length, np.asarray(self._uniforms(i))[None])

    def inputs(self, i: int, values: Values, feedthrough: bool = False) -> dict[str, Any]:
        """The values at a block's inputs: at those with feedthrough, or at all."""
        placed = self.plan.blocks[i]
        return {
            name: self._read(placed.sources.get(name), port, values)
            for name, port in placed.block.inputs.items()
            if port.feedthrough or not feedthrough
        }

    @staticmethod
    def _read(source: Any, port: Port, values: Values) -> Any:
        if source is None:
            return port.unwired()
        value = values[source.block, source.port]
        return value if value.dtype == port.dtype else value.astype(port.dtype)

    def _due(self, i: int) -> bool:
        return self.tick % self.plan.blocks[i].ticks == 0

    def now(self, i: int, within: Any = 0.0, start: Any = None, above: Any = None) -> Moment:
        """The moment `within` seconds of the tick, for a block."""
        traced = isinstance(within, Tracer)  # where the solver differentiates by time
        key = None if traced else (self.tick, float(within), None if start is None else float(start))
        if traced or self._clock[0] != key:  # shared by all blocks: making small arrays is slow
            tick = jnp.uint32(self.tick)
            time, rest = clock(tick, self.plan.tick, within)
            began = time if start is None else clock(tick, self.plan.tick, start)[0]
            begins = within if start is None else start
            seconds = (jnp.asarray(each, time.dtype) for each in (within, begins))
            self._clock = key, tick, time, began, rest, *seconds
        _, tick, time, began, rest, within, begins = self._clock
        return Moment(tick, time, self._steps[i], self._uniforms(i), began, rest, within, above, begun=begins)

    def _uniforms(self, i: int) -> Any:
        span = self.tick // SPAN
        size = self.blocks[i].uniforms
        if size == 0:
            return self._none
        if self._drawn.get(i, (None, None))[0] != span:
            self._drawn[i] = span, np.asarray(draw_span(self.seed, self.plan.blocks[i].stream, span, size))
        return jnp.asarray(self._drawn[i][1][self.tick % SPAN])


def _lead(tree: Any) -> Any:
    """Add a leading axis for the one seed."""
    return jax.tree.map(lambda x: np.array(x)[None], tree)


def _rows(inputs: dict[str, Any]) -> dict[str, np.ndarray]:
    return {name: np.array(value)[None] for name, value in inputs.items()}
