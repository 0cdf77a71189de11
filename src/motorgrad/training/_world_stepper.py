"""The engine for worlds: one compiled loop over decisions, mapped over seeds."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad.learning import Agent, AgentState
from motorgrad.policies import Policy
from motorgrad.tasks import Task
from motorgrad.training._cycle import CycleState, Mode
from motorgrad.training._random import BLOCK, draw_block, key_of
from motorgrad.training._stepper import Record, Stepper, fits, seeds_first, seeds_last
from motorgrad.worlds import World

Carry = tuple[CycleState, Any]
AXES = (CycleState(AgentState(*[-1] * 10, index=0), -1, -1, -1, -1, -1), -1)  # of a `Carry`: where its seeds are


class WorldStepper(Stepper):
    """Learning in a JAX world. Inside the loop seeds sit last, where the processor's lanes are."""

    def __init__(
        self, task: Task, agent: Agent, seeds: Sequence[int], mode: Mode = "learn", initial: Policy | None = None
    ):
        super().__init__(task, agent, seeds, mode)
        assert isinstance(task.dynamics, World)
        self.world = task.dynamics
        self._carry = jax.jit(jax.vmap(self._begin, out_axes=AXES))(self.seeds, initial)
        self._run = jax.jit(self._decisions, donate_argnums=0)
        self._harvest = jax.jit(jax.vmap(self._look, in_axes=(AXES[0],), out_axes=(AXES[0], -1)), donate_argnums=0)

    def advance(self, decisions: int) -> None:
        stop = self.decision + decisions
        while self.decision < stop:
            self._refresh()
            made, self._carry = self._run(self._carry, jnp.uint32(self.decision), jnp.uint32(stop))
            jax.block_until_ready(self._carry)
            self.decision = int(made)

    @property
    def state(self) -> PyTree[np.ndarray]:
        cycle, world = jax.tree.map(lambda axis, part: jax.tree.map(lambda x: np.array(np.moveaxis(np.asarray(x), axis, 0), order="C"), part), AXES, self._carry)
        return {"decision": np.array(self.decision), "cycle": cycle, "world": world}

    def restore(self, state: PyTree[np.ndarray]) -> None:
        fits(state, self.state)
        self._carry = (seeds_last(state["cycle"]), seeds_last(state["world"]))
        self.decision = int(state["decision"])

    def harvest(self) -> Record:
        cycle, look = self._harvest(self._carry[0])
        self._carry = (cycle, self._carry[1])
        return seeds_first(look)

    def policies(self) -> Policy:
        return seeds_first(self._carry[0].agent.policy)

    def use(self, policies: Policy, memory: Any = None) -> None:
        cycle, world = self._carry
        cycle = cycle._replace(agent=cycle.agent._replace(policy=seeds_last(policies)))
        if memory is not None:
            adopt = jax.vmap(self._adopt, in_axes=(0, -1, -1, 0), out_axes=-1)
            cycle = jax.jit(adopt)(self.seeds, cycle, world, memory)
        self._carry = (cycle, world)

    def _refresh(self) -> None:
        cycle, world = self._carry
        lead = jax.tree.map(lambda axis, part: jax.tree.map(lambda x: np.moveaxis(np.asarray(x), axis, 0), part), AXES[0].agent, cycle.agent)
        agent = cycle.agent._replace(index=self.cycle.agent.refresh(lead._replace(index=cycle.agent.index)).index)
        self._carry = (cycle._replace(agent=agent), world)

    def _begin(self, seed: Array, own: Policy | None) -> Carry:
        state = self.world.reset(jax.random.uniform(key_of(seed, "start"), (self.world.reset_uniforms,)))
        return self.cycle.begin(self._fresh(seed, own), state, *self._start_numbers(seed)), state

    def _adopt(self, seed: Array, cycle: CycleState, state: Any, memory: Any) -> CycleState:
        return self.cycle.adopt(cycle, memory, state, *self._start_numbers(seed))

    def _decide(self, carry: Carry, numbers: dict[str, Array]) -> Carry:
        cycle, state = carry
        cycle = self.cycle.act(cycle, numbers["policy"])
        state = self.world.step(state, cycle.action, numbers["world"])
        cycle, ended = self.cycle.settle(cycle, state, numbers["observe"])
        if not isinstance(ended, bool):
            fresh = self.world.reset(numbers["reset"])
            state = jax.tree.map(lambda new, old: jnp.where(ended, new, old), fresh, state)
            cycle = self.cycle.restart(cycle, state, ended, numbers["memory"], numbers["look"])
        return cycle, state

    def _decisions(self, carry: Carry, start: Array, stop: Array) -> tuple[Array, Carry]:
        """Decisions `start` … `stop` − 1, a block of random numbers at a time, or up to where a learner is due for what
        cannot be compiled; also says up to where."""
        world, task = self.world, self.task
        sizes = {"policy": self.cycle.uniforms(one_seed(carry)[0]), "world": world.uniforms, "observe": task.uniforms}
        if self.cycle.restarts:
            sizes |= {"reset": world.reset_uniforms, "memory": task.init_uniforms, "look": task.uniforms}
        decide = jax.vmap(self._decide, in_axes=(AXES, -1), out_axes=AXES)

        def block(position: tuple[Array, Carry]) -> tuple[Array, Carry]:
            first, carry = position
            index = first // BLOCK
            numbers = {name: draw_block(self.seeds, name, index, size) for name, size in sizes.items()}
            last = jnp.minimum(stop, (index + 1) * BLOCK)

            def decision(t: Array, carry: Carry) -> Carry:
                return decide(carry, {name: drawn[t % BLOCK] for name, drawn in numbers.items()})

            return advanced(first, last, decision, carry)

        def due(carry: Carry) -> Any:
            if self.cycle.mode != "learn":
                return False
            waits = jax.vmap(self.cycle.agent.due, in_axes=(AXES[0].agent,))(carry[0].agent)
            return waits if waits is False else jnp.any(waits)

        def advanced(first, last, decision, carry):
            if due(carry) is False:
                return last, jax.lax.fori_loop(first, last, decision, carry)
            return jax.lax.while_loop(
                lambda position: (position[0] < last) & ~due(position[1]),
                lambda position: (position[0] + 1, decision(*position)),
                (first, carry),
            )

        def more(position):
            waits = due(position[1])
            return position[0] < stop if waits is False else (position[0] < stop) & ~waits

        made, carry = jax.lax.while_loop(more, block, (start, carry))
        cycle, state = carry
        agent = jax.vmap(self.cycle.agent.publish, in_axes=(AXES[0].agent,), out_axes=AXES[0].agent)(cycle.agent)
        return made, (cycle._replace(agent=agent), state)


def one_seed(carry):
    def shape(axis, leaf):
        sizes = list(leaf.shape)
        del sizes[axis]
        return jax.ShapeDtypeStruct(sizes, leaf.dtype)
    return jax.tree.map(lambda axis, part: jax.tree.map(lambda leaf: shape(axis, leaf), part), AXES, carry)
