"""The continuous part of a diagram within a tick, for one seed: what a solver integrates."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from timlab.compiler._adaptive import Crossed, advanced, begin
from timlab.compiler._evaluation import ROWS, Carry, Crossings, Evaluation, Numbers, States, Values
from timlab.compiler._faults import NONE, Fault, joined, owners
from timlab.compiler._integrate import integrated
from timlab.compiler._methods import method_named
from timlab.compiler._stack import Environment
from timlab.diagram import Moment, Seconds, blur, clock


class Continuous:
    """The moving blocks in one tick; blocks that are not moving are held as in `environment`, the tick's outputs.

    Its state is that of all kinds with a continuous state, `step.movers`; its modes are the states that change at zero
    crossings only. Times are in seconds since the tick.
    """

    def __init__(
        self, step: Evaluation, values: Values, carry: Carry, tick: Array, numbers: Numbers, environment: Environment
    ):
        self.step, self.values, self.carry, self.tick = step, values, carry, tick
        self.numbers, self.environment = numbers, environment
        self.rolled = bool(step.torn)  # what finds their outputs is large
        self.time = clock(tick, step.plan.tick, 0.0)
        self.margin = blur(self.time[0], step.plan.tick)
        sizes = [carry.above[k].size for k in step.crossings]
        self._ends = [sum(sizes[: n + 1]) for n in range(len(sizes))]
        kinds = step.kinds
        slides = [_where(kinds[k].block.slides, carry.above[k].shape) for k in step.crossings]
        self.slides = np.concatenate([np.zeros(0, bool), *slides])
        rests = [k in step.movers for k in step.crossings]
        self.rests = self.slides & np.repeat(np.array(rests, bool), sizes)
        self.falls = self.slides & np.repeat(np.array([kinds[k].block.falls for k in step.crossings], bool), sizes)

    def slopes(self, state: States, within: Seconds, start: Seconds | None = None) -> States:
        """The time derivative of the state, in a step of the solver that began at `start`, by default at `within`."""
        return self._slopes(state, self._outputs(state, {}, {}, {}, within, start), {}, {}, within, start)

    def seen(self, state: States, within: Seconds) -> tuple[Environment, States]:
        """The outputs of all blocks, and the time derivative of the state."""
        there = self._outputs(state, {}, {}, {}, within, None)
        return there, self._slopes(state, there, {}, {}, within, None)

    def outputs_at(self, within: Seconds) -> Environment:
        """The outputs of all blocks at the present state, the sides and shares of the crossings as they are."""
        state, modes = ({k: self.carry.states[k] for k in kinds} for kinds in (self.step.movers, self.step.modes))
        return self._outputs(state, modes, self.carry.above, self.carry.shares, within, within)

    def changes_at(self, within: Seconds) -> tuple[States, Array]:
        """The time derivative of the present state, and the levels of the crossings."""
        state, modes = ({k: self.carry.states[k] for k in kinds} for kinds in (self.step.movers, self.step.modes))
        shares = self._joined(self._all_shares(self.carry.shares))
        return self.evaluate(state, modes, self._joined(self.carry.above), shares, within, within)[:2]

    @property
    def owners(self) -> tuple[np.ndarray, np.ndarray]:
        """The block of each number of the state, and of each crossing."""
        members = [kind.members for kind in self.step.kinds]
        states = self.carry.states
        state = [(members[k], leaf.shape) for k in self.step.movers for leaf in jax.tree.leaves(states[k])]
        return owners(state), owners([(members[k], self.carry.above[k].shape) for k in self.step.crossings])

    def advanced(self) -> tuple[States, Crossings, Crossings, dict[str, Array], Fault]:
        """The states at the end of the tick, the sides and the shares of the crossings, the length of the next step,
        and the fault, of which there is none with fixed steps.
        """
        step, carry = self.step, self.carry
        state, modes = ({k: carry.states[k] for k in kinds} for kinds in (step.movers, step.modes))
        above = self._joined(carry.above)
        solver = step.plan.solver
        length = step.plan.tick
        if solver.adapts:
            stays = jnp.where(carry.fault["kind"] != NONE, length, 0.0)
            position = begin(carry.pace["step"], state, modes, above, stays)
            shares = self._joined(self._all_shares(carry.shares))
            end = advanced(self, method_named(solver.name), solver.tolerances, position, shares, length)
            shares = self._split(end.holds.shares) if step.holding else {}
            shares = {k: shares[k] for k in carry.shares}
            chatter = end.holds.chatter(length) if step.crossings else None
            fault = joined(carry.fault, end.fault, end.stuck, chatter, self.tick)
            return {**end.state, **end.modes}, self._split(end.above), shares, {"step": end.pace}, fault
        if step.crossings:
            _, levels, crossed = self._evaluated(state, modes, {}, {}, 0.0, 0.0, self.environment)
            sides = levels >= 0
            state, _ = crossed(sides, sides != above)
            above = sides
        jump = self.next_jump if step.jumping else None
        piece = length / solver.substeps

        def substep(n: Array | int, state: States) -> States:
            within = n * jnp.asarray(piece, jnp.result_type(float))
            return integrated(self.slopes, jump, state, within, piece, self.margin, rolled=self.rolled)

        many = solver.substeps > 1
        state = jax.lax.fori_loop(0, solver.substeps, substep, state) if many else substep(0, state)
        return state, self._split(above), {}, {}, {}

    def evaluate(
        self, state: States, modes: States, above: Array, shares: Array, within: Seconds, start: Seconds
    ) -> tuple[States, Array, Crossed]:
        """As `_adaptive.System` requires."""
        sides = self._split(above)
        parts = self._split(shares)
        parts = {k: parts[k] for k in self.carry.shares}
        there = self._outputs(state, modes, sides, parts, within, start)
        return self._evaluated(state, modes, sides, parts, within, start, there)

    def next_jump(self, within: Seconds) -> Seconds:
        """As `_adaptive.System` requires."""
        if not self.step.jumping:
            return jnp.inf
        times = [self._next_jump(k, within) for k in self.step.jumping]
        real = jnp.result_type(float)
        with jax.enable_x64(True):  # blocks may give times in double precision
            first = jnp.min(jnp.concatenate([each.astype(jnp.float64) for each in times]))
            return (first - self.time[0].astype(jnp.float64) - self.time[1].astype(jnp.float64)).astype(real)

    def _evaluated(
        self,
        state: States,
        modes: States,
        sides: Crossings,
        shares: Crossings,
        within: Seconds,
        start: Seconds,
        there: Environment,
    ) -> tuple[States, Array, Crossed]:
        own = state | modes
        step = self.step
        values = self.values
        now = {k: self._now(k, within, start, sides) for k in step.crossings}
        inputs = {k: step.inputs(k, there) for k in step.crossings}
        full = {k: own.get(k, self.carry.states[k]) for k in step.crossings}
        levels = {k: step.apply("crossings", k, values[k], full[k], inputs[k], now[k]) for k in step.crossings}

        def crossed(above: Array, turned: Array) -> tuple[States, States]:
            sides_after = self._split(above)
            turns = self._split(turned)
            after = dict(own)
            for k in step.crossings:
                if k in own and step.kinds[k].block.switches:
                    then = now[k]._replace(above=sides_after[k], turned=turns[k])
                    after[k] = step.apply("crossed", k, values[k], full[k], inputs[k], then)
            return {k: after[k] for k in state}, {k: after[k] for k in modes}

        return self._slopes(state, there, sides, shares, within, start), self._joined(levels), crossed

    def _slopes(
        self,
        state: States,
        there: Environment,
        sides: Crossings,
        shares: Crossings,
        within: Seconds,
        start: Seconds | None,
    ) -> States:
        def slope(k: int) -> PyTree[Array]:
            now = self._now(k, within, start, sides)
            free = self.step.apply("derivative", k, self.values[k], state[k], self.step.inputs(k, there), now)
            if k not in shares:
                return free
            rests = jnp.any(shares[k] >= 0, axis=1)
            return jax.tree.map(lambda x: jnp.where(rests.reshape(-1, *(1,) * (x.ndim - 1)), 0.0, x), free)

        return {k: slope(k) for k in state}

    def _outputs(
        self, state: States, modes: States, sides: Crossings, shares: Crossings, within: Seconds, start: Seconds | None
    ) -> Environment:
        """The outputs of the moving blocks, among those of all others."""
        own = state | modes
        kinds = self.step.kinds
        moving = [(b, batch.kind) for b, batch in enumerate(self.step.stacks.batches) if kinds[batch.kind].moving]

        def evaluate(environment: Environment) -> Environment:
            there = list(environment)
            for b, k in moving:
                now = self._now(k, within, start, sides)._replace(shares=shares.get(k))
                there[b] = self.step.output(b, self.values, own.get(k, self.carry.states[k]), now, there)
            return there

        guess = {b: self.environment[b] for b, _ in moving if b in self.step.torn}
        return self.step.consistent(evaluate, self.environment, guess)

    def _now(self, k: int, within: Seconds, start: Seconds | None, sides: Crossings) -> Moment:
        return self.step.now(k, self.tick, self.numbers, within, start, sides.get(k))

    def _next_jump(self, k: int, within: Seconds) -> Array:
        """The times of the first jumps of the blocks of a kind."""
        block = self.step.kinds[k].block
        now = self._now(k, within, within, {})
        return jax.vmap(lambda v, n: block.bound(v).next_jump(n), in_axes=(0, ROWS))(dict(self.values[k]), now)

    def _all_shares(self, shares: Crossings) -> Crossings:
        """The shares of all crossings, −1 for those that are never held."""
        real = jnp.result_type(float)
        return {k: shares.get(k, jnp.full(self.carry.above[k].shape, -1, real)) for k in self.step.crossings}

    def _joined(self, by_kind: Crossings) -> Array:
        """Crossings as one vector."""
        parts = [by_kind[k].ravel() for k in self.step.crossings]
        return jnp.concatenate(parts) if parts else jnp.zeros(0)

    def _split(self, vector: Array) -> Crossings:
        """The inverse of `_joined`."""
        parts = jnp.split(vector, self._ends[:-1]) if self._ends else []
        return {k: part.reshape(self.carry.above[k].shape) for k, part in zip(self.step.crossings, parts, strict=True)}


def _where(part: slice, shape: tuple[int, ...]) -> np.ndarray:
    """Of blocks with as many crossings as the last axis of `shape` has, whether each is in a part of them; raveled."""
    chosen = np.zeros(shape, bool)
    chosen[:, part] = True
    return chosen.ravel()
