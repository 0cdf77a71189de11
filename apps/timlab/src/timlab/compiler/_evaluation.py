"""The functions of blocks, evaluated for all blocks of a kind together, for one seed."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from timlab.compiler._faults import Fault
from timlab.compiler._loops import solved
from timlab.compiler._plan import is_mode
from timlab.compiler._stack import Environment, Gather, Stacks
from timlab.diagram import HostBlock, Moment, Seconds, Signals, clock, crossings_of

Numbers = dict[int, Array]
"""By kind: numbers from U[0, 1), one row per block."""
Outputs = dict[int, dict[str, Array]]
"""By batch: its outputs by port; rows lead."""
States = dict[int, PyTree[Array]]
"""By kind: the states of its blocks; rows lead."""
Crossings = dict[int, Array]
"""By kind: a value for each zero crossing; rows lead."""
Values = Mapping[int, Mapping[str, Array | np.ndarray]]
"""By kind: the parameters by name; rows lead."""
Axes = Mapping[int, Mapping[str, int | None]]
"""By kind: the axis of the seeds in a parameter, −1, or `None` where it is the same for all."""
ROWS: Any = Moment(None, None, 0, 0, None, None, None, 0, 0, None, 0)  # type: ignore[arg-type]  # what differs between rows


class Carry(NamedTuple):
    """What is carried from tick to tick, by kind; rows lead."""

    states: States
    held: dict[int, dict[str, Array]]
    above: Crossings
    """Which zero crossings count as not negative."""
    pace: dict[str, Array]
    """`"step"`, the length of the next step of a solver that adapts it, in seconds; 0 before the first."""
    shares: Crossings
    """For crossings that may be held: the share of the present mode, −1 where it is not held."""
    fault: Fault
    """What kept the last tick from being computed, with a solver that adapts its steps."""


class Evaluation:
    """The kinds of blocks, their functions, and the wires between them."""

    def __init__(self, stacks: Stacks):
        self.stacks, self.kinds, self.plan = stacks, stacks.kinds, stacks.plan
        self.pure = [k for k, kind in enumerate(self.kinds) if not isinstance(kind.block, HostBlock)]
        self.movers = [k for k in self.pure if self.kinds[k].block.is_continuous]
        self.jumping = [k for k in self.pure if self.kinds[k].moving and self.kinds[k].block.jumps]
        self.modes = [k for k in self.pure if self.kinds[k].moving and is_mode(self.kinds[k].block)]
        self.adapts = self.plan.solver.adapts and len(self.movers) > 0
        # fixed steps look for zero crossings at ticks, to change continuous states
        blocks = {k: self.kinds[k].block for k in self.pure if self.kinds[k].moving}
        watched = {k: block for k, block in blocks.items() if self.adapts or (block.is_continuous and block.switches)}
        self.crossings = {k: number for k, block in watched.items() if (number := crossings_of(block))}
        switching = [k for k in self.crossings if self.kinds[k].block.switches] if self.adapts else []
        self.holding = [k for k in switching if range(self.crossings[k])[self.kinds[k].block.slides]]
        """The kinds with crossings that may be held."""
        self._ticks = [np.array([self.plan.blocks[i].ticks for i in kind.members], np.uint32) for kind in self.kinds]
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

    def now(
        self,
        k: int,
        tick: Array,
        numbers: Numbers,
        within: Seconds = 0.0,
        start: Seconds | None = None,
        above: Array | None = None,
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

    def consistent(
        self, evaluate: Callable[[Environment], Environment], before: Environment, guess: Outputs
    ) -> Environment:
        """The environment that `evaluate` makes of the one `before`, with `guess` for the outputs of torn batches; and
        where there are any, such that it agrees with the guess.
        """
        if not guess:
            return evaluate(before)
        given = lambda guess: [guess.get(b, outputs) for b, outputs in enumerate(before)]  # noqa: E731
        return solved(lambda guess: evaluate(given(guess)), lambda after: {b: after[b] for b in guess}, guess)

    def host_inputs(self, k: int, environment: Environment, feedthrough: bool) -> dict[str, Array]:
        """The values at a host block's inputs: at those with feedthrough, or at all."""
        wires = {name: g for name, g in self._wires[k].items() if g.port.feedthrough or not feedthrough}
        return {name: gather(environment)[0] for name, gather in wires.items()}

    def output(
        self, b: int, values: Values, states: PyTree[Array], now: Moment, environment: Environment
    ) -> dict[str, Array]:
        """The outputs of a batch."""
        k, rows = self._rows(b)
        inputs = {name: gather(environment) for name, gather in self._direct[b].items()}
        own, state = jax.tree.map(lambda x: x[rows], (dict(values[k]), states))
        above, shares = (None if each is None else each[rows] for each in (now.above, now.shares))
        now = now._replace(step=now.step[rows], uniforms=now.uniforms[rows], above=above, shares=shares)
        given = self.apply("output", k, own, state, inputs, now)
        return {name: given[name].astype(port.dtype) for name, port in self.kinds[k].block.outputs.items()}

    def apply(
        self,
        name: str,
        k: int,
        values: Mapping[str, Array | np.ndarray],
        state: PyTree[Array],
        inputs: Signals,
        now: Moment,
    ) -> PyTree[Array]:
        """One of the functions of a kind of blocks, for all rows."""
        block = self.kinds[k].block
        function = jax.vmap(lambda v, s, u, n: getattr(block.bound(v), name)(s, u, n), in_axes=(0, 0, 0, ROWS))
        return function(values, state, inputs, now)

    def inputs(self, k: int, environment: Environment) -> dict[str, Array]:
        """The values at all inputs of a kind."""
        return {name: gather(environment) for name, gather in self._wires[k].items()}

    def _gathers(self, k: int, members: Iterable[int]) -> dict[str, Gather]:
        rows = tuple(members)
        return {name: Gather(self.stacks, rows, name, port) for name, port in self.kinds[k].block.inputs.items()}

    def _rows(self, b: int) -> tuple[int, slice]:
        batch = self.stacks.batches[b]
        return batch.kind, slice(batch.start, batch.stop)
