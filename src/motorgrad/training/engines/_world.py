"""The engine for worlds: one compiled loop over decisions, mapped over seeds."""

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._compiler import loop_options, quick_options
from motorgrad._random import BLOCK, block_at, draw_block, key_of
from motorgrad.learning import Learner
from motorgrad.policies import Policy
from motorgrad.tasks import Task, outcome
from motorgrad.training.engines._cycle import CycleState, Mode
from motorgrad.training.engines._programs import shared
from motorgrad.training.engines._stepper import Program, Record, Stepper, View, fits, seeds_first, seeds_last
from motorgrad.training.engines._transition import Transition, Watcher, transition
from motorgrad.worlds import World

Carry = tuple[CycleState, Any]


class WorldProgram(Program):
    """The compiled functions of learning in a JAX world. Inside the loop seeds sit last, in the processor's lanes."""

    axes: ClassVar[Any] = (-1, -1)
    """Where the seeds are in the loop's state: one axis, or a tree of them."""

    def __init__(self, task: Task, agent: Learner, mode: Mode, first_episode: bool = False):
        super().__init__(task, agent, mode, first_episode=first_episode)
        assert isinstance(task.dynamics, World)
        self.world = task.dynamics
        seldom = functools.partial(jax.jit, compiler_options=quick_options())
        self.begin = seldom(jax.vmap(self._begin, out_axes=self.axes))
        self.run = jax.jit(self._decisions, donate_argnums=0, compiler_options=loop_options())
        self.harvest = seldom(
            jax.vmap(self.summarize, in_axes=self.axes[:1], out_axes=(self.axes[0], -1)), donate_argnums=0
        )
        self.resume = seldom(jax.vmap(self._resume, in_axes=(0, *self.axes, 0), out_axes=self.axes[0]))
        self.watch = jax.jit(self._watch, donate_argnums=0, compiler_options=loop_options())

    def _begin(self, seed: Array, numbers: Array, initial: Policy | None) -> Carry:
        state = self.world.reset(jax.random.uniform(key_of(seed, "start"), (self.world.reset_uniforms,)))
        agent = self.fresh(seed, numbers, initial)
        init, uniforms = self.start_numbers(seed)
        return self.cycle.observe(self.cycle.blank(agent, numbers, init), state, uniforms), state

    def _resume(self, seed: Array, cycle: CycleState, state: PyTree, memory: PyTree) -> CycleState:
        return self.cycle.resume_from(cycle, memory, state, *self.start_numbers(seed))

    def _decide(self, carry: Carry, uniforms: dict[str, Array]) -> Carry:
        return self._led(*self._acted(carry, uniforms), uniforms)

    def _decide_watched(self, carry: Carry, uniforms: dict[str, Array]) -> tuple[Carry, Transition]:
        """Make a decision. Also returns what it was."""
        cycle, state = self._acted(carry, uniforms)
        led = outcome(self.task, cycle.memory, state, cycle.action, uniforms["observe"], cycle.elapsed)
        return self._led(cycle, state, uniforms), transition(self.task, cycle, carry[1], state, led)

    def _acted(self, carry: Carry, uniforms: dict[str, Array]) -> Carry:
        """The state after an action and a step of the world."""
        cycle, state = carry
        cycle = self.cycle.act(cycle, uniforms["policy"])
        # The barrier keeps the compiler from stepping the world again for everything that depends on the new state.
        return cycle, jax.lax.optimization_barrier(self.world.step(state, cycle.action, uniforms["world"]))

    def _led(self, cycle: CycleState, state: PyTree, uniforms: dict[str, Array]) -> Carry:
        """The state after learning from what an action led to, where an episode has ended in the next one."""
        cycle, ended = self.cycle.learn(cycle, state, uniforms["observe"])
        if not isinstance(ended, bool):
            fresh = self.world.reset(uniforms["reset"])
            state = jax.tree.map(lambda new, old: jnp.where(ended, new, old), fresh, state)
            cycle = self.cycle.restart(cycle, state, ended, uniforms["memory"], uniforms["look"])
        return cycle, state

    def _draw(self, carry: Carry, seeds: Array, block: Array) -> dict[str, Array]:
        """The random numbers of a block of decisions, by purpose."""
        world, task = self.world, self.task
        sizes = {"policy": self.policy.uniforms, "world": world.uniforms, "observe": task.uniforms}
        if self.cycle.restarts:
            sizes |= {"reset": world.reset_uniforms, "memory": task.init_uniforms, "look": task.uniforms}
        return {name: draw_block(seeds, name, block, size) for name, size in sizes.items()}

    def _decisions(self, carry: Carry, seeds: Array, begun: Array, start: Array, stop: Array) -> Any:
        """Decisions `start` … `stop` − 1, with a block of random numbers at a time. They count from the first of block
        `begun`, because those of all blocks have more than 32 bits."""
        decide = jax.vmap(self._decide, in_axes=(self.axes, -1), out_axes=self.axes)

        def block(position: tuple[Array, Carry]) -> tuple[Array, Carry]:
            first, carry = position
            index = first // BLOCK
            uniforms = self._draw(carry, seeds, begun + index)
            last = jnp.minimum(stop, (index + 1) * BLOCK)

            def decision(t: Array, carry: Carry) -> Carry:
                return decide(carry, {name: drawn[t % BLOCK] for name, drawn in uniforms.items()})

            return last, jax.lax.fori_loop(first, last, decision, carry)

        return jax.lax.while_loop(lambda position: position[0] < stop, block, (start, carry))[1]

    def _watch(self, carry: Carry, seeds: Array, block: Array, first: Array, last: Array) -> tuple[Carry, Transition]:
        """Decisions `first` … `last` − 1 of a block, and what each was, at its place along a leading axis."""
        decide = jax.vmap(self._decide_watched, in_axes=(self.axes, -1), out_axes=(self.axes, -1))
        uniforms = self._draw(carry, seeds, block)

        def numbers(t: Array) -> dict[str, Array]:
            return {name: drawn[t] for name, drawn in uniforms.items()}

        shapes = jax.eval_shape(lambda: decide(carry, numbers(first))[1])
        room = jax.tree.map(lambda shape: jnp.zeros((BLOCK, *shape.shape), shape.dtype), shapes)

        def decision(t: Array, both: tuple[Carry, Transition]) -> tuple[Carry, Transition]:
            carry, seen = decide(both[0], numbers(t))
            return carry, jax.tree.map(lambda all, one: all.at[t].set(one), both[1], seen)

        return jax.lax.fori_loop(first, last, decision, (carry, room))


class WorldStepper(Stepper):
    """Learning in a JAX world."""

    program_type: ClassVar[type[WorldProgram]] = WorldProgram

    def __init__(
        self,
        task: Task,
        agent: Learner,
        seeds: Sequence[int],
        mode: Mode = "learn",
        initial: Policy | None = None,
        numbers: Mapping[str, Any] | None = None,
        first_episode: bool = False,
    ):
        super().__init__(task, agent, seeds, mode, initial, numbers)
        kind = self.program_type
        more = (mode, first_episode)
        self.program = shared(kind, task, agent, more, lambda: kind(task, agent, mode, first_episode))
        self.cycle, self._axes = self.program.cycle, self.program.axes
        self._carry = self.program.begin(self.seeds, self._start_vector, self._initial)
        self.watcher: Watcher | None = None
        """Called with every decision."""

    def advance(self, decisions: int) -> None:
        if self.watcher is not None:
            return self._advance_watched(decisions, self.watcher)
        begun, start = block_at(self.decision)
        self._carry = self.program.run(self._carry, self.seeds, *map(np.uint32, (begun, start, start + decisions)))
        jax.block_until_ready(self._carry)
        self.decision += decisions

    def _advance_watched(self, decisions: int, watcher: Watcher) -> None:
        last = self.decision + decisions
        while self.decision < last:
            block, first = block_at(self.decision)
            made = min(BLOCK - first, last - self.decision)
            place = np.uint32(block), np.int32(first), np.int32(first + made)
            self._carry, seen = self.program.watch(self._carry, self.seeds, *place)
            self.decision += made
            watcher({name: np.moveaxis(np.asarray(part[first : first + made]), -1, 1) for name, part in seen.items()})

    @property
    def state(self) -> PyTree[np.ndarray]:
        cycle, world = seeds_first(self._carry, self._axes)
        return {"decision": np.array(self.decision), "cycle": cycle, "world": world}

    def restore(self, state: PyTree[np.ndarray]) -> None:
        fits(state, self.state)
        self._carry = seeds_last((state["cycle"], state["world"]), self._axes)
        self.decision = int(state["decision"])

    def harvest(self) -> Record:
        cycle, found = self.program.harvest(self._carry[0])
        self._carry = (cycle, self._carry[1])
        return seeds_first(found)

    def policies(self) -> Policy:
        return seeds_first(self.cycle.acting(self.agent).final_policy(self._carry[0].agent))

    def set_policies(self, policies: Policy, memory: PyTree = None) -> None:
        cycle, world = self._carry
        cycle = cycle._replace(agent=self.cycle.acting(self.agent).set_policy(cycle.agent, seeds_last(policies)))
        if memory is not None:
            cycle = self.program.resume(self.seeds, cycle, world, memory)
        self._carry = (cycle, world)

    def set_actions(self, actions: np.ndarray) -> None:
        cycle, world = self._carry
        given = jnp.asarray(np.moveaxis(np.asarray(actions), 0, -1), cycle.action.dtype)
        self._carry = (cycle._replace(action=given.reshape(cycle.action.shape)), world)

    def viewer(self, view: View) -> Callable[[], PyTree[np.ndarray]]:
        viewed = jax.jit(jax.vmap(view, in_axes=self._axes))
        return lambda: jax.tree.map(np.array, viewed(*self._carry))

    def _put_number(self, place: int, value: float) -> None:
        cycle, world = self._carry
        numbers = np.array(cycle.numbers)  # seeds last
        numbers[place] = value
        self._carry = (cycle._replace(numbers=jnp.asarray(numbers)), world)
