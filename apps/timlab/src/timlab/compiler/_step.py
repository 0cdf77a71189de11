"""One tick as pure functions of one seed, with all blocks of a kind evaluated together, and its random numbers."""

import math
from collections.abc import Iterable, Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from motorgrad._random import BLOCK as SPAN
from motorgrad._random import from_bits, key_of, threefry
from timlab.compiler._continuous import Continuous
from timlab.compiler._evaluation import Carry, Evaluation, Numbers, States, Values
from timlab.compiler._faults import no_fault
from timlab.compiler._stack import Environment, Stacks
from timlab.diagram import Block, Sink

__all__ = ["SPAN", "draw_span", "draw_start"]
START = 0xFFFFFFFF  # no span of ticks has this index


def draw_span(seed: Array | int, stream: Array | int, span: Array | int, size: int) -> Float[Array, "ticks size"]:
    """The U[0, 1) numbers of a block for `SPAN` consecutive ticks, `size` per tick.

    They depend on the seed, the block's stream and the span alone. A block whose id names a purpose in training gets
    the numbers that training gives that purpose.
    """
    return _uniform(jax.random.fold_in(key_of(seed, stream), span), (SPAN, size))


def draw_start(seed: Array | int, stream: Array | int, size: int) -> Float[Array, " size"]:
    """The numbers that a block's `init` consumes."""
    if size == 0:
        return jnp.zeros(0)
    return _uniform(jax.random.fold_in(key_of(seed, stream), jnp.uint32(START)), (size,))


def _uniform(key: Array, shape: tuple[int, ...]) -> Array:
    """U[0, 1) numbers of 24 bits, the same in every precision."""
    first, second = jax.random.key_data(key)
    places = jnp.arange(math.prod(shape), dtype=jnp.uint32).reshape(shape)
    numbers = from_bits(*threefry((first, second), jnp.uint32(0), places), jnp.float32)
    return numbers.astype(jnp.result_type(float))


class Step(Evaluation):
    """The functions of a tick."""

    def __init__(self, stacks: Stacks):
        super().__init__(stacks)
        self.sinks = [k for k in self.pure if isinstance(self.kinds[k].block, Sink)]
        self.chance = [k for k, kind in enumerate(self.kinds) if kind.block.uniforms]
        updating = [k for k in self.pure if type(self.kinds[k].block).update is not Block.update]
        self._updating = [k for k in updating if k not in self.modes]
        self._streams = [np.array([self.plan.blocks[i].stream for i in kind.members], np.uint32) for kind in self.kinds]

    def init(self, values: Values, seed: Array | int) -> Carry:
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

    def numbers(self, seed: Array | int, span: Array | int) -> Numbers:
        """The random numbers of a span of ticks, by kind: `(ticks, rows, size)`."""

        def draw(k: int) -> Array:
            size = self.kinds[k].block.uniforms
            return jax.vmap(lambda stream: draw_span(seed, stream, span, size), 0, 1)(self._streams[k])

        return {k: draw(k) for k in self.chance}

    def outputs(
        self, batches: Iterable[int], values: Values, carry: Carry, tick: Array, numbers: Numbers, before: Environment
    ) -> Environment:
        """The outputs of these batches, added to those `before` them."""
        batches = list(batches)

        def evaluate(environment: Environment) -> Environment:
            return self._outputs(batches, values, carry, tick, numbers, environment)

        guess = {b: carry.held[self.stacks.batches[b].kind] for b in self.torn if b in batches}
        return self.consistent(evaluate, before, guess)

    def _outputs(
        self, batches: list[int], values: Values, carry: Carry, tick: Array, numbers: Numbers, before: Environment
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

    def finish(self, values: Values, carry: Carry, tick: Array, numbers: Numbers, environment: Environment) -> Carry:
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

    def finite(self, tree: PyTree[Array]) -> Array:
        """Whether all numbers are finite, for each leaf of floats in a tree."""
        real = [leaf for leaf in jax.tree.leaves(tree) if jnp.issubdtype(leaf.dtype, jnp.floating)]
        return jnp.stack([jnp.asarray(True), *(jnp.all(jnp.isfinite(leaf)) for leaf in real)])

    def changes(
        self, values: Values, carry: Carry, tick: Array, seed: Array | int, within: Array
    ) -> tuple[States, Array]:
        """The time derivative of the continuous state `within` seconds of a tick, and the levels of the crossings."""
        numbers = {k: drawn[tick % SPAN] for k, drawn in self.numbers(seed, tick // SPAN).items()}
        environment = self.outputs(range(len(self.stacks.batches)), values, carry, tick, numbers, self.empty())
        return Continuous(self, values, carry, tick, numbers, environment).changes_at(within)

    def signals(
        self,
        values: Values,
        carry: Carry,
        tick: Array,
        seed: Array | int,
        within: Array,
        hosts: Mapping[int, Mapping[str, Array]],
    ) -> Environment:
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

    def _all_outputs(self, k: int, environment: Environment) -> dict[str, Array]:
        batches = [b for b, batch in enumerate(self.stacks.batches) if batch.kind == k]
        return {name: jnp.concatenate([environment[b][name] for b in batches]) for name in self.kinds[k].block.outputs}

    def _due(self, k: int, tick: Array) -> Array:
        return tick % self._ticks[k] == 0


def _where(due: Array, new: Array, old: Array) -> Array:
    return jnp.where(due.reshape(due.shape + (1,) * (new.ndim - 1)), new, old)
