"""The engine for worlds: one compiled loop over decisions, mapped over seeds."""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._compiler import loop_options
from motorgrad._random import BLOCK, draw_block, key_of
from motorgrad.learning import Agent
from motorgrad.policies import Policy
from motorgrad.tasks import Task
from motorgrad.training._cycle import CycleState, Mode
from motorgrad.training._stepper import Look, Record, Stepper, fits, seeds_first, seeds_last
from motorgrad.worlds import World

Carry = tuple[CycleState, Any]


class WorldStepper(Stepper):
    """Learning in a JAX world. Inside the loop seeds sit last, where the processor's lanes are."""

    axes: ClassVar[Any] = (-1, -1)
    """Where the seeds are in the loop's state: in one place, or in a tree of them."""

    def __init__(
        self, task: Task, agent: Agent, seeds: Sequence[int], mode: Mode = "learn", initial: Policy | None = None
    ):
        super().__init__(task, agent, seeds, mode)
        assert isinstance(task.dynamics, World)
        self.world = task.dynamics
        self._carry = jax.jit(jax.vmap(self._begin, out_axes=self.axes))(self.seeds, initial)
        self._run = jax.jit(self._decisions, donate_argnums=0, compiler_options=loop_options())
        self._harvest = jax.jit(
            jax.vmap(self._look, in_axes=self.axes[:1], out_axes=(self.axes[0], -1)), donate_argnums=0
        )

    def advance(self, decisions: int) -> None:
        start, stop = jnp.uint32(self.decision), jnp.uint32(self.decision + decisions)
        self._carry = self._run(self._carry, start, stop)
        jax.block_until_ready(self._carry)
        self.decision += decisions

    @property
    def state(self) -> PyTree[np.ndarray]:
        cycle, world = seeds_first(self._carry, self.axes)
        return {"decision": np.array(self.decision), "cycle": cycle, "world": world}

    def restore(self, state: PyTree[np.ndarray]) -> None:
        fits(state, self.state)
        self._carry = seeds_last((state["cycle"], state["world"]), self.axes)
        self.decision = int(state["decision"])

    def harvest(self) -> Record:
        cycle, look = self._harvest(self._carry[0])
        self._carry = (cycle, self._carry[1])
        return seeds_first(look)

    def policies(self) -> Policy:
        return seeds_first(self.cycle.agent.kept(self._carry[0].agent))

    def use(self, policies: Policy, memory: Any = None) -> None:
        cycle, world = self._carry
        cycle = cycle._replace(agent=self.cycle.agent.use(cycle.agent, seeds_last(policies)))
        if memory is not None:
            adopt = jax.vmap(self._adopt, in_axes=(0, *self.axes, 0), out_axes=self.axes[0])
            cycle = jax.jit(adopt)(self.seeds, cycle, world, memory)
        self._carry = (cycle, world)

    def watch(self, look: Look) -> Callable[[], PyTree[np.ndarray]]:
        seen = jax.jit(jax.vmap(look, in_axes=self.axes))
        return lambda: jax.tree.map(np.array, seen(*self._carry))

    def _begin(self, seed: Array, own: Policy | None) -> Carry:
        state = self.world.reset(jax.random.uniform(key_of(seed, "start"), (self.world.reset_uniforms,)))
        return self.cycle.begin(self._fresh(seed, own), state, *self._start_numbers(seed)), state

    def _adopt(self, seed: Array, cycle: CycleState, state: Any, memory: Any) -> CycleState:
        return self.cycle.adopt(cycle, memory, state, *self._start_numbers(seed))

    def _decide(self, carry: Carry, numbers: dict[str, Array]) -> Carry:
        cycle, state = carry
        cycle = self.cycle.act(cycle, numbers["policy"])
        # The barrier keeps the compiler from stepping the world again for everything that depends on where it leads.
        state = jax.lax.optimization_barrier(self.world.step(state, cycle.action, numbers["world"]))
        cycle, ended = self.cycle.settle(cycle, state, numbers["observe"])
        if not isinstance(ended, bool):
            fresh = self.world.reset(numbers["reset"])
            state = jax.tree.map(lambda new, old: jnp.where(ended, new, old), fresh, state)
            cycle = self.cycle.restart(cycle, state, ended, numbers["memory"], numbers["look"])
        return cycle, state

    def _numbers(self, carry: Carry, block: Array) -> dict[str, Array]:
        """The random numbers of a block of decisions, by purpose."""
        world, task = self.world, self.task
        sizes = {"policy": self.policy.uniforms, "world": world.uniforms, "observe": task.uniforms}
        if self.cycle.restarts:
            sizes |= {"reset": world.reset_uniforms, "memory": task.init_uniforms, "look": task.uniforms}
        return {name: draw_block(self.seeds, name, block, size) for name, size in sizes.items()}

    def _decisions(self, carry: Carry, start: Array, stop: Array) -> Carry:
        """Decisions `start` … `stop` − 1, a block of random numbers at a time."""
        decide = jax.vmap(self._decide, in_axes=(self.axes, -1), out_axes=self.axes)

        def block(position: tuple[Array, Carry]) -> tuple[Array, Carry]:
            first, carry = position
            index = first // BLOCK
            numbers = self._numbers(carry, index)
            last = jnp.minimum(stop, (index + 1) * BLOCK)

            def decision(t: Array, carry: Carry) -> Carry:
                return decide(carry, {name: drawn[t % BLOCK] for name, drawn in numbers.items()})

            return last, jax.lax.fori_loop(first, last, decision, carry)

        return jax.lax.while_loop(lambda position: position[0] < stop, block, (start, carry))[1]
