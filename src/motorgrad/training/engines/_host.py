"""Engines whose dynamics run on the host for all seeds, with one compiled call per decision for everything else."""

import functools
import threading
from collections.abc import Callable, Mapping, Sequence, Set
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from motorgrad._compiler import in_one_piece
from motorgrad._random import BLOCK, draw_block
from motorgrad.bodies import BodyBatch
from motorgrad.learning import Agent
from motorgrad.policies import Policy
from motorgrad.tasks import HostTask, Task
from motorgrad.training.engines._cycle import CycleState, Mode
from motorgrad.training.engines._packing import Packed, Packing
from motorgrad.training.engines._programs import shared
from motorgrad.training.engines._stepper import Program, Record, Stepper, View, fits

Uniforms = dict[str, Float[Array, " size"]]

_alone = threading.Lock()
"""Held while compiled code runs: two threads of ours in XLA at once can leave its own threads waiting for ever."""


class HostProgram(Program):
    """The compiled functions of a `HostStepper`, each for all seeds. Several threads may call them.

    **Arguments:** as `Program`; an `example` of the batch, for the layout of its rows; how many `seeds` at most;
    whether policies to begin from are `given`.
    """

    task: HostTask

    def __init__(self, task: HostTask, agent: Agent, mode: Mode, example: Any, seeds: int, given: Any):
        super().__init__(task, agent, mode, diverges=True)
        self._unpack_row = example.unpack
        row = jnp.asarray(example.packed[0])
        width = len(row)
        numbers = jnp.asarray(self.cycle.numbers.vector(agent.hyperparameters, agent.precision))
        begun = jax.eval_shape(self._begin, jnp.int32(0), numbers, row, given)
        sizes = {"policy": self.policy.uniforms, "observe": task.uniforms}
        self.sizes = sizes | {"memory": task.init_uniforms, "look": task.uniforms}
        self._ends = np.cumsum([width, *self.sizes.values()])
        self._width = width
        uniforms = {name: jnp.zeros(size) for name, size in self.sizes.items()}
        packing = Packing(begun, seeds, self._still(begun, row, uniforms) if self.cycle.rests else ())
        pack, unpack = packing.pack, packing.unpack

        @jax.jit
        def drawn(seeds: Array, block: Array) -> Float[Array, "decisions seeds size"]:
            parts = [draw_block(seeds, name, block, size) for name, size in self.sizes.items()]
            return jnp.swapaxes(jnp.concatenate(parts, axis=1), 1, 2)

        def harvest(cycle: Packed) -> tuple[Packed, dict[str, Array]]:
            state, found = self.summarize(unpack(cycle))
            return pack(state), found

        def view(view: View) -> Any:
            one = jax.vmap(lambda cycle, row: view(cycle, self._unpack_row(row)))
            return jax.jit(lambda cycles, rows: one(jax.vmap(unpack)(cycles), rows))

        compiled = functools.partial(self._over_seeds, packing)
        self._drawn = drawn
        self.pack = jax.jit(jax.vmap(pack))
        self.unpack = jax.jit(jax.vmap(unpack))
        self.start = jax.jit(jax.vmap(lambda seed, n, row, own: pack(self._begin(seed, n, row, own))))
        self.first = compiled(self._act)
        self.learn = compiled(self._learn_and_act)
        self.learn_resting = compiled(functools.partial(self._learn_and_act, resting=True), packing.still)
        self._copy = jax.jit(lambda cycles: jax.tree.map(jnp.copy, cycles))
        self._merge = jax.jit(jax.vmap(lambda one, x, y: jax.tree.map(lambda a, b: jnp.where(one, a, b), x, y)))
        self.again = compiled(self._restart_and_act)
        self.harvest = jax.jit(jax.vmap(harvest), donate_argnums=0)
        self.with_rest = jax.jit(jax.vmap(lambda cycle, row: jnp.append(row, self._rest(unpack(cycle), row.dtype))))
        self.resume = jax.jit(jax.vmap(self._resume))
        self.viewer = view

    def draw(self, seeds: np.ndarray, block: int) -> Float[np.ndarray, "decisions seeds size"]:
        """The random numbers of a block of decisions, those of all purposes side by side."""
        with _alone:
            return np.asarray(self._drawn(seeds, np.uint32(block)))

    def first_numbers(self, seeds: np.ndarray) -> Float[np.ndarray, "seeds size"]:
        """The random numbers of all seeds for the start of their first episode."""
        with _alone:
            return np.asarray(jax.vmap(self.start_memory)(jnp.asarray(seeds)))

    def learn_each(self, cycles: Packed, resting: Bool[np.ndarray, " seeds"], row: Any) -> tuple[Packed, np.ndarray]:
        """Learn from one decision, where `resting` by the shorter program.

        The two may round differently. So a seed's program depends on itself alone, and both run where seeds differ, as
        they do after one of them has diverged.
        """
        if resting.all():
            return self.learn_resting(cycles, row)
        if not resting.any():
            return self.learn(cycles, row)
        with _alone:
            spare = self._copy(cycles)  # the first call uses up its input
        rested, due = self.learn_resting(spare, row), self.learn(cycles, row)
        with _alone:
            cycles = jax.block_until_ready(self._merge(resting, rested[0], due[0]))
        return cycles, np.where(resting[:, None], rested[1], due[1])

    def _over_seeds(self, packing: Packing, function: Any, still: Set[str] = frozenset()) -> Any:
        """`function(cycle, packed, uniforms, *rest) -> (cycle, out)` compiled for all seeds. It does not change the
        arrays named in `still`, so they need not come back."""
        pack, unpack, width = packing.pack, packing.unpack, self._width

        def one(moving: Packed, still: Packed, row: Array, *rest: Any) -> tuple[Packed, Array]:
            uniforms = dict(zip(self.sizes, jnp.split(row, self._ends)[1:], strict=False))
            after, out = function(unpack(moving | still), row[:width], uniforms, *rest)
            after = pack(after)
            return {name: after[name] for name in moving}, out

        compiled = in_one_piece(jax.vmap(one))

        def in_turn(moving: Packed, still: Packed, *rest: Any) -> tuple[Packed, np.ndarray]:
            with _alone:
                moving, out = compiled(moving, still, *rest)
                return moving, np.asarray(out)  # waits for the call, which reads its input in place

        def call(cycles: Packed, *rest: Any) -> tuple[Packed, np.ndarray]:
            if not still:
                return in_turn(cycles, {}, *rest)
            moving = {name: part for name, part in cycles.items() if name not in still}
            moving, out = in_turn(moving, {name: cycles[name] for name in still}, *rest)
            return cycles | moving, out

        return call

    def _still(self, example: CycleState, row: Array, uniforms: Uniforms) -> list[int]:
        """The leaves of a cycle that a decision learned from resting returns unchanged."""
        still: list[int] = []

        def learn(cycle: CycleState, row: Array) -> None:
            after = self._learn_and_act(cycle, row, uniforms, True)[0]
            pairs = zip(jax.tree.leaves(cycle), jax.tree.leaves(after), strict=True)
            still.extend(index for index, (before, after) in enumerate(pairs) if after is before)

        jax.eval_shape(learn, example, row)
        return still

    def _begin(self, seed: Array, numbers: Array, row: Array, own: Policy | None) -> CycleState:
        agent = self.fresh(seed, numbers, own)
        return self.cycle.begin(agent, numbers, self._unpack_row(row), *self.start_numbers(seed))

    def _resume(self, seed: Array, cycle: CycleState, row: Array, memory: Any) -> CycleState:
        return self.cycle.resume_from(cycle, memory, self._unpack_row(row), *self.start_numbers(seed))

    def _act(self, cycle: CycleState, row: Array, uniforms: Uniforms) -> tuple[CycleState, Array]:
        cycle = self.cycle.act(cycle, uniforms["policy"])
        return cycle, self._out_row(cycle, 0.0)

    def _learn_and_act(
        self, cycle: CycleState, row: Array, uniforms: Uniforms, resting: bool = False
    ) -> tuple[CycleState, Array]:
        diverged = row[-1] > 0
        cycle, ended = self.cycle.learn(cycle, self._unpack_row(row), uniforms["observe"], diverged, resting)
        cycle = self.cycle.act(cycle, uniforms["policy"])
        return cycle, self._out_row(cycle, ended)

    def _restart_and_act(
        self, cycle: CycleState, row: Array, uniforms: Uniforms, ended: Bool[Array, ""], out: Array
    ) -> tuple[CycleState, Array]:
        """Where an episode has `ended`, the action already chosen is discarded and chosen again on the new start."""
        state = self._unpack_row(row)
        fresh = self.cycle.restart(cycle, state, ended, uniforms["memory"], uniforms["look"])
        fresh = fresh._replace(agent=self.cycle.learner(cycle).restart(fresh.agent, ended))
        fresh, action = self._act(fresh, row, uniforms)
        return jax.tree.map(lambda new, old: jnp.where(ended, new, old), (fresh, action), (cycle, out))

    def _out_row(self, cycle: CycleState, ended: Any) -> Float[Array, " size"]:
        """What crosses to the host: the control of the dynamics, whether the episode has ended, and how many decisions
        can be learned from resting."""
        control = jnp.asarray(self.task.control(cycle.action, cycle.memory), jnp.result_type(float))
        ends = jnp.asarray(ended, control.dtype)
        return jnp.append(control, jnp.stack([ends, self._rest(cycle, control.dtype)]))

    def _rest(self, cycle: CycleState, dtype: Any) -> Array:
        most = 2**24  # whole numbers up to which single precision is exact
        return jnp.minimum(self.cycle.rest(cycle), most).astype(dtype)


class HostStepper(Stepper):
    """Learning in dynamics on the host: Gymnasium environments, and bodies (`BodyStepper`).

    Data cross once each way per decision, in packed arrays.

    **Arguments:** as `Stepper`; `threads` that step the dynamics, 0 for one per processor, where they can use them;
    `room`, for how many seeds the shared program is made, by default as many as there are.
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
        numbers: Mapping[str, Any] | None = None,
        room: int = 0,
    ):
        super().__init__(cast(Task, task), agent, seeds, mode, initial, numbers)
        self.batch = task.batch(list(map(int, self.seeds)), threads)
        given = jax.tree.map(lambda leaf: leaf[0], self._initial)
        room = max(room, len(self.seeds))
        more = (mode, room, self.batch.packed.shape[1], given is None)
        self.program = shared(
            HostProgram, task, agent, more, lambda: HostProgram(task, agent, mode, self.batch, room, given)
        )
        self.cycle = self.program.cycle
        width, drawn = self.batch.packed.shape[1], sum(self.program.sizes.values())
        self._seen = np.empty((len(self.seeds), width + drawn), np.float32)
        self._dynamics, self._chance = self._seen[:, :width], self._seen[:, width:]
        self._block, self._drawn = -1, np.empty(0)
        first = sum(self.program.sizes[name] for name in ("policy", "observe"))
        self._for_memory = self._chance[:, first : first + task.init_uniforms]
        if task.init_uniforms and (start := task.begin(self.program.first_numbers(self.seeds))):
            self.batch.reset(None, **start)
        self.ended: np.ndarray | None = None
        """Where an episode ended at the last decision, the packed rows as they were before the reset."""
        cycles = self.program.start(self.seeds, self._start_vector, self.batch.packed, self._initial)
        self._cycles, self._out = self.program.first(cycles, self._input())

    def advance(self, decisions: int) -> None:
        program, rests, has_episodes = self.program, self.cycle.rests, self.task.has_episodes
        for _ in range(decisions):
            rest = self._out[:, -1] > 0
            self.batch.step(self._out[:, :-2])
            self.decision += 1
            if rests:
                self._cycles, self._out = program.learn_each(self._cycles, rest, self._input())
            else:
                self._cycles, self._out = program.learn(self._cycles, self._input())
            self.ended = None
            if (has_episodes or self.batch.lost) and np.count_nonzero(self._out[:, -2]):
                ended = self._out[:, -2] > 0
                self.ended = self.batch.packed.copy()
                rows = np.flatnonzero(ended)
                self.batch.reset(rows, **self.task.begin(self._for_memory[rows]))
                self._cycles, self._out = program.again(self._cycles, self._input(), ended, self._out)

    @property
    def state(self) -> PyTree[np.ndarray]:
        cycle = self.program.unpack(self._cycles)
        # How long it may rest follows from the cycle and the mode, so it is not kept.
        parts = {"cycle": cycle, "action": self._out[:, :-1], "physics": self.batch.snapshot()}
        return jax.tree.map(np.array, {"decision": self.decision, **parts})

    def restore(self, state: PyTree[np.ndarray]) -> None:
        fits(state, self.state)
        self.batch.restore(state["physics"])
        self._cycles = self.program.pack(state["cycle"])
        self._out = np.asarray(self.program.with_rest(self._cycles, jnp.array(state["action"])))
        self.decision = int(state["decision"])

    def harvest(self) -> Record:
        self._cycles, found = self.program.harvest(self._cycles)
        return jax.tree.map(np.array, found)

    def policies(self) -> Policy:
        return jax.tree.map(np.array, self.agent.final_policy(self.program.unpack(self._cycles).agent))

    def set_policies(self, policies: Policy, memory: Any = None) -> None:
        cycles = self.program.unpack(self._cycles)
        cycles = cycles._replace(agent=self.agent.set_policy(cycles.agent, jax.tree.map(jnp.array, policies)))
        if memory is not None:
            cycles = self.program.resume(self.seeds, cycles, jnp.array(self.batch.packed), memory)
        if self.mode == "learn":  # the present action has its score in the trace; the next is the new policy's
            self._cycles = self.program.pack(cycles)
        else:
            self._cycles, self._out = self.program.first(self.program.pack(cycles), self._input())

    def viewer(self, view: View) -> Callable[[], PyTree[np.ndarray]]:
        viewed = self.program.viewer(view)
        return lambda: jax.tree.map(np.array, viewed(self._cycles, self.batch.packed))

    def set_number(self, path: str, value: float) -> None:
        place = self._checked_place(path, value)
        cycles = self.program.unpack(self._cycles)
        numbers = np.array(cycles.numbers)
        numbers[:, place] = value
        self._cycles = self.program.pack(cycles._replace(numbers=jnp.asarray(numbers)))

    def _input(self) -> Float[np.ndarray, "seeds width"]:
        """What the compiled call reads for the present decision: the dynamics' packed rows, then random numbers."""
        block = self.decision // BLOCK
        if block != self._block:
            self._block, self._drawn = block, self.program.draw(self.seeds, block)
        self._dynamics[...] = self.batch.packed
        self._chance[...] = self._drawn[self.decision % BLOCK]
        return self._seen


class BodyStepper(HostStepper):
    """Learning in a MuJoCo body: a `HostStepper` whose actions can be read."""

    batch: BodyBatch

    @property
    def activation(self) -> Float[np.ndarray, "seeds groups"]:
        """The present actions: what each group of muscles does until the next decision."""
        return self._out[:, : len(self.batch.groups)]
