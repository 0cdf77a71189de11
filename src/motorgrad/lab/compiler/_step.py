"""One tick as pure functions of one seed, with all blocks of a kind evaluated together, and its random numbers."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._random import BLOCK as SPAN
from motorgrad._random import key_of
from motorgrad.lab.compiler._integrate import integrated
from motorgrad.lab.compiler._stack import Environment, Gather, Stacks
from motorgrad.lab.diagram import Block, HostBlock, Moment, Sink

__all__ = ["SPAN", "draw_span", "draw_start"]
START = 0xFFFFFFFF  # no span of ticks has this index


def draw_span(seed: Any, stream: Any, span: Any, size: int) -> Float[Array, "ticks size"]:
    """The U[0, 1) numbers of a block for `SPAN` consecutive ticks, `size` per tick.

    They depend on the seed, the block's stream and the span alone. A block whose id names a purpose in training gets
    the numbers that training gives that purpose.
    """
    return jax.random.uniform(jax.random.fold_in(key_of(seed, stream), span), (SPAN, size))


def draw_start(seed: Any, stream: Any, size: int) -> Float[Array, " size"]:
    """The numbers that a block's `init` consumes."""
    if size == 0:
        return jnp.zeros(0)
    return jax.random.uniform(jax.random.fold_in(key_of(seed, stream), jnp.uint32(START)), (size,))


Numbers = dict[int, Array]
"""By kind: numbers from U[0, 1), one row per block."""
Values = Mapping[int, Mapping[str, Any]]
"""By kind: the parameters by name; rows lead."""
ROWS: Any = Moment(None, None, 0, 0, None)  # type: ignore[arg-type]  # the parts of a moment that differ between rows


class Carry(NamedTuple):
    """What is carried from tick to tick, by kind; rows lead."""

    states: dict[int, Any]
    held: dict[int, dict[str, Array]]


class Step:
    """The functions of a tick."""

    def __init__(self, stacks: Stacks):
        self.stacks, self.kinds, self.plan = stacks, stacks.kinds, stacks.plan
        self.pure = [k for k, kind in enumerate(self.kinds) if not isinstance(kind.block, HostBlock)]
        self.sinks = [k for k in self.pure if isinstance(self.kinds[k].block, Sink)]
        self.chance = [k for k, kind in enumerate(self.kinds) if kind.block.uniforms]
        self.movers = [k for k in self.pure if self.kinds[k].block.is_continuous]
        self._jumping = [k for k in self.pure if self.kinds[k].moving and self.kinds[k].block.jumps]
        self._updating = [k for k in self.pure if type(self.kinds[k].block).update is not Block.update]
        self._streams = [np.array([self._placed(i).stream for i in kind.members], np.uint32) for kind in self.kinds]
        self._ticks = [np.array([self._placed(i).ticks for i in kind.members], np.uint32) for kind in self.kinds]
        self._wires = [self._gathers(k, kind.members) for k, kind in enumerate(self.kinds)]
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
        states, held = {}, {}
        for k in self.pure:
            block, rows = self.kinds[k].block, len(self.kinds[k].members)
            draw = jax.vmap(lambda stream, size=block.init_uniforms: draw_start(seed, stream, size))
            fresh = jax.vmap(lambda v, u, block=block: block.bound(v).init(u))(values[k], draw(self._streams[k]))
            states[k] = jax.tree.map(lambda x: jax.lax.convert_element_type(x, x.dtype), fresh)
            if self.kinds[k].held:
                held[k] = {name: jnp.zeros((rows, *port.shape), port.dtype) for name, port in block.outputs.items()}
        return Carry(states, held)

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
        environment = list(before)
        for b in batches:
            k, rows = self._rows(b)
            given = self._output(b, values, carry.states[k], self._now(k, tick, self.time(tick), numbers), environment)
            if self.kinds[k].held:
                due, kept = self._due(k, tick)[rows], carry.held[k]
                given = {name: _where(due, new, kept[name][rows]) for name, new in given.items()}
            environment[b] = given
        return environment

    def finish(self, values: Values, carry: Carry, tick: Any, numbers: Numbers, environment: Environment) -> Carry:
        """The state after the tick, given all outputs."""
        states = dict(carry.states)
        if self.movers:
            states |= self._integrated(values, carry, tick, numbers, environment)
        for k in self._updating:
            now = self._now(k, tick, self.time(tick), numbers)
            after = self._apply("update", k, values[k], states[k], self._inputs(k, environment), now)
            after = jax.tree.map(lambda new, old: new.astype(old.dtype), after, states[k])
            if self.kinds[k].held:
                due = self._due(k, tick)
                after = jax.tree.map(lambda new, old, due=due: _where(due, new, old), after, states[k])
            states[k] = after
        return Carry(states, {k: self._all_outputs(k, environment) for k in carry.held})

    def recorded(self, environment: Environment) -> dict[int, dict[str, Array]]:
        """The values at the sinks' inputs, by kind; rows lead."""
        return {k: self._inputs(k, environment) for k in self.sinks}

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

    def slopes(
        self,
        movers: dict[int, Any],
        values: Values,
        carry: Carry,
        tick: Any,
        time: Any,
        numbers: Numbers,
        environment: Environment,
        start: Any = None,
    ) -> dict[int, Any]:
        """The time derivatives of the continuous states `movers`, by kind, in an RK4 step that began at `start`, by
        default at `time`. Blocks that are not moving are held as in `environment`.
        """
        there = list(environment)
        for b, batch in enumerate(self.stacks.batches):
            k = batch.kind
            if self.kinds[k].moving:
                state = movers.get(k, carry.states[k])
                there[b] = self._output(b, values, state, self._now(k, tick, time, numbers, start), there)
        now = {k: self._now(k, tick, time, numbers, start) for k in movers}
        return {
            k: self._apply("derivative", k, values[k], state, self._inputs(k, there), now[k])
            for k, state in movers.items()
        }

    def _integrated(
        self, values: Values, carry: Carry, tick: Any, numbers: Numbers, environment: Environment
    ) -> dict[int, Any]:
        """The continuous states at the end of the tick."""

        def slope(movers: dict[int, Any], time: Any, start: Any) -> dict[int, Any]:
            return self.slopes(movers, values, carry, tick, time, numbers, environment, start)

        def next_jump(time: Any) -> Any:
            times = [self._next_jump(k, values, self._now(k, tick, time, numbers)) for k in self._jumping]
            return jnp.min(jnp.stack(times))

        start, time, substeps = {k: carry.states[k] for k in self.movers}, self.time(tick), self.plan.substeps
        step, jump = self.plan.tick / substeps, next_jump if self._jumping else None
        if substeps == 1:
            return integrated(slope, jump, start, time, step)
        return jax.lax.fori_loop(
            0, substeps, lambda n, state: integrated(slope, jump, state, time + n * step, step), start
        )

    def _next_jump(self, k: int, values: Values, now: Moment) -> Any:
        """The time of the first jump of any block of a kind."""
        block = self.kinds[k].block
        times = jax.vmap(lambda v, n: block.bound(v).next_jump(n), in_axes=(0, ROWS))(dict(values[k]), now)
        return jnp.min(times)

    def _output(self, b: int, values: Values, states: Any, now: Moment, environment: Environment) -> dict[str, Array]:
        k, rows = self._rows(b)
        inputs = {name: gather(environment) for name, gather in self._direct[b].items()}
        own, state = jax.tree.map(lambda x: x[rows], (dict(values[k]), states))
        now = now._replace(step=now.step[rows], uniforms=now.uniforms[rows])
        given = self._apply("output", k, own, state, inputs, now)
        return {name: given[name].astype(port.dtype) for name, port in self.kinds[k].block.outputs.items()}

    def _apply(self, name: str, k: int, values: Any, state: Any, inputs: Any, now: Moment) -> Any:
        """One of the functions of a kind of blocks, for all rows."""
        block = self.kinds[k].block
        function = jax.vmap(lambda v, s, u, n: getattr(block.bound(v), name)(s, u, n), in_axes=(0, 0, 0, ROWS))
        return function(values, state, inputs, now)

    def _inputs(self, k: int, environment: Environment) -> dict[str, Array]:
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

    def _now(self, k: int, tick: Any, time: Any, numbers: Numbers, start: Any = None) -> Moment:
        rows, real = len(self.kinds[k].members), jnp.result_type(float)
        step = jnp.asarray(self._ticks[k] * self.plan.tick, real)
        return Moment(tick, time, step, numbers.get(k, jnp.zeros((rows, 0))), time if start is None else start)

    def time(self, tick: Any) -> Any:
        """Seconds since the start."""
        return tick.astype(jnp.result_type(float)) * self.plan.tick

    def _due(self, k: int, tick: Any) -> Array:
        return tick % self._ticks[k] == 0


def _where(due: Array, new: Array, old: Array) -> Array:
    return jnp.where(due.reshape(due.shape + (1,) * (new.ndim - 1)), new, old)
