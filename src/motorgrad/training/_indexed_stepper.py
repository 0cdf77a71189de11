"""The engine for an indexed learner, which asks now and then for what cannot be compiled."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, PyTree

from motorgrad._random import BLOCK, draw_places
from motorgrad.learning import AgentState, IndexedAgent
from motorgrad.policies import Policy
from motorgrad.training._cycle import CycleState
from motorgrad.training._world_stepper import Carry, WorldStepper

LAST: Any = -1


class IndexedStepper(WorldStepper):
    """Learning in a JAX world by an `IndexedAgent`.

    The loop stops where a table is due, before the next action; on the host the table is made, and the loop goes on. So
    what is learnt does not depend on how many decisions are asked for at a time. The index has its seeds first: what
    is looked up by each seed in its own place is then together in memory.
    """

    axes: ClassVar[Any] = (CycleState(AgentState(*[LAST] * 10, index=0), *[LAST] * 5), LAST)

    def advance(self, decisions: int) -> None:
        stop = self.decision + decisions
        while self.decision < stop:
            self._refresh()
            made, self._carry = self._run(self._carry, jnp.uint32(self.decision), jnp.uint32(stop))
            self.decision = int(made)

    @property
    def state(self) -> PyTree[np.ndarray]:
        """As of any engine, without the tables, which are made again from what they were made of."""
        state = super().state
        agent = state["cycle"].agent
        index = agent.index._replace(table=agent.index.table[..., :0])
        return {**state, "cycle": state["cycle"]._replace(agent=agent._replace(index=index))}

    def use(self, policies: Policy, memory: Any = None) -> None:
        super().use(policies, memory)
        cycle, world = self._carry
        axes = self.axes[0].agent
        agent = jax.vmap(self._learner.take_up, in_axes=(axes,), out_axes=axes)(cycle.agent)
        self._carry = (cycle._replace(agent=agent), world)

    @property
    def _learner(self) -> IndexedAgent:
        assert isinstance(self.cycle.agent, IndexedAgent)
        return self.cycle.agent

    def _refresh(self) -> None:
        cycle, world = self._carry
        policy = jax.tree.map(lambda leaf: np.moveaxis(np.asarray(leaf), -1, 0), cycle.agent.policy)
        index = self._learner.refresh(cycle.agent.index, policy)
        self._carry = (cycle._replace(agent=cycle.agent._replace(index=index)), world)

    def _due(self, carry: Carry) -> Bool[Array, ""]:
        return jnp.any(self._learner.due(carry[0].agent))

    def _numbers(self, carry: Carry, block: Array) -> dict[str, Array]:
        room = carry[0].agent.index.table.shape[-1]
        return {**super()._numbers(carry, block), "policy": draw_places(self.seeds, "policy", block, room)}

    def _decisions(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, carry: Carry, start: Array, stop: Array
    ) -> tuple[Array, Carry]:
        """Decisions from `start` up to `stop`, or to where a table is due; and up to where they went."""
        decide = jax.vmap(self._decide, in_axes=(self.axes, -1), out_axes=self.axes)

        def going(position: tuple[Array, Carry], last: Array) -> Bool[Array, ""]:
            return (position[0] < last) & ~self._due(position[1])

        def block(position: tuple[Array, Carry]) -> tuple[Array, Carry]:
            index = position[0] // BLOCK
            numbers = self._numbers(position[1], index)
            last = jnp.minimum(stop, (index + 1) * BLOCK)

            def decision(position: tuple[Array, Carry]) -> tuple[Array, Carry]:
                t, carry = position
                return t + 1, decide(carry, {name: drawn[t % BLOCK] for name, drawn in numbers.items()})

            return jax.lax.while_loop(lambda position: going(position, last), decision, position)

        made, (cycle, world) = jax.lax.while_loop(lambda position: going(position, stop), block, (start, carry))
        axes = self.axes[0].agent
        agent = jax.vmap(self._learner.publish, in_axes=(axes,), out_axes=axes)(cycle.agent)
        return made, (cycle._replace(agent=agent), world)
