"""The reference implementation: a diagram run one block at a time, uncompiled. Compiled runs must agree with it."""

import warnings
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._arguments import check_arguments
from timlab.compiler import LOST, NONE, address_of, plan, with_watched
from timlab.diagram import Diagram, Host, HostBlock, Record, Sink, sampled
from timlab.engine._blocks import Blocks, Values, rows_of
from timlab.engine._fault import RunFault, finite, limit_reached, not_finite, worst
from timlab.engine._state import State, check_state, precisely
from timlab.engine._tick import Tick


class Interpreter(Blocks):
    """One seed of a diagram, run without compilation: slow, but ready at once after an edit.

    It has the interface of a `Run`, and their states are interchangeable.

    **Arguments:** the diagram; the seed; outputs to `watch`, as for a `Run`. `signals` has every output of the last
    tick by address, `"block.port"`.
    """

    def __init__(self, diagram: Diagram, seed: int = 0, watch: Sequence[str] = ()):
        check_arguments(Interpreter, locals())
        super().__init__(with_watched(plan(diagram), watch), seed)
        self._goes_on = False
        """Whether it went on after a fault."""

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

    def _fault(self, before: list[PyTree[Array] | Host]) -> RunFault | None:
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
    def __setitem__(self, address: str, value: object) -> None:
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

    def _kept(self, i: int) -> dict[str, np.ndarray]:
        """The held outputs of a block, which are zero before the first tick."""
        ports = self.plan.blocks[i].block.outputs
        return {n: np.array(self.values.get((i, n), jnp.zeros(p.shape, p.dtype)))[None] for n, p in ports.items()}

    def _advance(self) -> dict[str, np.ndarray]:
        """One tick: outputs in order, then the new states."""
        due = [i for i in self.plan.order if self.due(i)]

        def evaluate(values: Values) -> None:
            for i in due:
                now = self.now(i)._replace(shares=self.shares.get(i))
                self.evaluate(i, values, self.states[i], now)

        self.settle(self.values, evaluate, [i for i in due if i in self.plan.torn])
        record = {}
        for i, block in enumerate(self.blocks):
            if isinstance(block, Sink) and self.due(i):
                inputs = self.inputs(i, self.values)
                record |= {address_of(self.plan.blocks[i], port): np.asarray(v) for port, v in inputs.items()}
        ends, self.above = Tick(self).advance()
        for i, block in enumerate(self.blocks):
            if not self.due(i):
                continue
            inputs = self.inputs(i, self.values)
            if isinstance(block, HostBlock):
                self.states[i].update(block, rows_of(inputs), self.host_moment(i))
            else:
                after = ends[i] if i in self.modes else block.update(ends.get(i, self.states[i]), inputs, self.now(i))
                self.states[i] = jax.tree.map(lambda new, old: jnp.asarray(new, old.dtype), after, self.states[i])
        self.tick += 1
        return record


def _lead(tree: PyTree[Array]) -> PyTree[np.ndarray]:
    """Add a leading axis for the one seed."""
    return jax.tree.map(lambda x: np.array(x)[None], tree)
