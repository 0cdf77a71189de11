"""The continuous part of a diagram within a tick, for one seed: what a solver integrates."""

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from motorgrad.lab.compiler._adaptive import advanced, begin
from motorgrad.lab.compiler._integrate import integrated
from motorgrad.lab.compiler._methods import METHODS
from motorgrad.lab.compiler._stack import Environment
from motorgrad.lab.diagram import clock, rounding

if TYPE_CHECKING:
    from motorgrad.lab.compiler._step import Carry, Numbers, Step, Values


class Continuous:
    """The moving blocks in one tick; blocks that are not moving are held as in `environment`, the tick's outputs.

    Its state is that of all kinds with a continuous state, `step.movers`; its modes are the states that change at zero
    crossings only. Times are in seconds since the tick.
    """

    def __init__(
        self, step: "Step", values: "Values", carry: "Carry", tick: Any, numbers: "Numbers", environment: Environment
    ):
        self.step, self.values, self.carry, self.tick = step, values, carry, tick
        self.numbers, self.environment = numbers, environment
        self.time = clock(tick, step.plan.tick, 0.0)
        self.margin = rounding() * (jnp.abs(self.time[0]) + step.plan.tick)
        sizes = [carry.above[k].size for k in step.crossings]
        self._ends = [sum(sizes[: n + 1]) for n in range(len(sizes))]

    def slopes(self, state: dict[int, Any], within: Any, start: Any = None) -> dict[int, Any]:
        """The time derivative of the state, in a step of the solver that began at `start`, by default at `within`."""
        return self._slopes(state, self._outputs(state, {}, {}, within, start), {}, within, start)

    def seen(self, state: dict[int, Any], within: Any) -> tuple[Environment, dict[int, Any]]:
        """The outputs of all blocks, and the time derivative of the state."""
        there = self._outputs(state, {}, {}, within, None)
        return there, self._slopes(state, there, {}, within, None)

    def advanced(self) -> tuple[dict[int, Any], dict[int, Any], dict[str, Any]]:
        """The states at the end of the tick, the sides of the crossings, and the length of the next step."""
        step, carry = self.step, self.carry
        state, modes = ({k: carry.states[k] for k in kinds} for kinds in (step.movers, step.modes))
        above, solver, length = self._joined(carry.above), step.plan.solver, step.plan.tick
        if solver.adapts:
            position = begin(carry.pace["step"], state, modes, above)
            end = advanced(self, METHODS[solver.name], solver.tolerances, position, length)
            return end.state | end.modes, self._split(end.above), {"step": end.pace}
        if step.crossings:
            _, levels, crossed = self._evaluated(state, modes, {}, 0.0, 0.0, self.environment)
            sides = levels >= 0
            state, _ = crossed(sides, sides != above)
            above = sides
        jump, piece = self.next_jump if step.jumping else None, length / solver.substeps

        def substep(n: Any, state: Any) -> Any:
            within = n * jnp.asarray(piece, jnp.result_type(float))
            return integrated(self.slopes, jump, state, within, piece, self.margin)

        if solver.substeps == 1:
            state = integrated(self.slopes, jump, state, jnp.zeros(()), piece, self.margin)
        else:
            state = jax.lax.fori_loop(0, solver.substeps, substep, state)
        return state, self._split(above), {}

    def evaluate(self, state: Any, modes: Any, above: Any, within: Any, start: Any) -> tuple[Any, Any, Any]:
        """As `_adaptive.System` requires."""
        sides = self._split(above)
        there = self._outputs(state, modes, sides, within, start)
        return self._evaluated(state, modes, sides, within, start, there)

    def next_jump(self, within: Any) -> Any:
        """As `_adaptive.System` requires."""
        if not self.step.jumping:
            return jnp.inf
        times, real = [self._next_jump(k, within) for k in self.step.jumping], jnp.result_type(float)
        with jax.enable_x64(True):  # blocks may give times in double precision
            first = jnp.min(jnp.concatenate([each.astype(jnp.float64) for each in times]))
            return (first - self.time[0].astype(jnp.float64) - self.time[1].astype(jnp.float64)).astype(real)

    def _evaluated(self, state: Any, modes: Any, sides: Any, within: Any, start: Any, there: Environment) -> Any:
        own, step, values = state | modes, self.step, self.values
        now = {k: self._now(k, within, start, sides) for k in step.crossings}
        inputs = {k: step.inputs(k, there) for k in step.crossings}
        full = {k: own.get(k, self.carry.states[k]) for k in step.crossings}
        levels = {k: step.apply("crossings", k, values[k], full[k], inputs[k], now[k]) for k in step.crossings}

        def crossed(above: Any, turned: Any) -> tuple[Any, Any]:
            above, turned, after = self._split(above), self._split(turned), dict(own)
            for k in step.crossings:
                if k in own and step.kinds[k].block.switches:
                    then = now[k]._replace(above=above[k], turned=turned[k])
                    after[k] = step.apply("crossed", k, values[k], full[k], inputs[k], then)
            return {k: after[k] for k in state}, {k: after[k] for k in modes}

        return self._slopes(state, there, sides, within, start), self._joined(levels), crossed

    def _slopes(self, state: Any, there: Environment, sides: Any, within: Any, start: Any) -> dict[int, Any]:
        def slope(k: int) -> Any:
            now = self._now(k, within, start, sides)
            return self.step.apply("derivative", k, self.values[k], state[k], self.step.inputs(k, there), now)

        return {k: slope(k) for k in state}

    def _outputs(self, state: Any, modes: Any, sides: Any, within: Any, start: Any) -> Environment:
        """The outputs of the moving blocks, among those of all others."""
        own, kinds = state | modes, self.step.kinds
        moving = [(b, batch.kind) for b, batch in enumerate(self.step.stacks.batches) if kinds[batch.kind].moving]

        def evaluate(environment: Environment) -> Environment:
            there = list(environment)
            for b, k in moving:
                now = self._now(k, within, start, sides)
                there[b] = self.step.output(b, self.values, own.get(k, self.carry.states[k]), now, there)
            return there

        guess = {b: self.environment[b] for b, _ in moving if b in self.step.torn}
        return self.step.consistent(evaluate, self.environment, guess)

    def _now(self, k: int, within: Any, start: Any, sides: Any) -> Any:
        return self.step.now(k, self.tick, self.numbers, within, start, sides.get(k))

    def _next_jump(self, k: int, within: Any) -> Any:
        """The times of the first jumps of the blocks of a kind."""
        from motorgrad.lab.compiler._step import ROWS

        block, now = self.step.kinds[k].block, self._now(k, within, within, {})
        return jax.vmap(lambda v, n: block.bound(v).next_jump(n), in_axes=(0, ROWS))(dict(self.values[k]), now)

    def _joined(self, by_kind: dict[int, Any]) -> Any:
        """Crossings as one vector."""
        parts = [by_kind[k].ravel() for k in self.step.crossings]
        return jnp.concatenate(parts) if parts else jnp.zeros(0)

    def _split(self, vector: Any) -> dict[int, Any]:
        """The inverse of `_joined`."""
        parts = jnp.split(vector, self._ends[:-1]) if self._ends else []
        return {k: part.reshape(self.carry.above[k].shape) for k, part in zip(self.step.crossings, parts, strict=True)}
