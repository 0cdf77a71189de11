"""The engine for bodies: physics on the host for all seeds, and one compiled call per decision for everything else."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from motorgrad.bodies import BodyBatch
from motorgrad.learning import Agent
from motorgrad.policies import Policy
from motorgrad.tasks import BodyTask
from motorgrad.training._cycle import CycleState, Mode
from motorgrad.training._random import BLOCK, draw_block, key_of
from motorgrad.training._stepper import Record, Stepper

Numbers = dict[str, Float[Array, "decisions size seeds"]]


class BodyStepper(Stepper):
    """Learning in a MuJoCo body. Data cross once each way per decision, in one packed array.

    **Arguments:** as `Stepper`; `threads` that step the physics, 0 for one per processor.
    """

    def __init__(self, task: BodyTask, agent: Agent, seeds: Sequence[int], mode: Mode = "learn", threads: int = 0):
        super().__init__(task, agent, seeds, mode, diverges=True)
        self.batch = BodyBatch(task.dynamics, len(self.seeds), substeps=task.substeps, threads=threads)
        self._compile()
        self._block, self._numbers = -1, {}
        cycles = jax.jit(jax.vmap(self._begin, (0, 0, None)))(self.seeds, self.batch.packed, self.decision)
        self._structure = jax.tree.structure(cycles)
        self._leaves, self._out = self._first(jax.tree.leaves(cycles), self._drawn(), 0)

    @property
    def activation(self) -> Float[np.ndarray, "seeds groups"]:
        """The actions under way: what each group of muscles does until the next decision."""
        return np.asarray(self._out)[:, :-1]

    def advance(self, decisions: int) -> None:
        for _ in range(decisions):
            # Reading the action waits for the compiled call, so the batch never writes what the call still reads.
            self.batch.step(self.activation)
            self.decision += 1
            numbers, index = self._drawn(), self.decision % BLOCK
            self._leaves, self._out = self._next(self._leaves, self.batch.packed, numbers, index)
            ended = np.asarray(self._out)[:, -1] > 0
            if ended.any():
                self.batch.reset(np.flatnonzero(ended))
                self._leaves, self._out = self._again(self._leaves, self.batch.packed, ended, self._out, numbers, index)
        jax.block_until_ready(self._leaves)

    @property
    def state(self) -> PyTree[np.ndarray]:
        cycles = jax.tree.unflatten(self._structure, self._leaves)
        return jax.tree.map(np.array, {"cycle": cycles, "action": self._out, "physics": self.batch.snapshot()})

    def restore(self, state: PyTree[np.ndarray]) -> None:
        self.batch.restore(state["physics"])
        self._leaves = [jnp.array(leaf) for leaf in jax.tree.leaves(state["cycle"])]
        self._out = jnp.array(state["action"])
        self._block = -1

    def harvest(self) -> Record:
        self._leaves, look = self._harvest(self._leaves)
        return jax.tree.map(np.array, look)

    def policies(self) -> Policy:
        return jax.tree.map(np.array, jax.tree.unflatten(self._structure, self._leaves).agent.policy)

    def use(self, policies: Policy) -> None:
        cycles = jax.tree.unflatten(self._structure, self._leaves)
        cycles = cycles._replace(agent=cycles.agent._replace(policy=jax.tree.map(jnp.array, policies)))
        self._leaves, self._out = self._first(jax.tree.leaves(cycles), self._drawn(), self.decision % BLOCK)

    def _drawn(self) -> Numbers:
        """The random numbers of the present block of decisions."""
        block = self.decision // BLOCK
        if block != self._block:
            self._block, self._numbers = block, self._draw(np.uint32(block))
        return self._numbers

    def _compile(self) -> None:
        """The compiled calls. Learners cross the border as a flat list: taking the pytree apart would cost more time
        than the learning itself."""
        sizes = {"policy": self.policy.uniforms, "observe": self.task.uniforms}
        sizes |= {"memory": self.task.init_uniforms, "look": self.task.uniforms}

        def pick(numbers: Numbers, index: Any) -> dict[str, Float[Array, "size seeds"]]:
            return {name: drawn[index] for name, drawn in numbers.items()}

        def cycles_of(leaves: list[Array]) -> CycleState:
            return jax.tree.unflatten(self._structure, leaves)

        def first(leaves: list[Array], numbers: Numbers, index: Any) -> tuple[list[Array], Array]:
            cycles, out = jax.vmap(self._act, (0, -1))(cycles_of(leaves), pick(numbers, index))
            return jax.tree.leaves(cycles), out

        def following(leaves: list[Array], packed: Array, numbers: Numbers, index: Any) -> tuple[list[Array], Array]:
            cycles, out = jax.vmap(self._settle_and_act, (0, 0, -1))(cycles_of(leaves), packed, pick(numbers, index))
            return jax.tree.leaves(cycles), out

        def again(
            leaves: list[Array], packed: Array, ended: Array, out: Array, numbers: Numbers, index: Any
        ) -> tuple[list[Array], Array]:
            run = jax.vmap(self._restart_and_act, (0, 0, 0, 0, -1))
            cycles, out = run(cycles_of(leaves), packed, ended, out, pick(numbers, index))
            return jax.tree.leaves(cycles), out

        def harvest(leaves: list[Array]) -> tuple[list[Array], dict[str, Array]]:
            cycles, look = jax.vmap(self._look)(cycles_of(leaves))
            return jax.tree.leaves(cycles), look

        self._draw = jax.jit(
            lambda block: {name: draw_block(self.seeds, name, block, size) for name, size in sizes.items()}
        )
        self._first = jax.jit(first, donate_argnums=0)
        self._next = jax.jit(following, donate_argnums=0)
        self._again = jax.jit(again, donate_argnums=0)
        self._harvest = jax.jit(harvest, donate_argnums=0)

    def _begin(self, seed: Array, packed: Array, decision: int) -> CycleState:
        task = self.task
        init, look = (
            jax.random.uniform(key_of(seed, name), (size,))
            for name, size in (("start-memory", task.init_uniforms), ("start-look", task.uniforms))
        )
        return self.cycle.begin(
            self.cycle.agent.init(key_of(seed, "initial")), self.batch.unpack(packed), init, look
        )

    def _act(self, cycle: CycleState, numbers: dict[str, Array]) -> tuple[CycleState, Array]:
        cycle = self.cycle.act(cycle, numbers["policy"])
        return cycle, jnp.append(cycle.action, 0.0)

    def _settle_and_act(self, cycle: CycleState, packed: Array, numbers: dict[str, Array]) -> tuple[CycleState, Array]:
        diverged = packed[-1] > 0
        cycle, ended = self.cycle.settle(cycle, self.batch.unpack(packed), numbers["observe"], diverged)
        cycle = self.cycle.act(cycle, numbers["policy"])
        return cycle, jnp.append(cycle.action, ended)

    def _restart_and_act(
        self, cycle: CycleState, packed: Array, ended: Bool[Array, ""], out: Array, numbers: dict[str, Array]
    ) -> tuple[CycleState, Array]:
        """Where an episode has ended, the action already chosen is taken back and chosen again on the new start."""
        state = self.batch.unpack(packed)
        fresh = self.cycle.restart(cycle, state, ended, numbers["memory"], numbers["look"])
        fresh = fresh._replace(agent=self.cycle.agent.restart(fresh.agent, ended))
        fresh, action = self._act(fresh, numbers)
        return jax.tree.map(lambda new, old: jnp.where(ended, new, old), (fresh, action), (cycle, out))
