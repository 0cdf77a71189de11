"""Engines whose dynamics run on the host for all seeds, and one compiled call per decision for everything else."""

import functools
import threading
from collections.abc import Callable, Sequence, Set
from typing import Any, NamedTuple, Self

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from motorgrad._compiler import in_one_piece
from motorgrad._random import BLOCK, draw_block
from motorgrad.learning import Agent
from motorgrad.policies import Policy
from motorgrad.tasks import HostTask
from motorgrad.training._cycle import CycleState, Mode
from motorgrad.training._packing import Packed, Packing
from motorgrad.training._stepper import Look, Record, Stepper, fits

Numbers = dict[str, Float[Array, " size"]]


class Compiled(NamedTuple):
    """The functions of a `HostStepper`, each for all seeds. Other engines of the same task, agent and mode may call
    them too: `draw`, and what makes a decision, from other threads as well."""

    sizes: dict[str, int]
    draw: Callable[[np.ndarray, int], np.ndarray]
    pack: Callable[..., Packed]
    unpack: Callable[..., CycleState]
    start: Callable[..., Packed]
    first: Callable[..., tuple[Packed, np.ndarray]]
    settle: Callable[..., tuple[Packed, np.ndarray]]
    settle_resting: Callable[..., tuple[Packed, np.ndarray]]
    again: Callable[..., tuple[Packed, np.ndarray]]
    harvest: Callable[..., tuple[Packed, dict[str, Array]]]
    with_rest: Callable[..., Array]


class HostStepper(Stepper):
    """Learning in dynamics on the host: Gymnasium environments, and bodies (`BodyStepper`). Data cross once each way
    per decision, in packed arrays.

    **Arguments:** as `Stepper`; `threads` that step the dynamics, 0 for one per processor, where they can use them;
    `like`, an engine of the same task, agent and mode and at least as many seeds, whose compiled functions this one is
    to call as well.
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
        like: Self | None = None,
    ):
        super().__init__(task, agent, seeds, mode, diverges=True)
        self.batch = task.batch(list(map(int, self.seeds)), threads)
        own = jax.tree.map(lambda leaf: leaf[0], initial)
        begun = jax.eval_shape(self._begin, jnp.int32(0), jnp.asarray(self.batch.packed[0]), own)
        self._call = self._compile(begun) if like is None else like._call
        width, drawn = self.batch.packed.shape[1], sum(self._call.sizes.values())
        self._seen = np.empty((len(self.seeds), width + drawn), np.float32)
        self._dynamics, self._chance = self._seen[:, :width], self._seen[:, width:]
        self._block, self._drawn = -1, np.empty(0)
        self.ended: np.ndarray | None = None
        """Where an episode ended at the last decision, the packed rows as they were before the reset."""
        cycles = self._call.start(self.seeds, self.batch.packed, initial)
        self._cycles, self._out = self._call.first(cycles, self._input())

    def advance(self, decisions: int) -> None:
        rests, has_episodes = self.cycle.rests, self.task.has_episodes
        for _ in range(decisions):
            resting = rests and self._out[:, -1].min() > 0
            self.batch.step(self._out[:, :-2])
            self.decision += 1
            settle = self._call.settle_resting if resting else self._call.settle
            self._cycles, self._out = settle(self._cycles, self._input())
            self.ended = None
            if (has_episodes or self.batch.lost) and np.count_nonzero(self._out[:, -2]):
                ended = self._out[:, -2] > 0
                self.ended = self.batch.packed.copy()
                self.batch.reset(np.flatnonzero(ended))
                self._cycles, self._out = self._call.again(self._cycles, self._input(), ended, self._out)

    @property
    def state(self) -> PyTree[np.ndarray]:
        cycle = self._call.unpack(self._cycles)
        # How long it may rest follows from the cycle, and from whether this engine learns: it is not kept.
        parts = {"cycle": cycle, "action": self._out[:, :-1], "physics": self.batch.snapshot()}
        return jax.tree.map(np.array, {"decision": self.decision, **parts})

    def restore(self, state: PyTree[np.ndarray]) -> None:
        fits(state, self.state)
        self.batch.restore(state["physics"])
        self._cycles = self._call.pack(state["cycle"])
        self._out = np.asarray(self._call.with_rest(self._cycles, jnp.array(state["action"])))
        self.decision = int(state["decision"])

    def harvest(self) -> Record:
        self._cycles, look = self._call.harvest(self._cycles)
        return jax.tree.map(np.array, look)

    def policies(self) -> Policy:
        return jax.tree.map(np.array, self.cycle.agent.kept(self._call.unpack(self._cycles).agent))

    def use(self, policies: Policy, memory: Any = None) -> None:
        cycles = self._call.unpack(self._cycles)
        cycles = cycles._replace(agent=self.cycle.agent.use(cycles.agent, jax.tree.map(jnp.array, policies)))
        if memory is not None:
            cycles = jax.jit(jax.vmap(self._adopt))(self.seeds, cycles, jnp.array(self.batch.packed), memory)
        if self.cycle.mode == "learn":  # the action under way has its score in the trace; the next is the new policy's
            self._cycles = self._call.pack(cycles)
        else:
            self._cycles, self._out = self._call.first(self._call.pack(cycles), self._input())

    def watch(self, look: Look) -> Callable[[], PyTree[np.ndarray]]:
        one = jax.vmap(lambda cycle, packed: look(cycle, self.batch.unpack(packed)))
        seen = jax.jit(lambda cycles, packed: one(self._call.unpack(cycles), packed))
        return lambda: jax.tree.map(np.array, seen(self._cycles, self.batch.packed))

    def _input(self) -> Float[np.ndarray, "seeds width"]:
        """What the compiled call reads for the present decision: the dynamics' packed rows, then random numbers."""
        block = self.decision // BLOCK
        if block != self._block:
            self._block, self._drawn = block, self._call.draw(self.seeds, block)
        self._dynamics[...] = self.batch.packed
        self._chance[...] = self._drawn[self.decision % BLOCK]
        return self._seen

    def _compile(self, example: CycleState) -> Compiled:
        """Map the functions of one seed below over all seeds, packed outside and unpacked inside."""
        task, width = self.task, self.batch.packed.shape[1]
        sizes = {"policy": self.policy.uniforms, "observe": task.uniforms}
        sizes |= {"memory": task.init_uniforms, "look": task.uniforms}
        ends = np.cumsum([width, *sizes.values()])
        numbers = {name: jnp.zeros(size) for name, size in sizes.items()}
        packing = Packing(example, len(self.seeds), self._still(example, numbers) if self.cycle.rests else ())
        pack, unpack = packing.pack, packing.unpack

        alone = threading.Lock()  # XLA's own threads can wait for each other for ever where two of ours call it at once

        @jax.jit
        def drawn(seeds: Array, block: Array) -> Float[Array, "decisions seeds size"]:
            parts = [draw_block(seeds, name, block, size) for name, size in sizes.items()]
            return jnp.swapaxes(jnp.concatenate(parts, axis=1), 1, 2)

        def draw(seeds: np.ndarray, block: int) -> Float[np.ndarray, "decisions seeds size"]:
            with alone:
                return np.asarray(drawn(seeds, np.uint32(block)))

        def over_seeds(function: Any, still: Set[str] = frozenset()) -> Any:
            """`function(cycle, packed, numbers, *rest) -> (cycle, out)` compiled for all seeds. Arrays of the names in
            `still` it hands on as they are, so they need not come back."""

            def one(moving: Packed, still: Packed, seen: Array, *rest: Any) -> tuple[Packed, Array]:
                numbers = dict(zip(sizes, jnp.split(seen, ends)[1:], strict=False))
                after, out = function(unpack(moving | still), seen[:width], numbers, *rest)
                after = pack(after)
                return {name: after[name] for name in moving}, out

            compiled = in_one_piece(jax.vmap(one))

            def in_turn(moving: Packed, still: Packed, *rest: Any) -> tuple[Packed, np.ndarray]:
                with alone:
                    moving, out = compiled(moving, still, *rest)
                    return moving, np.asarray(out)  # waits for the call, which reads its input in place

            def call(cycles: Packed, *rest: Any) -> tuple[Packed, np.ndarray]:
                if not still:
                    return in_turn(cycles, {}, *rest)
                moving = {name: part for name, part in cycles.items() if name not in still}
                moving, out = in_turn(moving, {name: cycles[name] for name in still}, *rest)
                return cycles | moving, out

            return call

        def harvest(cycle: Packed) -> tuple[Packed, dict[str, Array]]:
            state, look = self._look(unpack(cycle))
            return pack(state), look

        return Compiled(
            sizes,
            draw=draw,
            pack=jax.jit(jax.vmap(pack)),
            unpack=jax.jit(jax.vmap(unpack)),
            start=jax.jit(jax.vmap(lambda seed, packed, own: pack(self._begin(seed, packed, own)))),
            first=over_seeds(self._act),
            settle=over_seeds(self._settle_and_act),
            settle_resting=over_seeds(functools.partial(self._settle_and_act, resting=True), packing.still),
            again=over_seeds(self._restart_and_act),
            harvest=jax.jit(jax.vmap(harvest), donate_argnums=0),
            with_rest=jax.jit(jax.vmap(lambda cycle, row: jnp.append(row, self._rest(unpack(cycle), row.dtype)))),
        )

    def _still(self, example: CycleState, numbers: Numbers) -> list[int]:
        """The leaves of a cycle that a decision settled resting hands on as they are."""
        still: list[int] = []

        def settle(cycle: CycleState, packed: Array) -> None:
            pairs = zip(
                *map(jax.tree.leaves, (cycle, self._settle_and_act(cycle, packed, numbers, True)[0])), strict=True
            )
            still.extend(index for index, (before, after) in enumerate(pairs) if after is before)

        jax.eval_shape(settle, example, self.batch.packed[0])
        return still

    def _begin(self, seed: Array, packed: Array, own: Policy | None) -> CycleState:
        return self.cycle.begin(self._fresh(seed, own), self.batch.unpack(packed), *self._start_numbers(seed))

    def _adopt(self, seed: Array, cycle: CycleState, packed: Array, memory: Any) -> CycleState:
        return self.cycle.adopt(cycle, memory, self.batch.unpack(packed), *self._start_numbers(seed))

    def _act(self, cycle: CycleState, packed: Array, numbers: Numbers) -> tuple[CycleState, Array]:
        cycle = self.cycle.act(cycle, numbers["policy"])
        return cycle, self._row(cycle, 0.0)

    def _settle_and_act(
        self, cycle: CycleState, packed: Array, numbers: Numbers, resting: bool = False
    ) -> tuple[CycleState, Array]:
        diverged = packed[-1] > 0
        cycle, ended = self.cycle.settle(cycle, self.batch.unpack(packed), numbers["observe"], diverged, resting)
        cycle = self.cycle.act(cycle, numbers["policy"])
        return cycle, self._row(cycle, ended)

    def _restart_and_act(
        self, cycle: CycleState, packed: Array, numbers: Numbers, ended: Bool[Array, ""], out: Array
    ) -> tuple[CycleState, Array]:
        """Where an episode has `ended`, the action already chosen is taken back and chosen again on the new start."""
        state = self.batch.unpack(packed)
        fresh = self.cycle.restart(cycle, state, ended, numbers["memory"], numbers["look"])
        fresh = fresh._replace(agent=self.cycle.agent.restart(fresh.agent, ended))
        fresh, action = self._act(fresh, packed, numbers)
        return jax.tree.map(lambda new, old: jnp.where(ended, new, old), (fresh, action), (cycle, out))

    def _row(self, cycle: CycleState, ended: Any) -> Float[Array, " size"]:
        """What crosses to the host: the numbers that the dynamics are told, whether the episode has ended, and how many
        decisions can be settled resting."""
        control = jnp.asarray(self.task.control(cycle.action, cycle.memory), jnp.result_type(float))
        ends = jnp.asarray(ended, control.dtype)
        return jnp.append(control, jnp.stack([ends, self._rest(cycle, control.dtype)]))

    def _rest(self, cycle: CycleState, dtype: Any) -> Array:
        most = 2**24  # whole numbers up to which single precision is exact
        return jnp.minimum(self.cycle.rest(cycle), most).astype(dtype)
