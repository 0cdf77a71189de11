"""Engines whose dynamics run on the host for all seeds, and one compiled call per decision for everything else."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from motorgrad.learning import Agent
from motorgrad.policies import Policy
from motorgrad.tasks import HostTask
from motorgrad.training._cycle import CycleState, Mode
from motorgrad.training._packing import Packed, Packing
from motorgrad.training._random import BLOCK, draw_block
from motorgrad.training._stepper import Look, Record, Stepper, fits

Numbers = dict[str, Float[Array, " size"]]


class HostStepper(Stepper):
    """Learning in dynamics on the host: Gymnasium environments, and bodies (`BodyStepper`). Data cross once each way
    per decision, in packed arrays.

    **Arguments:** as `Stepper`; `threads` that step the dynamics, 0 for one per processor, where they can use them.
    """

    task: HostTask

    def __init__(
        self,
        task: HostTask,
        agent: Agent,
        seeds: Sequence[int],
        mode: Mode = "learn",
        threads: int = 0,
        initial: Policy | None = None,
    ):
        super().__init__(task, agent, seeds, mode, diverges=True)
        self.batch = task.batch(list(map(int, self.seeds)), threads)
        own = jax.tree.map(lambda leaf: leaf[0], initial)
        self._packing = Packing(jax.eval_shape(self._begin, jnp.int32(0), jnp.asarray(self.batch.packed[0]), own))
        self._compile()
        self._block, self._drawn = -1, np.empty(0)
        self.ended: np.ndarray | None = None
        """Where an episode ended at the last decision, the packed rows as they were before the reset."""
        cycles = self._start(self.seeds, self.batch.packed, initial)
        self._cycles, self._out = self._first(cycles, self._input())

    def advance(self, decisions: int) -> None:
        out, has_episodes = np.asarray(self._out), self.task.has_episodes
        for _ in range(decisions):
            self.batch.step(out[:, :-1])
            self.decision += 1
            seen = self._input()
            self._cycles, self._out = self._next(self._cycles, seen)
            # Waits for the compiled call, which reads `seen` in place.
            out = np.asarray(self._out)
            self.ended = None
            if (has_episodes or self.batch.lost) and np.count_nonzero(out[:, -1]):
                ended = out[:, -1] > 0
                self.ended = self.batch.packed.copy()
                self.batch.reset(np.flatnonzero(ended))
                self._cycles, self._out = self._again(self._cycles, self._input(), ended, self._out)
                out = np.asarray(self._out)

    @property
    def state(self) -> PyTree[np.ndarray]:
        cycle = self._unpack(self._cycles)
        parts = {"cycle": cycle, "action": self._out, "physics": self.batch.snapshot()}
        return jax.tree.map(np.array, {"decision": self.decision, **parts})

    def restore(self, state: PyTree[np.ndarray]) -> None:
        fits(state, self.state)
        self.batch.restore(state["physics"])
        self._cycles = self._pack(state["cycle"])
        self._out = jnp.array(state["action"])
        self.decision = int(state["decision"])

    def harvest(self) -> Record:
        self._cycles, look = self._harvest(self._cycles)
        return jax.tree.map(np.array, look)

    def policies(self) -> Policy:
        return jax.tree.map(np.array, self.cycle.agent.kept(self._unpack(self._cycles).agent))

    def use(self, policies: Policy, memory: Any = None) -> None:
        cycles = self._unpack(self._cycles)
        cycles = cycles._replace(agent=self.cycle.agent.use(cycles.agent, jax.tree.map(jnp.array, policies)))
        if memory is not None:
            cycles = jax.jit(jax.vmap(self._adopt))(self.seeds, cycles, jnp.array(self.batch.packed), memory)
        if self.cycle.mode == "learn":  # the action under way has its score in the trace; the next is the new policy's
            self._cycles = self._pack(cycles)
        else:
            self._cycles, self._out = self._first(self._pack(cycles), self._input())

    def watch(self, look: Look) -> Callable[[], PyTree[np.ndarray]]:
        unpack = self._packing.unpack
        seen = jax.jit(jax.vmap(lambda cycle, packed: look(unpack(cycle), self.batch.unpack(packed))))
        return lambda: jax.tree.map(np.array, seen(self._cycles, self.batch.packed))

    def _input(self) -> Float[np.ndarray, "seeds width"]:
        """What the compiled call reads for the present decision: the dynamics' packed rows, then random numbers."""
        block = self.decision // BLOCK
        if block != self._block:
            self._block, self._drawn = block, np.asarray(self._draw(np.uint32(block)))
        self._dynamics[...] = self.batch.packed
        self._chance[...] = self._drawn[self.decision % BLOCK]
        return self._seen

    def _compile(self) -> None:
        """Map the functions of one seed below over all seeds, packed outside and unpacked inside."""
        task, width = self.task, self.batch.packed.shape[1]
        sizes = {"policy": self.policy.uniforms, "observe": task.uniforms}
        sizes |= {"memory": task.init_uniforms, "look": task.uniforms}
        ends = np.cumsum([width, *sizes.values()])
        pack, unpack = self._packing.pack, self._packing.unpack

        def draw(block: Array) -> Float[Array, "decisions seeds size"]:
            drawn = [draw_block(self.seeds, name, block, size) for name, size in sizes.items()]
            return jnp.swapaxes(jnp.concatenate(drawn, axis=1), 1, 2)

        def over_seeds(function: Any) -> Any:
            """`function(cycle, packed, numbers, *rest) -> (cycle, out)` compiled for all seeds."""

            def one(cycle: Packed, seen: Array, *rest: Any) -> tuple[Packed, Array]:
                numbers = dict(zip(sizes, jnp.split(seen, ends)[1:], strict=False))
                after, out = function(unpack(cycle), seen[:width], numbers, *rest)
                return pack(after), out

            return jax.jit(jax.vmap(one), donate_argnums=0)

        def harvest(cycle: Packed) -> tuple[Packed, dict[str, Array]]:
            state, look = self._look(unpack(cycle))
            return pack(state), look

        self._seen = np.empty((len(self.seeds), ends[-1]), np.float32)
        self._dynamics, self._chance = self._seen[:, :width], self._seen[:, width:]
        self._draw = jax.jit(draw)
        self._pack, self._unpack = jax.jit(jax.vmap(pack)), jax.jit(jax.vmap(unpack))
        self._start = jax.jit(jax.vmap(lambda seed, packed, own: pack(self._begin(seed, packed, own))))
        self._first = over_seeds(self._act)
        self._next = over_seeds(self._settle_and_act)
        self._again = over_seeds(self._restart_and_act)
        self._harvest = jax.jit(jax.vmap(harvest), donate_argnums=0)

    def _begin(self, seed: Array, packed: Array, own: Policy | None) -> CycleState:
        return self.cycle.begin(self._fresh(seed, own), self.batch.unpack(packed), *self._start_numbers(seed))

    def _adopt(self, seed: Array, cycle: CycleState, packed: Array, memory: Any) -> CycleState:
        return self.cycle.adopt(cycle, memory, self.batch.unpack(packed), *self._start_numbers(seed))

    def _act(self, cycle: CycleState, packed: Array, numbers: Numbers) -> tuple[CycleState, Array]:
        cycle = self.cycle.act(cycle, numbers["policy"])
        return cycle, _row(self.task.control(cycle.action, cycle.memory), 0.0)

    def _settle_and_act(self, cycle: CycleState, packed: Array, numbers: Numbers) -> tuple[CycleState, Array]:
        diverged = packed[-1] > 0
        cycle, ended = self.cycle.settle(cycle, self.batch.unpack(packed), numbers["observe"], diverged)
        cycle = self.cycle.act(cycle, numbers["policy"])
        return cycle, _row(self.task.control(cycle.action, cycle.memory), ended)

    def _restart_and_act(
        self, cycle: CycleState, packed: Array, numbers: Numbers, ended: Bool[Array, ""], out: Array
    ) -> tuple[CycleState, Array]:
        """Where an episode has `ended`, the action already chosen is taken back and chosen again on the new start."""
        state = self.batch.unpack(packed)
        fresh = self.cycle.restart(cycle, state, ended, numbers["memory"], numbers["look"])
        fresh = fresh._replace(agent=self.cycle.agent.restart(fresh.agent, ended))
        fresh, action = self._act(fresh, packed, numbers)
        return jax.tree.map(lambda new, old: jnp.where(ended, new, old), (fresh, action), (cycle, out))


def _row(control: Array, ended: Any) -> Float[Array, " size"]:
    """What crosses to the host: the numbers that the dynamics are told, then whether the episode has ended."""
    return jnp.append(jnp.asarray(control, jnp.result_type(float)), ended)
