"""Engines whose dynamics run on the host for all seeds, with one compiled call per decision for everything else."""

import contextlib
import functools
import threading
from collections.abc import Callable, Mapping, Sequence, Set
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from motorgrad._arrays import AnyArray
from motorgrad._branching import where
from motorgrad._compiler import in_one_piece, quick_options
from motorgrad._errors import check
from motorgrad._interface import Statistics
from motorgrad._linear_algebra import one_thread
from motorgrad._packing import Packed, Packing, shared_memory
from motorgrad._random import BLOCK, block_at, draw_block
from motorgrad.bodies import BodyBatch
from motorgrad.learning import Learner
from motorgrad.policies import Policy
from motorgrad.tasks import HostBatch, HostTask, Task
from motorgrad.training.engines._cycle import CycleState, Flag, Mode
from motorgrad.training.engines._programs import shared
from motorgrad.training.engines._stepper import Program, Record, Stepper, View, check_carries, fits, statistics_of
from motorgrad.training.engines._transition import Watcher, transition_of_rows

Uniforms = dict[str, Float[Array, " size"]]
Decision = Callable[..., tuple[CycleState, PyTree]]
"""A part of a decision of one seed: from its cycle and what it needs beside it, to the next one and what comes out."""
OverSeeds = Callable[..., tuple[Packed, np.ndarray]]
"""The same of all seeds, compiled."""

_alone = threading.Lock()
"""Held while compiled code runs: two threads of ours in XLA at once can leave its own threads waiting for ever."""


class HostProgram(Program):
    """The compiled functions of a `HostStepper`, each for all seeds. Several threads may call them.

    **Arguments:** as `Program`; an `example` of the batch, for the layout of its rows; how many `seeds` at most;
    whether policies to begin from are `given`; how many environments, `envs`, feed each learner. With several, the
    leaves of a seed's state that belong to one lead with them, and a decision of the seed is one of each, in turn.
    """

    task: HostTask

    def __init__(
        self,
        task: HostTask,
        agent: Learner,
        mode: Mode,
        example: HostBatch,
        seeds: int,
        given: Policy | None,
        envs: int,
        first_episode: bool = False,
    ):
        super().__init__(task, agent, mode, True, first_episode)
        self._unpack_row, self._envs = example.unpack, envs
        row = jnp.asarray(example.packed[0])
        width = len(row)
        numbers = jnp.asarray(self.cycle.numbers.vector(agent.hyperparameters, agent.precision))
        single = jax.eval_shape(self._begin, jnp.int32(0), numbers, row, given)
        sizes = {"policy": self.policy.uniforms, "observe": task.uniforms}
        self.sizes = sizes | {"memory": task.init_uniforms, "look": task.uniforms}
        self._ends = np.cumsum([width, *self.sizes.values()])
        self._width = width
        uniforms = {name: jnp.zeros(size) for name, size in self.sizes.items()}
        begun, begin = single, self._begin
        if envs > 1:
            self._own = self._belonging(single, uniforms)
            begin = self._begin_all
            begun = jax.eval_shape(begin, jnp.int32(0), numbers, jnp.stack([row] * envs), given)
        seldom = functools.partial(jax.jit, compiler_options=quick_options())
        packing = Packing(begun, seeds, self._still(single, row, uniforms) if self.cycle.waits else ())
        pack, unpack = packing.pack, packing.unpack

        @functools.partial(jax.jit, compiler_options=quick_options(2))
        def drawn(seeds: Array, block: Array) -> Float[Array, "decisions rows size"]:
            parts = [draw_block(seeds, name, block, envs * size) for name, size in self.sizes.items()]
            rows = [jnp.swapaxes(part, 1, 2).reshape(BLOCK, len(seeds) * envs, -1) for part in parts]
            return jnp.concatenate(rows, axis=2)

        def harvest(cycle: Packed) -> tuple[Packed, dict[str, Array]]:
            state, found = self.summarize(unpack(cycle))
            return pack(state), found

        def view(view: View) -> Any:
            one = jax.vmap(lambda cycle, row: view(self._first(cycle), self._unpack_row(row)))

            def of_all(cycles: Packed, rows: Array) -> Any:
                return one(jax.vmap(unpack)(cycles), rows[::envs])

            return jax.jit(of_all, compiler_options=quick_options(2))

        def first_numbers(seed: Array) -> Float[Array, "envs size"]:
            return jnp.stack([self.start_memory(seed, environment) for environment in range(envs)])

        compiled = functools.partial(self._over_seeds, packing)
        self._drawn = drawn
        self._first_numbers = seldom(jax.vmap(first_numbers))
        self.watched = transition_of_rows(task, unpack, self._unpack_row, self.sizes)
        self.pack = seldom(jax.vmap(pack))
        self.unpack = packing.unpack_all
        self.start = seldom(
            lambda seeds, n, rows, own: jax.vmap(lambda *of: pack(begin(*of)))(seeds, n, self._by_seed(rows), own)
        )
        self.first = compiled(self._act)
        # Of learners that seldom update; for others, the limit would cost more than it saves.
        self.learn = compiled(self._learn_and_act, limits=one_thread if self.cycle.waits else contextlib.nullcontext)
        self.learn_only = compiled(functools.partial(self._learn_and_act, update=False), packing.still)
        self._copy = jax.jit(lambda cycles: jax.tree.map(jnp.copy, cycles))
        self._merge = jax.jit(jax.vmap(lambda one, x, y: jax.tree.map(lambda a, b: jnp.where(one, a, b), x, y)))
        self.again = compiled(self._restart_and_act)
        self.harvest = seldom(jax.vmap(harvest), donate_argnums=0)
        self.decisions_until_due = seldom(
            jax.vmap(lambda cycle: self._until_due(self._first(unpack(cycle)), jnp.result_type(float)))
        )
        self.resume = seldom(jax.vmap(self._resume))
        self.viewer = view

    def draw(self, seeds: np.ndarray, block: int) -> Float[np.ndarray, "decisions rows size"]:
        """The random numbers of a block of decisions, those of all purposes side by side."""
        with _alone:
            return np.asarray(self._drawn(seeds, np.uint32(block)))

    def first_numbers(self, seeds: np.ndarray) -> Float[np.ndarray, "rows size"]:
        """The random numbers of all environments for the start of their first episode."""
        with _alone:
            return np.asarray(self._first_numbers(seeds)).reshape(len(seeds) * self._envs, self.task.init_uniforms)

    def learn_each(self, cycles: Packed, due: Bool[np.ndarray, " seeds"], row: Array) -> tuple[Packed, np.ndarray]:
        """Learn from one decision, by the shorter program where no update is `due`. The two may round differently. So a
        seed's program depends on itself alone, and both run where seeds differ, as they do after one of them has
        diverged."""
        updates = np.count_nonzero(due)
        if updates == len(due):
            return self.learn(cycles, row)
        if not updates:
            return self.learn_only(cycles, row)
        with _alone:
            spare = self._copy(cycles)  # the first call uses up its input
        learned = self.learn_only(spare, row)
        updated = self.learn(cycles, row)
        with _alone:
            cycles = jax.block_until_ready(self._merge(due, updated[0], learned[0]))
        return cycles, np.where(np.repeat(due, self._envs)[:, None], updated[1], learned[1])

    def _over_seeds(
        self,
        packing: Packing,
        function: Decision,
        still: Set[str] = frozenset(),
        limits: Callable[[], contextlib.AbstractContextManager[None]] = contextlib.nullcontext,
    ) -> OverSeeds:
        """`function(cycle, packed, uniforms, *rest) -> (cycle, out)` compiled for all seeds. It does not change the
        arrays named in `still`, so they need not come back. It runs within `limits()`."""
        pack, unpack, width, envs = packing.pack, packing.unpack, self._width, self._envs
        function = self._in_turn(function) if envs > 1 else function

        def one(moving: Packed, still: Packed, row: Array, *rest: Array) -> tuple[Packed, Array]:
            uniforms = dict(zip(self.sizes, jnp.split(row, self._ends, axis=-1)[1:], strict=False))
            after, out = function(unpack(moving | still), row[..., :width], uniforms, *rest)
            after = pack(after)
            return {name: after[name] for name in moving}, out

        def every(moving: Packed, still: Packed, *rest: Array) -> tuple[Packed, Array]:
            moving, out = jax.vmap(one)(moving, still, *map(self._by_seed, rest))
            return moving, out if envs == 1 else out.reshape(-1, out.shape[-1])

        compiled = in_one_piece(every)

        def in_turn(moving: Packed, still: Packed, *rest: AnyArray) -> tuple[Packed, np.ndarray]:
            with _alone, limits():
                moving, out = compiled(moving, still, *rest)
                return moving, np.asarray(out)  # waits for the call, which reads its input in place

        def call(cycles: Packed, *rest: AnyArray) -> tuple[Packed, np.ndarray]:
            if not still:
                return in_turn(cycles, {}, *rest)
            moving = {name: part for name, part in cycles.items() if name not in still}
            moving, out = in_turn(moving, {name: cycles[name] for name in still}, *rest)
            return cycles | moving, out

        return call

    def _by_seed(self, rows: Array) -> Array:
        """Rows of environments by seed, each seed's with a leading axis where it has several."""
        return rows if self._envs == 1 else rows.reshape(-1, self._envs, *rows.shape[1:])

    def _first(self, cycle: CycleState) -> CycleState:
        """The state of a seed as its first environment has it."""
        if self._envs == 1:
            return cycle
        shared, own = self._split(cycle)
        return self._join(shared, [leaf[0] for leaf in own])

    def _belonging(self, example: CycleState, uniforms: Uniforms) -> list[bool]:
        """Which leaves of a state belong to one environment."""
        found: list[bool] = []

        def trace(cycle: CycleState) -> None:
            found.extend(self.cycle.belongs(cycle, uniforms["memory"], uniforms["policy"]))

        jax.eval_shape(trace, example)
        self._structure = jax.tree.structure(example)
        return found

    def _split(self, cycle: CycleState) -> tuple[list[Array], list[Array]]:
        """The leaves that environments share, and those that belong to one."""
        leaves = list(zip(jax.tree.leaves(cycle), self._own, strict=True))
        return [leaf for leaf, own in leaves if not own], [leaf for leaf, own in leaves if own]

    def _join(self, shared: list[Array], own: list[Array]) -> CycleState:
        """The inverse of `_split`."""
        left = {False: iter(shared), True: iter(own)}
        return jax.tree.unflatten(self._structure, [next(left[own]) for own in self._own])

    def _in_turn(self, function: Decision) -> Decision:
        """`function(cycle, *of_one) -> (cycle, out)` for one environment after the other, as if they were one stream
        of decisions of the learner; the arguments have a leading axis of environments."""

        def one(shared: list[Array], each: tuple[Any, ...]) -> tuple[list[Array], tuple[Any, ...]]:
            own, *of_one = each
            cycle, out = function(self._join(shared, own), *of_one)
            shared, own = self._split(cycle)
            return shared, (own, out)

        def all_in_turn(cycle: CycleState, *of_all: Array) -> tuple[CycleState, Any]:
            shared, own = self._split(cycle)
            shared, (own, outs) = jax.lax.scan(one, shared, (own, *of_all))
            return self._join(shared, own), outs

        return all_in_turn

    def _begin_all(self, seed: Array, numbers: Array, rows: Array, own: Policy | None) -> CycleState:
        """The state of one seed with several environments."""
        agent = self.fresh(seed, numbers, own)
        starts = [self.start_numbers(seed, environment) for environment in range(self._envs)]
        init, uniforms = (jnp.stack(parts) for parts in zip(*starts, strict=True))
        blank = jax.vmap(lambda init: self.cycle.blank(agent, numbers, init, statistics_of(own)))(init)
        shared, of_each = self._split(blank)
        begun = self._join([leaf[0] for leaf in shared], of_each)
        observe_all = self._in_turn(lambda cycle, row, u: (self.cycle.observe(cycle, self._unpack_row(row), u), ()))
        return observe_all(begun, rows, uniforms)[0]

    def _still(self, example: CycleState, row: Array, uniforms: Uniforms) -> list[int]:
        """The leaves of a cycle that a decision without an update returns unchanged."""
        still: list[int] = []

        def learn(cycle: CycleState, row: Array) -> None:
            after = self._learn_and_act(cycle, row, uniforms, False)[0]
            pairs = zip(jax.tree.leaves(cycle), jax.tree.leaves(after), strict=True)
            still.extend(index for index, (before, after) in enumerate(pairs) if after is before)

        jax.eval_shape(learn, example, row)
        return still

    def _begin(self, seed: Array, numbers: Array, row: Array, own: Policy | None) -> CycleState:
        agent = self.fresh(seed, numbers, own)
        init, uniforms = self.start_numbers(seed)
        blank = self.cycle.blank(agent, numbers, init, statistics_of(own))
        return self.cycle.observe(blank, self._unpack_row(row), uniforms)

    def _resume(self, seed: Array, cycle: CycleState, row: Array, memory: PyTree) -> CycleState:
        return self.cycle.resume_from(cycle, memory, self._unpack_row(row), *self.start_numbers(seed))

    def _act(self, cycle: CycleState, row: Array, uniforms: Uniforms) -> tuple[CycleState, Array]:
        cycle = self.cycle.act(cycle, uniforms["policy"])
        return cycle, self._out_row(cycle, 0.0)

    def _learn_and_act(
        self, cycle: CycleState, row: Array, uniforms: Uniforms, update: bool = True
    ) -> tuple[CycleState, Array]:
        diverged = row[-1] > 0
        cycle, ended = self.cycle.learn(cycle, self._unpack_row(row), uniforms["observe"], diverged, update)
        acted = self.cycle.act(cycle, uniforms["policy"])
        # Where an episode has ended, the learner has yet to see the start of the next one, on which it acts then.
        return where(ended, cycle, acted), self._out_row(acted, ended)

    def _restart_and_act(
        self, cycle: CycleState, row: Array, uniforms: Uniforms, ended: Bool[Array, ""], out: Array
    ) -> tuple[CycleState, Array]:
        """Where an episode has `ended`, the action is chosen on the start of the next one."""
        state = self._unpack_row(row)
        fresh = self.cycle.restart(cycle, state, ended, uniforms["memory"], uniforms["look"])
        fresh, action = self._act(fresh, row, uniforms)
        return jax.tree.map(lambda new, old: jnp.where(ended, new, old), (fresh, action), (cycle, out))

    def _out_row(self, cycle: CycleState, ended: Flag | float) -> Float[Array, " size"]:
        """What crosses to the host: the control of the dynamics, whether the episode has ended, and how many decisions
        pass until an update is due."""
        control = jnp.asarray(self.task.control(cycle.action, cycle.memory), jnp.result_type(float))
        ends = jnp.asarray(ended, control.dtype)
        return jnp.append(control, jnp.stack([ends, self._until_due(cycle, control.dtype)]))

    def _until_due(self, cycle: CycleState, dtype: np.dtype) -> Array:
        exact = 2**24  # whole numbers up to which single precision is exact
        return jnp.minimum(jnp.asarray(self.cycle.decisions_until_due(cycle), jnp.int32), exact).astype(dtype)


class HostStepper(Stepper):
    """Learning in dynamics on the host: Gymnasium environments, and bodies (`BodyStepper`). Data cross once each way
    per decision, in packed arrays.

    **Arguments:** as of `Stepper` and `stepper_for`; `threads` that step the dynamics, 0 for one per processor, where
    they can use them; `room`, for how many seeds the shared program is made, by default as many as there are.
    """

    task: HostTask

    def __init__(
        self,
        task: HostTask,
        agent: Learner,
        seeds: Sequence[int],
        mode: Mode = "learn",
        threads: int = 0,
        initial: Policy | None = None,
        numbers: Mapping[str, Any] | None = None,
        room: int = 0,
        envs: int = 1,
        workers: int = 0,
        first_episode: bool = False,
    ):
        agent = agent.fed_by_several() if envs > 1 else agent
        super().__init__(cast(Task, task), agent, seeds, mode, initial, numbers)
        self.envs = envs
        rows = [seed_of(int(seed), environment) for seed in self.seeds for environment in range(envs)]
        self.batch = task.batch(rows, threads, **({"workers": workers} if workers else {}))
        given = jax.tree.map(lambda leaf: leaf[0], self._initial)
        room = max(room, len(self.seeds))
        kind = None if given is None else jax.tree.structure(given.interface)
        more = (mode, room, self.batch.packed.shape[1], given is None, kind, envs, first_episode)
        make = functools.partial(HostProgram, task, agent, mode, self.batch, room, given, envs, first_episode)
        self.program = shared(HostProgram, task, agent, more, make)
        self.cycle = self.program.cycle
        width = self.batch.packed.shape[1]
        drawn = sum(self.program.sizes.values())
        seen, self._seen = shared_memory(len(rows), width + drawn)
        self._dynamics = seen[:, :width]
        self._chance = seen[:, width:]
        self._block = -1
        self._drawn = np.empty(0)
        first = sum(self.program.sizes[name] for name in ("policy", "observe"))
        self._for_memory = self._chance[:, first : first + task.init_uniforms]
        if start := task.begin(self.program.first_numbers(self.seeds)):
            self.batch.reset(None, **start)
        self.ended: np.ndarray | None = None
        """Where an episode ended at the last decision, the packed rows as they were before the reset."""
        self.watcher: Watcher | None = None
        """Called with every decision before anything is learned from it, where each seed has one environment."""
        cycles = self.program.start(self.seeds, self._start_vector, self.batch.packed, self._initial)
        self._cycles, self._out = self.program.first(cycles, self._input())

    def advance(self, decisions: int) -> None:
        program = self.program
        waits = self.cycle.waits
        has_episodes = self.task.has_episodes
        envs = self.envs
        check(decisions % envs == 0, "decisions", decisions, f"a multiple of the {envs} environments of a learner")
        for _ in range(decisions // envs):
            before = self.batch.packed if self.watcher is None else self.batch.packed.copy()
            self.batch.step(self._out[:, :-2])
            self.decision += envs
            if self.watcher is not None:
                watched = program.watched(self._cycles, before, self._input())
                self.watcher({name: np.array(part)[None] for name, part in watched.items()})
            if waits:
                due = self._out[envs - 1 :: envs, -1] < envs
                self._cycles, self._out = program.learn_each(self._cycles, due, self._input())
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
        # How many decisions pass until an update is due follows from the cycle, so it is not kept.
        parts = {"action": self._out[:, :-1], "physics": self.batch.snapshot()}
        if self.envs > 1:  # seeds lead
            parts = jax.tree.map(lambda x: np.reshape(x, (len(self.seeds), self.envs, *np.shape(x)[1:])), parts)
        return jax.tree.map(np.array, {"decision": self.decision, "cycle": cycle, **parts})

    def restore(self, state: PyTree[np.ndarray]) -> None:
        fits(state, self.state)
        parts = {"action": state["action"], "physics": state["physics"]}
        if self.envs > 1:
            parts = jax.tree.map(lambda x: np.reshape(x, (-1, *np.shape(x)[2:])), parts)
        self.batch.restore(parts["physics"])
        self._cycles = self.program.pack(state["cycle"])
        until_due = np.repeat(self.program.decisions_until_due(self._cycles), self.envs)
        self._out = np.append(np.array(parts["action"]), until_due[:, None], axis=1)
        self.decision = int(state["decision"])

    def harvest(self) -> Record:
        self._cycles, found = self.program.harvest(self._cycles)
        return jax.tree.map(np.array, found)

    def policies(self) -> Policy:
        agent = self.program.unpack(self._cycles).agent
        return jax.tree.map(np.array, self.cycle.acting(self.agent).final_policy(agent))

    def set_policies(self, policies: Policy, memory: PyTree = None) -> None:
        cycles = self.program.unpack(self._cycles)
        acting = self.cycle.acting(self.agent)
        cycles = cycles._replace(agent=acting.set_policy(cycles.agent, jax.tree.map(jnp.array, policies)))
        if memory is not None:
            cycles = self.program.resume(self.seeds, cycles, jnp.array(self.batch.packed), memory)
        elif (statistics := statistics_of(policies)) is not None:
            check_carries(self.task, policies)
            cycles = self._with_statistics(cycles, statistics)
        if self.mode == "learn":  # the present action has its score in the trace; the next is the new policy's
            self._cycles = self.program.pack(cycles)
        else:
            self._cycles, self._out = self.program.first(self.program.pack(cycles), self._input())

    def _with_statistics(self, cycles: CycleState, statistics: Statistics) -> CycleState:
        """The state of all seeds with other running statistics of observations, by which the present one is seen."""
        task = self.task
        cycles = cycles._replace(memory=task.with_statistics(cycles.memory, jax.tree.map(jnp.array, statistics)))

        def seen(cycle: CycleState, state: PyTree) -> Array:
            raw = task.sense(cycle.memory, state, jnp.zeros(task.uniforms))[1]
            return task.observation_code.encode(*(task.statistics(cycle.memory) or (None, None)), raw)

        self._cycles = self.program.pack(cycles)
        if self.envs > 1:  # the others see by them from the next observation on
            return cycles
        return cycles._replace(observation=jnp.asarray(self.viewer(seen)(), cycles.observation.dtype))

    def set_actions(self, actions: np.ndarray) -> None:
        cycles = self.program.unpack(self._cycles)
        given = jnp.asarray(actions, cycles.action.dtype).reshape(cycles.action.shape)
        self._cycles = self.program.pack(cycles._replace(action=given))
        control = jax.vmap(self.task.control)(given, cycles.memory)
        self._out = np.array(self._out)
        self._out[:, :-2] = np.reshape(control, (len(self._out), -1))

    def viewer(self, view: View) -> Callable[[], PyTree[np.ndarray]]:
        viewed = self.program.viewer(view)
        return lambda: jax.tree.map(np.array, viewed(self._cycles, self.batch.packed))

    def _put_number(self, place: int, value: float) -> None:
        cycles = self.program.unpack(self._cycles)
        numbers = np.array(cycles.numbers)
        numbers[:, place] = value
        self._cycles = self.program.pack(cycles._replace(numbers=jnp.asarray(numbers)))

    def _input(self) -> Float[Array, "seeds width"]:
        """What the compiled call reads for the present decision: the dynamics' packed rows, then random numbers."""
        block, index = block_at(self.decision // self.envs)
        if block != self._block:
            self._block = block
            self._drawn = self.program.draw(self.seeds, block)
        self._dynamics[...] = self.batch.packed
        self._chance[...] = self._drawn[index]
        return self._seen


def seed_of(seed: int, environment: int) -> int:
    """The seed of an environment of a learner: of the first its own, of the others one that follows from both."""
    return seed if environment == 0 else int(np.random.SeedSequence([seed, environment]).generate_state(1)[0] >> 1)


class BodyStepper(HostStepper):
    """Learning in a MuJoCo body: a `HostStepper` whose actions can be read."""

    batch: BodyBatch

    @property
    def control(self) -> Float[np.ndarray, "seeds groups"]:
        """The present actions: what each group of muscles does until the next decision."""
        return self._out[:, : len(self.batch.groups)]
