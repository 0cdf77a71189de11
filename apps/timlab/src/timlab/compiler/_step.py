"""One tick as pure functions of one seed, with all blocks of a kind evaluated together, and its random numbers."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._random import BLOCK as SPAN
from motorgrad._random import key_of
from timlab.compiler._continuous import Continuous
from timlab.compiler._faults import Fault, finite, no_fault
from timlab.compiler._loops import solved
from timlab.compiler._plan import is_mode
from timlab.compiler._stack import Environment, Gather, Kind, Stacks
from timlab.diagram import Block, HostBlock, Moment, Sink, clock, crossings_of

__all__ = ["SPAN", "draw_span", "draw_start"]
START = 0xFFFFFFFF  # no span of ticks has this index


def draw_span(seed: Any, stream: Any, span: Any, size: int) -> Float[Array, "ticks size"]:
    """The U[0, 1) numbers of a block for `SPAN` consecutive ticks, `size` per tick.

    They depend on the seed, the block's stream and the span alone. A block whose id names a purpose in training gets
    the numbers that training gives that purpose.
    """
    return _uniform(jax.random.fold_in(key_of(seed, stream), span), (SPAN, size))


def draw_start(seed: Any, stream: Any, size: int) -> Float[Array, " size"]:
    """The numbers that a block's `init` consumes."""
    if size == 0:
        return jnp.zeros(0)
    return _uniform(jax.random.fold_in(key_of(seed, stream), jnp.uint32(START)), (size,))


def _uniform(key: Any, shape: tuple[int, ...]) -> Array:
    """U[0, 1) numbers of 24 bits, the same in every precision."""
    return jax.random.uniform(key, shape, jnp.float32).astype(jnp.result_type(float))


Numbers = dict[int, Array]
"""By kind: numbers from U[0, 1), one row per block."""
Values = Mapping[int, Mapping[str, Any]]
"""By kind: the parameters by name; rows lead."""
ROWS: Any = Moment(None, None, 0, 0, None, None, None, 0, 0, None, 0)  # type: ignore[arg-type]  # what differs between rows


class Carry(NamedTuple):
    """What is carried from tick to tick, by kind; rows lead."""

    states: dict[int, Any]
    held: dict[int, dict[str, Array]]
    above: dict[int, Array]
    """Which zero crossings count as not negative."""
    pace: dict[str, Array]
    """`"step"`, the length of the next step of a solver that adapts it, in seconds; 0 before the first."""
    shares: dict[int, Array]
    """For crossings that may be held: the share of the present mode, −1 where it is not held."""
    fault: Fault
    """What kept the last tick from being computed, with a solver that adapts its steps."""


class Step:
    """The functions of a tick."""

    def __init__(self, stacks: Stacks):
        self.stacks, self.kinds, self.plan = stacks, stacks.kinds, stacks.plan
        self.pure = [k for k, kind in enumerate(self.kinds) if not isinstance(kind.block, HostBlock)]
        self.sinks = [k for k in self.pure if isinstance(self.kinds[k].block, Sink)]
        self.chance = [k for k, kind in enumerate(self.kinds) if kind.block.uniforms]
        self.movers = [k for k in self.pure if self.kinds[k].block.is_continuous]
        self.jumping = [k for k in self.pure if self.kinds[k].moving and self.kinds[k].block.jumps]
        self.modes = [k for k in self.pure if self.kinds[k].moving and is_mode(self.kinds[k].block)]
        self.crossings = {k: crossings_of(self.kinds[k].block) for k in self.pure if self._crosses(self.kinds[k])}
        self.crossings = {k: number for k, number in self.crossings.items() if number}
        self.adapts = self.plan.solver.adapts and len(self.movers) > 0
        switching = [k for k in self.crossings if self.kinds[k].block.switches] if self.adapts else []
        self.holding = [k for k in switching if range(self.crossings[k])[self.kinds[k].block.slides]]
        """The kinds with crossings that may be held."""
        updating = [k for k in self.pure if type(self.kinds[k].block).update is not Block.update]
        self._updating = [k for k in updating if k not in self.modes]
        self._streams = [np.array([self._placed(i).stream for i in kind.members], np.uint32) for kind in self.kinds]
        self._ticks = [np.array([self._placed(i).ticks for i in kind.members], np.uint32) for kind in self.kinds]
        self._wires = [self._gathers(k, kind.members) for k, kind in enumerate(self.kinds)]
        torn = self.plan.torn
        self.torn = [b for b, batch in enumerate(stacks.batches) if self.kinds[batch.kind].members[batch.start] in torn]
        """The batches whose outputs are found by iteration."""
        self._direct = [
            {
                name: gather
                for name, gather in self._gathers(b.kind, self.kinds[b.kind].members[b.start : b.stop]).items()
                if gather.port.feedthrough
            }
            for b in stacks.batches
        ]

    def init(self, values: Values, seed: Any) -> Carry:
        """The state before the first tick."""
        states = {}
        held = {}
        for k in self.pure:
            block = self.kinds[k].block
            rows = len(self.kinds[k].members)
            draw = jax.vmap(lambda stream, size=block.init_uniforms: draw_start(seed, stream, size))
            fresh = jax.vmap(lambda v, u, block=block: block.bound(v).init(u))(values[k], draw(self._streams[k]))
            states[k] = jax.tree.map(lambda x: jax.lax.convert_element_type(x, x.dtype), fresh)
            if self.kinds[k].held:
                held[k] = {name: jnp.zeros((rows, *port.shape), port.dtype) for name, port in block.outputs.items()}
        above = {k: jnp.zeros((len(self.kinds[k].members), number), bool) for k, number in self.crossings.items()}
        shares = {k: jnp.full(above[k].shape, -1, jnp.result_type(float)) for k in self.holding}
        pace, fault = ({"step": jnp.zeros(())}, no_fault(bool(self.crossings))) if self.adapts else ({}, {})
        return Carry(states, held, above, pace, shares, fault)

    def numbers(self, seed: Any, span: Any) -> Numbers:
        """The random numbers of a span of ticks, by kind: `(ticks, rows, size)`."""

        def draw(k: int) -> Array:
            size = self.kinds[k].block.uniforms
            return jax.vmap(lambda stream: draw_span(seed, stream, span, size), 0, 1)(self._streams[k])

        return {k: draw(k) for k in self.chance}

    def outputs(
        self, batches: Iterable[int], values: Values, carry: Carry, tick: Any, numbers: Numbers, before: Environment
    ) -> Environment:
        """The outputs of these batches, added to those `before` them."""
        batches = list(batches)

        def evaluate(environment: Environment) -> Environment:
            return self._outputs(batches, values, carry, tick, numbers, environment)

        guess = {b: carry.held[self.stacks.batches[b].kind] for b in self.torn if b in batches}
        return self.consistent(evaluate, before, guess)

    def consistent(self, evaluate: Any, before: Environment, guess: dict[int, dict[str, Array]]) -> Environment:
        """The environment that `evaluate` makes of the one `before`, with `guess` for the outputs of torn batches; and
        where there are any, such that it agrees with the guess.
        """
        if not guess:
            return evaluate(before)
        given = lambda guess: [guess.get(b, outputs) for b, outputs in enumerate(before)]  # noqa: E731
        return solved(lambda guess: evaluate(given(guess)), lambda after: {b: after[b] for b in guess}, guess)

    def _outputs(
        self, batches: list[int], values: Values, carry: Carry, tick: Any, numbers: Numbers, before: Environment
    ) -> Environment:
        environment = list(before)
        for b in batches:
            k, rows = self._rows(b)
            now = self.now(k, tick, numbers)._replace(shares=carry.shares.get(k))
            given = self.output(b, values, carry.states[k], now, environment)
            if self.kinds[k].held:
                due = self._due(k, tick)[rows]
                kept = carry.held[k]
                given = {name: _where(due, new, kept[name][rows]) for name, new in given.items()}
            environment[b] = given
        return environment

    def finish(self, values: Values, carry: Carry, tick: Any, numbers: Numbers, environment: Environment) -> Carry:
        """The state after the tick, given all outputs."""
        states = dict(carry.states)
        above = carry.above
        pace = carry.pace
        shares = carry.shares
        fault = carry.fault
        if self.movers:
            system = Continuous(self, values, carry, tick, numbers, environment)
            moved, above, shares, pace, fault = system.advanced()
            states |= moved
        for k in self._updating:
            now = self.now(k, tick, numbers)
            after = self.apply("update", k, values[k], states[k], self.inputs(k, environment), now)
            after = jax.tree.map(lambda new, old: new.astype(old.dtype), after, states[k])
            if self.kinds[k].held:
                due = self._due(k, tick)
                after = jax.tree.map(lambda new, old, due=due: _where(due, new, old), after, states[k])
            states[k] = after
        held = {k: self._all_outputs(k, environment) for k in carry.held}
        return Carry(states, held, above, pace, shares, fault)

    def finite(self, tree: Any) -> Array:
        """Whether all numbers are finite, for each leaf of floats in a tree."""
        return jnp.stack([jnp.asarray(True), *finite(tree)])

    def changes(self, values: Values, carry: Carry, tick: Any, seed: Any, within: Any) -> tuple[Any, Any]:
        """The time derivative of the continuous state `within` seconds of a tick, and the levels of the crossings."""
        numbers = {k: drawn[tick % SPAN] for k, drawn in self.numbers(seed, tick // SPAN).items()}
        environment = self.outputs(range(len(self.stacks.batches)), values, carry, tick, numbers, self.empty())
        return Continuous(self, values, carry, tick, numbers, environment).changes_at(within)

    def signals(self, values: Values, carry: Carry, tick: Any, seed: Any, within: Any, hosts: Any) -> Environment:
        """The outputs of all batches `within` seconds of a tick; those of `hosts` are given, by kind."""
        numbers = {k: drawn[tick % SPAN] for k, drawn in self.numbers(seed, tick // SPAN).items()}
        environment = self.empty()
        batches = self.stacks.batches
        for b in range(len(batches)) if hosts else ():
            given = hosts.get(batches[b].kind)
            if given is None:
                environment = self.outputs([b], values, carry, tick, numbers, environment)
            else:
                environment[b] = {name: jnp.asarray(value)[None] for name, value in given.items()}
        if not hosts:
            environment = self.outputs(range(len(batches)), values, carry, tick, numbers, environment)
        if not self.adapts:
            return environment
        there = Continuous(self, values, carry, tick, numbers, environment).outputs_at(within)
        return jax.tree.map(lambda a, b: jnp.where(within > 0, a, b), there, environment)

    def recorded(self, environment: Environment) -> dict[int, dict[str, Array]]:
        """The values at the sinks' inputs, by kind; rows lead."""
        return {k: self.inputs(k, environment) for k in self.sinks}

    def recorded_shapes(self, seeds: int) -> dict[int, dict[str, jax.ShapeDtypeStruct]]:
        """Shapes and dtypes of what the sinks record per tick, for all seeds, which come last."""
        return {
            k: {
                name: jax.ShapeDtypeStruct((len(self.kinds[k].members), *port.shape, seeds), port.dtype)
                for name, port in self.kinds[k].block.inputs.items()
            }
            for k in self.sinks
        }

    def empty(self) -> Environment:
        """The environment before any output is known."""
        return [{} for _ in self.stacks.batches]

    def host_inputs(self, k: int, environment: Environment, feedthrough: bool) -> dict[str, Array]:
        """The values at a host block's inputs: at those with feedthrough, or at all."""
        wires = {name: g for name, g in self._wires[k].items() if g.port.feedthrough or not feedthrough}
        return {name: gather(environment)[0] for name, gather in wires.items()}

    def output(self, b: int, values: Values, states: Any, now: Moment, environment: Environment) -> dict[str, Array]:
        """The outputs of a batch."""
        k, rows = self._rows(b)
        inputs = {name: gather(environment) for name, gather in self._direct[b].items()}
        own, state = jax.tree.map(lambda x: x[rows], (dict(values[k]), states))
        above, shares = (None if each is None else each[rows] for each in (now.above, now.shares))
        now = now._replace(step=now.step[rows], uniforms=now.uniforms[rows], above=above, shares=shares)
        given = self.apply("output", k, own, state, inputs, now)
        return {name: given[name].astype(port.dtype) for name, port in self.kinds[k].block.outputs.items()}

    def apply(self, name: str, k: int, values: Any, state: Any, inputs: Any, now: Moment) -> Any:
        """One of the functions of a kind of blocks, for all rows."""
        block = self.kinds[k].block
        function = jax.vmap(lambda v, s, u, n: getattr(block.bound(v), name)(s, u, n), in_axes=(0, 0, 0, ROWS))
        return function(values, state, inputs, now)

    def inputs(self, k: int, environment: Environment) -> dict[str, Array]:
        """The values at all inputs of a kind."""
        return {name: gather(environment) for name, gather in self._wires[k].items()}

    def _all_outputs(self, k: int, environment: Environment) -> dict[str, Array]:
        batches = [b for b, batch in enumerate(self.stacks.batches) if batch.kind == k]
        return {name: jnp.concatenate([environment[b][name] for b in batches]) for name in self.kinds[k].block.outputs}

    def _gathers(self, k: int, members: Iterable[int]) -> dict[str, Gather]:
        rows = tuple(members)
        return {name: Gather(self.stacks, rows, name, port) for name, port in self.kinds[k].block.inputs.items()}

    def _rows(self, b: int) -> tuple[int, slice]:
        batch = self.stacks.batches[b]
        return batch.kind, slice(batch.start, batch.stop)

    def _placed(self, i: int) -> Any:
        return self.plan.blocks[i]

    def now(
        self, k: int, tick: Any, numbers: Numbers, within: Any = 0.0, start: Any = None, above: Any = None
    ) -> Moment:
        """The moment `within` seconds of the tick, for all rows of a kind."""
        rows = len(self.kinds[k].members)
        real = jnp.result_type(float)
        step = jnp.asarray(self._ticks[k] * self.plan.tick, real)
        time, rest = clock(tick, self.plan.tick, within)
        begins = within if start is None else start
        began = time if start is None else clock(tick, self.plan.tick, start)[0]
        within, begins = (jnp.asarray(each, real) for each in (within, begins))
        own = numbers.get(k, jnp.zeros((rows, 0)))
        return Moment(tick, time, step, own, began, rest, within, above, begun=begins)

    def _crosses(self, kind: Kind) -> bool:
        """Whether zero crossings of a kind matter: fixed steps look for them at ticks, to change continuous states."""
        adapts = self.plan.solver.adapts and len(self.movers) > 0
        return kind.moving and (adapts or (kind.block.is_continuous and kind.block.switches))

    def _due(self, k: int, tick: Any) -> Array:
        return tick % self._ticks[k] == 0


def _where(due: Array, new: Array, old: Array) -> Array:
    return jnp.where(due.reshape(due.shape + (1,) * (new.ndim - 1)), new, old)
