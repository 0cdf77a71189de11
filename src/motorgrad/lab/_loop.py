"""The compiled loop over ticks of a diagram without hosts, mapped over seeds, which sit last in it."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from motorgrad._compiler import loop_options
from motorgrad.lab._step import Carry, Numbers, Step, Values
from motorgrad.lab._streams import SPAN

Seen = dict[int, dict[str, Any]]
BUFFER = 2**20  # bytes of what sinks see in one call: beyond some MiB a loop is not compiled whole
LONGEST = 2**20  # ticks of one call where nothing is seen


class Loop:
    """Ticks of all seeds in one compiled call.

    **Arguments:** the step; the seeds, for which others, as many, may be given later; for the parameters, by kind and
    name, `-1` where they differ from seed to seed, along a last axis, else `None`.
    """

    def __init__(self, step: Step, seeds: np.ndarray, axes: Any):
        self.step, self.seeds, self.axes = step, seeds, axes
        self._call = jax.jit(self._ticks, donate_argnums=1, compiler_options=loop_options())
        self._look = jax.jit(self._seen)
        self.init = jax.jit(jax.vmap(step.init, in_axes=(axes, 0), out_axes=-1))

    @functools.cached_property
    def longest(self) -> int:
        """How many ticks one call makes at most: as many as what the sinks see has room for."""
        width = sum(leaf.size * leaf.dtype.itemsize for leaf in jax.tree.leaves(self._shapes))
        return LONGEST if width == 0 else min(16384, max(SPAN, BUFFER // width))

    @functools.cached_property
    def _shapes(self) -> Seen:
        """Of what the sinks see at a tick."""
        kinds, seeds = self.step.kinds, len(self.seeds)
        return {
            k: {
                name: jax.ShapeDtypeStruct((len(kinds[k].members), *port.shape, seeds), port.dtype)
                for name, port in kinds[k].block.inputs.items()
            }
            for k in self.step.sinks
        }

    @property
    def compilations(self) -> int:
        """How often the loop was compiled."""
        return self._call._cache_size()  # type: ignore[attr-defined]

    def advance(self, values: Values, carry: Carry, seeds: np.ndarray, first: int, ticks: int) -> tuple[Carry, Seen]:
        """Make at most `longest` ticks: the state afterwards, and what the sinks saw, `(ticks, rows, …, seeds)`."""
        carry, seen = self._call(values, carry, seeds, np.uint32(first), np.uint32(first + ticks))
        return carry, jax.tree.map(lambda x: np.asarray(x)[:ticks], seen)

    def look(self, values: Values, carry: Carry, seeds: np.ndarray, tick: int) -> Seen:
        """What the sinks will see at the next tick, `(1, rows, …, seeds)`; nothing moves."""
        return jax.tree.map(lambda x: np.asarray(x)[None], self._look(values, carry, seeds, np.uint32(tick)))

    def _seen(self, values: Values, carry: Carry, seeds: Array, tick: Array) -> Seen:
        numbers = {k: drawn[tick % SPAN] for k, drawn in self._draw(seeds, tick // SPAN).items()}
        return self._tick(values, carry, tick, numbers)[1]

    def _draw(self, seeds: Array, span: Any) -> Numbers:
        return jax.vmap(self.step.numbers, in_axes=(0, None), out_axes=-1)(seeds, span)

    def _tick(self, values: Values, carry: Carry, tick: Array, numbers: Numbers) -> tuple[Carry, Seen]:
        step = self.step

        def one(values: Values, carry: Carry, numbers: Numbers) -> tuple[Carry, Seen]:
            batches = range(len(step.stacks.batches))
            environment = step.outputs(batches, values, carry, tick, numbers, step.empty())
            return step.finish(values, carry, tick, numbers, environment), step.seen(environment)

        return jax.vmap(one, in_axes=(self.axes, -1, -1), out_axes=-1, axis_size=len(self.seeds))(
            values, carry, numbers
        )

    def _ticks(self, values: Values, carry: Carry, seeds: Array, first: Array, stop: Array) -> tuple[Carry, Seen]:
        """Ticks `first` … `stop` − 1, a span of random numbers at a time."""
        buffer = jax.tree.map(lambda like: jnp.zeros((self.longest, *like.shape), like.dtype), self._shapes)

        def ticks(start: Array, stop: Array, numbers: Numbers, position: tuple[Carry, Seen]) -> tuple[Carry, Seen]:
            def body(tick: Array, position: tuple[Carry, Seen]) -> tuple[Carry, Seen]:
                carry, buffer = position
                carry, seen = self._tick(values, carry, tick, {k: drawn[tick % SPAN] for k, drawn in numbers.items()})
                return carry, jax.tree.map(lambda all, new: all.at[tick - first].set(new), buffer, seen)

            return jax.lax.fori_loop(start, stop, body, position)

        if not self.step.chance:
            return ticks(first, stop, {}, (carry, buffer))

        def span(position: tuple[Array, tuple[Carry, Seen]]) -> tuple[Array, tuple[Carry, Seen]]:
            start, rest = position
            number = start // SPAN
            last = jnp.minimum(stop, (number + 1) * SPAN)
            return last, ticks(start, last, self._draw(seeds, number), rest)

        return jax.lax.while_loop(lambda position: position[0] < stop, span, (first, (carry, buffer)))[1]
