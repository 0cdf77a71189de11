"""The blocks of a diagram in one seed, evaluated one at a time and uncompiled."""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, PyTree

from timlab.compiler import SPAN, Plan, draw_span, draw_start, is_mode, root, stack
from timlab.diagram import Block, HostBlock, HostMoment, Moment, Seconds, Signals, clock, crossings_of
from timlab.engine._parameters import Parameters
from timlab.engine._state import precisely

Values = dict[tuple[int, str], Array]
"""The outputs by block and port."""

Carried = TypeVar("Carried")


class Blocks:
    """The blocks of a plan, with their parameters, states and last outputs in one seed, at a tick."""

    def __init__(self, plan: Plan, seed: int):
        self.plan, self.seed = plan, seed
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
        self.fault: dict[str, Array] = {}
        self.pace = {"step": jnp.zeros(())} if adapts and continuous else {}
        self._steps = [jnp.asarray(p.ticks * self.plan.tick, jnp.result_type(float)) for p in self.plan.blocks]
        self._drawn: dict[int, tuple[int, np.ndarray]] = {}
        self.states: list[Any] = []
        """Of each block its state, a pytree of arrays, or its `Host`."""
        for block, placed in zip(self.blocks, self.plan.blocks, strict=True):
            uniforms = draw_start(self.seed, placed.stream, block.init_uniforms)
            if isinstance(block, HostBlock):
                self.states.append(block.start(np.array([self.seed]), np.asarray(uniforms)[None], 1))
            else:
                self.states.append(jax.tree.map(jnp.asarray, block.init(uniforms)))

    def _bind(self) -> None:
        """Bind the current parameters to the blocks."""
        self.blocks = [
            placed.block.bound({name: jnp.asarray(value) for name, value in self._parameters.arrays(i).items()})
            for i, placed in enumerate(self.plan.blocks)
        ]

    def now(self, i: int, within: Seconds = 0.0, start: Seconds | None = None, above: Array | None = None) -> Moment:
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

    def _uniforms(self, i: int) -> Array:
        span = self.tick // SPAN
        size = self.blocks[i].uniforms
        if size == 0:
            return self._none
        if self._drawn.get(i, (None, None))[0] != span:
            self._drawn[i] = span, np.asarray(draw_span(self.seed, self.plan.blocks[i].stream, span, size))
        return jnp.asarray(self._drawn[i][1][self.tick % SPAN])

    def inputs(self, i: int, values: Values, feedthrough: bool = False) -> Signals:
        """The values at a block's inputs: at those with feedthrough, or at all."""
        placed = self.plan.blocks[i]
        found = {}
        for name, port in placed.block.inputs.items():
            source = placed.sources.get(name)
            if feedthrough and not port.feedthrough:
                continue
            value = port.unwired() if source is None else values[source.block, source.port]
            found[name] = value if value.dtype == port.dtype else value.astype(port.dtype)
        return found

    def evaluate(self, i: int, values: Values, state: PyTree[Array], now: Moment) -> None:
        """Compute the outputs of a block from those of others."""
        block = self.blocks[i]
        ports = self.plan.blocks[i].block.outputs
        inputs = self.inputs(i, values, feedthrough=True)
        if isinstance(block, HostBlock):
            given = self.states[i].output(block, rows_of(inputs), self.host_moment(i))
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

        def after(guess: Array) -> Values:
            there = values | {ports[name][0]: value for name, value in unravel(guess).items()}
            evaluate(there)
            return there

        def residual(guess: Array) -> Array:
            there = after(guess)
            return ravel_pytree({name: there[key] for name, (key, _) in ports.items()})[0] - guess

        x, found = root(residual, jnp.where(jnp.isfinite(guess), guess, 0.0), while_loop)
        values |= after(jnp.where(found, x, jnp.nan))
        return None

    def host_moment(self, i: int) -> HostMoment:
        """The moment for a host, as compiled runs have it: its time does not depend on the precision of signals."""
        length = self.plan.tick
        ticks = self.plan.blocks[i].ticks
        return HostMoment(self.tick, self.tick * length, ticks * length, np.asarray(self._uniforms(i))[None])

    def due(self, i: int) -> bool:
        """Whether a block is evaluated in this tick."""
        return self.tick % self.plan.blocks[i].ticks == 0


def rows_of(inputs: Signals) -> dict[str, np.ndarray]:
    """Signals with a leading axis for the one seed."""
    return {name: np.array(value)[None] for name, value in inputs.items()}


def while_loop(condition: Callable[[Carried], Array], body: Callable[[Carried], Carried], value: Carried) -> Carried:
    """`jax.lax.while_loop`, uncompiled."""
    while condition(value):
        value = body(value)
    return value
