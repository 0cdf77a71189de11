"""The continuous part of a diagram within a tick, block by block and uncompiled."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from timlab.compiler import Crossed, advanced, begin, integrated, method_named, owners
from timlab.diagram import Seconds, blur, clock
from timlab.engine._blocks import Blocks, Values, while_loop

States = dict[int, PyTree[Array]]
"""By block: the states."""
Crossings = dict[int, Array]
"""By block: a value for each of its zero crossings."""


class Tick:
    """The moving blocks in the current tick, all others held; the counterpart of the compiler's `Continuous`, with
    blocks in place of kinds.
    """

    rolled = False

    def __init__(self, every: Blocks):
        self.all, self.plan = every, every.plan
        blocks = self.plan.blocks
        self.movers = [i for i, placed in enumerate(blocks) if placed.block.is_continuous]
        self.tick = jnp.uint32(every.tick)
        self.time = clock(self.tick, self.plan.tick, 0.0)
        self.margin = blur(self.time[0], self.plan.tick)
        each = [(i, every.above[i].size, blocks[i].block) for i in every.above]
        slides = [np.isin(np.arange(size), np.arange(size)[block.slides]) & block.switches for _, size, block in each]
        self.slides = np.concatenate([np.zeros(0, bool), *slides])
        self.rests = self.slides & np.array([i in self.movers for i, size, _ in each for _ in range(size)], bool)
        self.falls = self.slides & np.array([block.falls for _, size, block in each for _ in range(size)], bool)
        self._ends = np.cumsum([every.above[i].size for i in every.above]).astype(int)

    @property
    def owners(self) -> tuple[np.ndarray, np.ndarray]:
        """As those of the compiler's `Continuous`."""
        leaves = [(i, leaf) for i in self.movers for leaf in jax.tree.leaves(self.all.states[i])]
        state = [((i,), (1, *leaf.shape)) for i, leaf in leaves]
        return owners(state), owners([((i,), (1, level.size)) for i, level in self.all.above.items()])

    def changes_at(self, within: float) -> tuple[States, Array]:
        """As that of the compiler's `Continuous`."""
        every = self.all
        state, modes = ({i: every.states[i] for i in chosen} for chosen in (self.movers, every.modes))
        shares = self._shares()
        return self.evaluate(state, modes, self._joined(every.above), shares, within, within)[:2]

    def signals_at(self, within: float) -> dict[str, np.ndarray]:
        """All outputs by address at the present state, this many seconds after the tick before."""
        every = self.all
        own = {i: every.states[i] for i in (*self.movers, *every.modes)}
        values = self._outputs(own, every.above, every.shares, within, within)
        return {f"{self.plan.blocks[i].path}.{port}": np.asarray(value) for (i, port), value in values.items()}

    def advance(self) -> tuple[States, Crossings]:
        """The states at the end of the tick, by block, and the sides of the crossings. The blocks' `pace`,
        `shares` and `fault` are updated.
        """
        every, solver, length = self.all, self.plan.solver, self.plan.tick
        state, modes = ({i: every.states[i] for i in chosen} for chosen in (self.movers, every.modes))
        above = self._joined(every.above)
        if not self.movers:
            return {}, every.above
        if solver.adapts:
            position = begin(every.pace["step"], state, modes, above)
            shares = self._shares()
            end = advanced(self, method_named(solver.name), solver.tolerances, position, shares, length, while_loop)
            every.pace = {"step": end.pace}
            shares = self._split(end.holds.shares) if every.shares else {}
            every.shares = {i: shares[i] for i in every.shares}
            every.fault = {"kind": end.fault, "within": end.stuck}
            return {**end.state, **end.modes}, self._split(end.above)
        if every.above:
            _, levels, crossed = self._evaluated(state, modes, {}, {}, 0.0, 0.0, every.values)
            sides = levels >= 0
            (state, _) = crossed(sides, sides != above)
            above = sides
        jump = self.next_jump if every.jumping else None
        piece = length / solver.substeps
        for substep in range(solver.substeps):
            within = jnp.asarray(substep * piece, jnp.result_type(float))
            state = integrated(self._slopes, jump, state, within, piece, self.margin, while_loop)
        return state, self._split(above)

    def evaluate(
        self, state: States, modes: States, above: Array, shares: Array, within: Seconds, start: Seconds
    ) -> tuple[States, Array, Crossed]:
        """As `System` of the compiler's adaptive steps requires."""
        sides = self._split(above)
        parts = self._split(shares)
        parts = {i: parts[i] for i in self.all.shares}
        there = self._outputs(state | modes, sides, parts, within, start)
        return self._evaluated(state, modes, sides, parts, within, start, there)

    def next_jump(self, within: Seconds) -> Array:
        """As `evaluate`."""
        now = {i: self.all.now(i, within, within) for i in self.all.jumping}
        times = [float(self.all.blocks[i].next_jump(now[i])) for i in now]
        return jnp.asarray(min(times, default=np.inf) - float(self.time[0]) - float(self.time[1]))

    def _evaluated(
        self,
        state: States,
        modes: States,
        sides: Crossings,
        shares: Crossings,
        within: Seconds,
        start: Seconds,
        values: Values,
    ) -> tuple[States, Array, Crossed]:
        every = self.all
        own = state | modes
        now = {i: every.now(i, within, start, sides.get(i)) for i in every.above}
        inputs = {i: every.inputs(i, values) for i in every.above}
        full = {i: own.get(i, every.states[i]) for i in every.above}
        levels = {i: every.blocks[i].crossings(full[i], inputs[i], now[i]) for i in every.above}

        def crossed(above: Array, turned: Array) -> tuple[States, States]:
            sides_after = self._split(above)
            turns = self._split(turned)
            after = dict(own)
            for i in every.above:
                if i in own:
                    then = now[i]._replace(above=sides_after[i], turned=turns[i])
                    after[i] = every.blocks[i].crossed(full[i], inputs[i], then)
            return {i: after[i] for i in state}, {i: after[i] for i in modes}

        slopes = {i: self._derivative(i, state, sides, values, within, start) for i in state}
        for i in [i for i in state if i in shares and (shares[i] >= 0).any()]:
            slopes[i] = jax.tree.map(jnp.zeros_like, slopes[i])
        return slopes, self._joined(levels), crossed

    def _slopes(self, state: States, within: Seconds, start: Seconds) -> States:
        values = self._outputs(state, {}, {}, within, start)
        return {i: self._derivative(i, state, {}, values, within, start) for i in state}

    def _derivative(
        self, i: int, state: States, sides: Crossings, values: Values, within: Seconds, start: Seconds
    ) -> PyTree[Array]:
        now = self.all.now(i, within, start, sides.get(i))
        slope = self.all.blocks[i].derivative(state[i], self.all.inputs(i, values), now)
        return jax.tree.map(lambda k, x: jnp.asarray(k, x.dtype), slope, state[i])

    def _outputs(self, own: States, sides: Crossings, shares: Crossings, within: Seconds, start: Seconds) -> Values:
        values = dict(self.all.values)
        moving = [i for i in self.plan.order if i in self.plan.moving]

        def evaluate(values: Values) -> None:
            for i in moving:
                now = self.all.now(i, within, start, sides.get(i))._replace(shares=shares.get(i))
                self.all.evaluate(i, values, own.get(i, self.all.states[i]), now)

        self.all.settle(values, evaluate, [i for i in moving if i in self.plan.torn])
        return values

    def _shares(self) -> Array:
        """The shares of all crossings, −1 for those that are never held."""
        real = jnp.result_type(float)
        every = {i: jnp.full(sides.shape, -1, real) for i, sides in self.all.above.items()}
        return self._joined(every | self.all.shares)

    def _joined(self, by_block: Crossings) -> Array:
        parts = [by_block[i] for i in self.all.above]
        return jnp.concatenate(parts) if parts else jnp.zeros(0)

    def _split(self, vector: Array) -> Crossings:
        parts = jnp.split(vector, self._ends[:-1]) if len(self._ends) else []
        return dict(zip(self.all.above, parts, strict=True))
