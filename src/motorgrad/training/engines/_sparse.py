"""The engine for a sparse learner, which stops now and then to make a table outside compiled code."""

from collections.abc import Callable
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, PyTree

from motorgrad._random import BLOCK, block_at, draw_places
from motorgrad.learning import Learner, SparseLearner, SparseState
from motorgrad.policies import Policy
from motorgrad.training.engines._cycle import CycleState
from motorgrad.training.engines._stepper import View
from motorgrad.training.engines._world import Carry, WorldProgram, WorldStepper

LAST: Any = -1


class SparseProgram(WorldProgram):
    """The compiled functions of learning in a JAX world by a `SparseLearner`. The loop stops where a table is due,
    before the next action. The index has its seeds first: rows that one seed looks up are then together in memory."""

    axes: ClassVar[Any] = (
        CycleState(
            SparseState(*[LAST] * len(SparseState._fields))._replace(index=0), *[LAST] * (len(CycleState._fields) - 1)
        ),
        LAST,
    )

    def _due(self, carry: Carry) -> Bool[Array, ""]:
        return jnp.any(_sparse(self.cycle.agent).due(carry[0].agent))

    def _draw(self, carry: Carry, seeds: Array, block: Array) -> dict[str, Array]:
        room = carry[0].agent.index.table.shape[-1]
        return {**super()._draw(carry, seeds, block), "policy": draw_places(seeds, "policy", block, room)}

    def _decisions(self, carry: Carry, seeds: Array, begun: Array, start: Array, stop: Array) -> tuple[Array, Carry]:
        """Decisions from `start` up to `stop`, counted as in `WorldProgram`, or to where a table is due; and how far
        they went."""
        decide = jax.vmap(self._decide, in_axes=(self.axes, -1), out_axes=self.axes)

        def going(position: tuple[Array, Carry], last: Array) -> Bool[Array, ""]:
            return (position[0] < last) & ~self._due(position[1])

        def block(position: tuple[Array, Carry]) -> tuple[Array, Carry]:
            index = position[0] // BLOCK
            uniforms = self._draw(position[1], seeds, begun + index)
            last = jnp.minimum(stop, (index + 1) * BLOCK)

            def decision(position: tuple[Array, Carry]) -> tuple[Array, Carry]:
                t, carry = position
                return t + 1, decide(carry, {name: drawn[t % BLOCK] for name, drawn in uniforms.items()})

            return jax.lax.while_loop(lambda position: going(position, last), decision, position)

        made, (cycle, world) = jax.lax.while_loop(lambda position: going(position, stop), block, (start, carry))
        axes = self.axes[0].agent
        agent = jax.vmap(_sparse(self.cycle.agent).publish, in_axes=(axes,), out_axes=axes)(cycle.agent)
        return made, (cycle._replace(agent=agent), world)


class SparseStepper(WorldStepper):
    """Learning in a JAX world by a `SparseLearner`. Tables are made on the host wherever the loop stops for them, so
    results do not depend on how many decisions are made at a time."""

    program_type: ClassVar[type[WorldProgram]] = SparseProgram

    def advance(self, decisions: int) -> None:
        stop = self.decision + decisions
        while self.decision < stop:
            self._refresh()
            begun, start = block_at(self.decision)
            numbers = map(np.uint32, (begun, start, start + stop - self.decision))
            made, self._carry = self.program.run(self._carry, self.seeds, *numbers)
            self.decision += int(made) - start

    @property
    def state(self) -> PyTree[np.ndarray]:
        """As of any engine, without the tables, which are made again."""
        state = super().state
        agent = state["cycle"].agent
        index = agent.index._replace(table=agent.index.table[..., :0])
        return {**state, "cycle": state["cycle"]._replace(agent=agent._replace(index=index))}

    def viewer(self, view: View) -> Callable[[], PyTree[np.ndarray]]:
        publish = _sparse(self.agent).publish
        return super().viewer(lambda cycle, state: view(cycle._replace(agent=publish(cycle.agent)), state))

    def set_policies(self, policies: Policy, memory: PyTree = None) -> None:
        super().set_policies(policies, memory)
        cycle, world = self._carry
        axes = self._axes[0].agent
        agent = jax.vmap(_sparse(self.agent).take_up, in_axes=(axes,), out_axes=axes)(cycle.agent)
        self._carry = (cycle._replace(agent=agent), world)

    def _refresh(self) -> None:
        cycle, world = self._carry
        policy = jax.tree.map(lambda leaf: np.moveaxis(np.asarray(leaf), -1, 0), cycle.agent.policy)
        index = _sparse(self.agent).refresh(cycle.agent.index, policy)
        self._carry = (cycle._replace(agent=cycle.agent._replace(index=index)), world)


def _sparse(agent: Learner) -> SparseLearner:
    assert isinstance(agent, SparseLearner)
    return agent
