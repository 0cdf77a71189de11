"""The compiled loop over the ticks of a diagram without hosts, and the cache of compiled loops.

A diagram that differs from an earlier one in parameter values and names only reuses its loop.
"""

import functools
import threading
from collections import OrderedDict
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from motorgrad._compiler import loop_options, quick_options
from motorgrad.pages import size_of
from timlab.compiler._evaluation import Axes, Carry, Numbers, Values
from timlab.compiler._host_loop import HostLoop
from timlab.compiler._stack import Stacks
from timlab.compiler._step import SPAN, Step
from timlab.diagram import HostBlock, kind_of

Recorded = dict[int, dict[str, Any]]
BUFFER = 2**20  # bytes of recorded signals per call: XLA compiles a loop whole only up to some MiB of data
MAX_TICKS_PER_CALL = 2**20  # if nothing is recorded
KEPT = 2**22  # bytes of a state that is kept during a call, so that ticks can be made again to find where a fault began


class Loop:
    """Ticks of all seeds in one compiled call. Seeds are the last axis inside the loop.

    **Arguments:** the step; the seeds, whose number is fixed; for the parameters, by kind and name, `-1` where they
    differ between seeds, along the last axis, else `None`.
    """

    def __init__(self, step: Step, seeds: np.ndarray, axes: Axes):
        self.step, self.seeds, self.axes = step, seeds, axes
        self._call: Any = None
        self._peek = jax.jit(self._peeked)
        started = jax.vmap(step.init, in_axes=(axes, 0), out_axes=-1)
        self.init = jax.jit(started, compiler_options=quick_options())

    @functools.cached_property
    def longest(self) -> int:
        """The largest number of ticks of one call: as many as the buffer for recorded signals holds."""
        width = sum(
            leaf.size * leaf.dtype.itemsize for leaf in jax.tree.leaves(self.step.recorded_shapes(len(self.seeds)))
        )
        return MAX_TICKS_PER_CALL if width == 0 else min(16384, max(SPAN, BUFFER // width))

    @property
    def compilations(self) -> int:
        """How often the loop was compiled."""
        return 0 if self._call is None else self._call._cache_size()

    def advance(
        self, values: Values, carry: Carry, seeds: np.ndarray, first: int, ticks: int
    ) -> tuple[Carry, Recorded, Array]:
        """Run at most `longest` ticks; after a fault of the solver, a seed's continuous state stays. **Returns** the
        state afterwards; what the sinks recorded, `(ticks, rows, …, seeds)`; and what `Step.finite` says of the state.
        """
        if self._call is None:
            self.keeps = size_of(carry) <= KEPT
            donated = () if self.keeps else (1,)
            self._call = jax.jit(self._ticks, donate_argnums=donated, compiler_options=loop_options())
        carry, seen, finite = self._call(values, carry, seeds, np.uint32(first), np.uint32(first + ticks))
        return carry, jax.tree.map(lambda x: np.asarray(x)[:ticks], seen), finite

    def compile(self, values: Values, carry: Carry, seeds: np.ndarray) -> Carry:
        """Compile now. **Returns** the same state: its memory may be reused."""
        return self.advance(values, carry, seeds, 0, 0)[0]

    def peek(self, values: Values, carry: Carry, seeds: np.ndarray, tick: int) -> Recorded:
        """What the sinks would record at the next tick, `(1, rows, …, seeds)`, without advancing."""
        return jax.tree.map(lambda x: np.asarray(x)[None], self._peek(values, carry, seeds, np.uint32(tick)))

    def _peeked(self, values: Values, carry: Carry, seeds: Array, tick: Array) -> Recorded:
        numbers = {k: drawn[tick % SPAN] for k, drawn in self._draw(seeds, tick // SPAN).items()}
        return self._tick(values, carry, tick, numbers)[1]

    def _draw(self, seeds: Array, span: Array) -> Numbers:
        return jax.vmap(self.step.numbers, in_axes=(0, None), out_axes=-1)(seeds, span)

    def _tick(self, values: Values, carry: Carry, tick: Array, numbers: Numbers) -> tuple[Carry, Recorded]:
        step = self.step

        def one(values: Values, carry: Carry, numbers: Numbers) -> tuple[Carry, Recorded]:
            batches = range(len(step.stacks.batches))
            environment = step.outputs(batches, values, carry, tick, numbers, step.empty())
            return step.finish(values, carry, tick, numbers, environment), step.recorded(environment)

        return jax.vmap(one, in_axes=(self.axes, -1, -1), out_axes=-1, axis_size=len(self.seeds))(
            values, carry, numbers
        )

    def _ticks(self, values: Values, carry: Carry, seeds: Array, first: Array, stop: Array) -> tuple[Any, ...]:
        """Ticks `first` … `stop` − 1, one span of random numbers at a time."""
        buffer = jax.tree.map(
            lambda like: jnp.zeros((self.longest, *like.shape), like.dtype), self.step.recorded_shapes(len(self.seeds))
        )

        def ticks(
            start: Array, stop: Array, numbers: Numbers, position: tuple[Carry, Recorded]
        ) -> tuple[Carry, Recorded]:
            def body(tick: Array, position: tuple[Carry, Recorded]) -> tuple[Carry, Recorded]:
                carry, buffer = position
                carry, seen = self._tick(values, carry, tick, {k: drawn[tick % SPAN] for k, drawn in numbers.items()})
                return carry, jax.tree.map(lambda all, new: all.at[tick - first].set(new), buffer, seen)

            return jax.lax.fori_loop(start, stop, body, position)

        def span(position: tuple[Array, tuple[Carry, Recorded]]) -> tuple[Array, tuple[Carry, Recorded]]:
            start, rest = position
            number = start // SPAN
            last = jnp.minimum(stop, (number + 1) * SPAN)
            return last, ticks(start, last, self._draw(seeds, number), rest)

        if self.step.chance:
            begin = first, (carry, buffer)
            carry, buffer = jax.lax.while_loop(lambda position: position[0] < stop, span, begin)[1]
        else:
            carry, buffer = ticks(first, stop, {}, (carry, buffer))
        return carry, buffer, self.step.finite((carry.states, carry.held))


MAX_KEPT_LOOPS = 32  # the least recently used one is dropped first
_kept: "OrderedDict[Any, Loop | HostLoop]" = OrderedDict()
_lock = threading.Lock()


def cached_program(stacks: Stacks, seeds: np.ndarray, axes: Axes) -> Loop | HostLoop:
    """The loop for these stacks and this number of seeds. `axes` are the seed axes of the parameters, see `Loop`."""
    plan = stacks.plan
    swept = tuple((k, name) for k, names in axes.items() for name, axis in names.items() if axis is not None)
    # all that the loop depends on in a block; messages of hosts contain their path
    blocks = tuple(
        (
            *(kind_of(placed.block), placed.ticks, placed.identity, tuple(placed.sources.items())),
            placed.path if isinstance(placed.block, HostBlock) else None,
        )
        for placed in plan.blocks
    )
    # `moving` is not implied by the blocks' settings and ticks: a source with `period == tick` is held within a tick,
    # one without a period is evaluated again inside an RK4 step
    key = (plan.tick, plan.solver, blocks, plan.moving, plan.torn, stacks.batches, stacks.rows, swept, len(seeds))
    with _lock:
        if key not in _kept:
            on_host = any(isinstance(kind.block, HostBlock) for kind in stacks.kinds)
            _kept[key] = (HostLoop if on_host else Loop)(Step(stacks), seeds, axes)
        _kept.move_to_end(key)
        while len(_kept) > MAX_KEPT_LOOPS:
            _kept.popitem(last=False)
        return _kept[key]
