"""Compiled runs of a diagram, with many seeds, that can be advanced, saved and restored."""

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Self

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad._program_store import keep_programs
from timlab.compiler import (
    Carry,
    HostLoop,
    Loop,
    Stacks,
    Step,
    Values,
    address_of,
    cached_program,
    plan,
    stack,
    with_watched,
)
from timlab.diagram import Diagram, Host, HostBlock, Problem, Record, join, sampled
from timlab.engine._fault import RunFault, finite
from timlab.engine._linear import unstable_modes
from timlab.engine._parameters import Parameters
from timlab.engine._search import chattering, fault_at, first_unsound, not_finite_since
from timlab.engine._state import (
    State,
    check_state,
    finite_leaves,
    mismatches,
    not_finite,
    precisely,
    split_by_block,
    stack_by_kind,
)

MAX_SEEDS = 1_000_000
MAX_TICKS = 2**32 - 2**16  # of a run: they are counted in 32 bits
CHATTER = (
    "chatters from tick {tick} ({time} s) on: it changes without end. From there on it is looked at a hundred times "
    "per tick. Use a Relay, which slides exactly, hysteresis or a shorter tick"
)


class Run:
    """A compiled run of a diagram: many seeds advance in step.

        run = Run(diagram, seeds=16)
        record = run.advance(1000)
        run["gain.gain"] = 2.0     # from the next tick on, nothing is compiled
        later = run.advance(1000)

    **Arguments:**

    - `diagram`: it is compiled as it is; later changes have no effect on the run.
    - `seeds`: their number, or distinct integers from 0 to 2³¹ − 1. Seeds lead in every array of a run.
    - `sweep`: parameters that differ between seeds, by address, `{"gain.gain": [1.0, 2.0]}`, seeds leading.
    - `watch`: addresses of outputs to record in addition to the sinks' inputs.
    - `threads`: for simulators on the host, 0 for one per processor.
    - `stacked`: whether blocks of one kind are evaluated together; `False` is for measuring the gain.

    **Raises** `DiagramError` with everything that keeps the diagram from running.
    """

    def __init__(
        self,
        diagram: Diagram,
        seeds: int | Sequence[int] = 1,
        sweep: Mapping[str, Any] | None = None,
        watch: Sequence[str] = (),
        threads: int = 0,
        stacked: bool = True,
    ):
        keep_programs()
        check_arguments(Run, locals())
        self.seeds = _checked_seeds(seeds)
        self.plan = with_watched(plan(diagram), watch)
        self.tick = 0
        """Number of completed ticks."""
        self._threads = threads
        self.warn: Callable[[str], None] = lambda message: warnings.warn(message, RuntimeWarning, stacklevel=8)
        """How a warning is given."""
        self.search: Callable[[Callable[[], RunFault]], RunFault] = lambda find: find()
        """How the search for a fault is called, as in a thread of its own that can be stopped."""
        self._begin(sweep or {}, stacked)
        self._start()

    @precisely
    def _begin(self, sweep: Mapping[str, Any], stacked: bool) -> None:
        self._stacks = stack(self.plan, stacked)
        self._parameters = Parameters(self._stacks, sweep, len(self.seeds))
        self._loop = cached_program(self._stacks, self.seeds, self._parameters.axes)

    @precisely
    def _start(self) -> None:
        values, loop = self._parameters.values, self._loop
        self._carry = loop.init(values, self.seeds)
        self._hosts: dict[int, Host] = (
            loop.hosts(values, self.seeds, self._threads) if isinstance(loop, HostLoop) else {}
        )
        self._last: dict[int, dict[str, np.ndarray]] = {}
        self.warnings: list[Problem] = []
        """What was warned of."""
        self._goes_on = False
        """Whether it went on after a fault."""
        self._sound = finite_leaves(self._carry)
        """Which leaves of the state are to be finite: some hold infinity from the start, as where nothing is best."""

    @property
    def compilations(self) -> int:
        """How often the loop was compiled: once, whatever parameters change during the run."""
        return self._loop.compilations

    @precisely
    def compile(self) -> None:
        """Compile now what the first ticks would otherwise wait for."""
        self._carry = self._loop.compile(self._parameters.values, self._carry, self.seeds)

    def not_finite(self) -> list[str]:
        """The paths of the blocks in whose state a number is NaN or infinite."""
        return [self.plan.blocks[i].path for i in not_finite(self._stacks, self._carry)]

    @precisely
    def advance(self, ticks: int) -> Record:
        """Run a number of ticks.

        **Returns** what the sinks recorded. Use `stream` for more than memory holds.

        **Raises** `RunFault` where a number is not finite or a limit of the solver is reached, unless the diagram has
        `on_fault="warn"`. It has what was recorded before; the run is then at the last tick before which all is sound.
        """
        records = []
        try:
            records.extend(self.stream(ticks))
        except RunFault as fault:
            fault.record = join([*records, fault.record] if fault.record else records) if records else fault.record
            raise
        shapes = self._loop.step.recorded_shapes(len(self.seeds))
        nothing = jax.tree.map(lambda like: np.zeros((0, *like.shape), like.dtype), shapes)
        return join(records) if records else self._record(self.tick, 0, nothing)

    def stream(self, ticks: int) -> Iterator[Record]:
        """Run a number of ticks, and yield what the sinks recorded piece by piece. Parameters may be set between
        pieces.
        """
        whole = isinstance(ticks, int | np.integer) and not isinstance(ticks, bool)
        check(whole and ticks >= 0, "ticks", ticks, "an integer from 0")
        check(self.tick + ticks <= MAX_TICKS, "ticks", ticks, f"at most {MAX_TICKS - self.tick:,} more")
        return self._pieces(int(ticks))

    def _pieces(self, ticks: int) -> Iterator[Record]:
        while ticks > 0:
            record = self._piece(ticks)
            ticks -= record.ticks
            yield record

    @precisely
    def _piece(self, most: int) -> Record:
        """Run one piece: as many ticks as one call can run, at most `most`. **Returns** its record."""
        now = min(most, self._loop.longest)
        first = self.tick
        values, before = self.values, self._carry
        if isinstance(self._loop, HostLoop):
            wanted = self._wanted
            found = self._loop.advance(values, before, self.seeds, first, now, self._hosts, self._last, wanted)
            self._carry, seen, made, whole, before = found
        else:
            self._carry, seen, whole = self._loop.advance(values, before, self.seeds, first, now)
            made = now
        self.tick += made
        if self._goes_on and not np.any(self._carry.fault.get("kind", False)):
            return self._record(first, made, seen)
        if self.sound(self._carry, seen, whole):
            self._tell_chatter()
            return self._record(first, made, seen)
        try:
            fault = self.search(lambda: self._fault(first, made, before))
        except BaseException:  # the search was interrupted: as if these ticks had not been made, where that is possible
            if isinstance(self._loop, Loop) and self._loop.keeps:
                self.tick, self._carry = first, before
            raise
        fault.record = self._record(first, min(made, max(0, fault.tick - first)), seen)
        if self.plan.on_fault == "stop":
            raise fault
        if not self._goes_on:
            self._tell(fault.problem)
        self._goes_on = True
        self._pass()
        return self._record(first, self.tick - first, seen)

    def _pass(self) -> None:
        """Go on after a fault of the solver: it has no continuous state any more."""
        fault = self._carry.fault
        if not fault or not np.any(fault["kind"]):
            return
        gone = jnp.asarray(fault["kind"]) != 0
        movers = {k: self._carry.states[k] for k in self.step.movers}
        lost = jax.tree.map(lambda x: jnp.where(gone, jnp.nan, x), movers)
        none = fault | {"kind": jnp.zeros_like(fault["kind"])}
        self._carry = self._carry._replace(states=self._carry.states | lost, fault=none)

    @precisely
    def _fault(self, first: int, made: int, before: Carry) -> RunFault:
        """What was not sound in the last call. The run goes back to the tick before, or to that after if it goes on."""
        loop = self._loop
        if isinstance(loop, Loop) and not loop.keeps:
            limits = self._carry.fault and np.any(self._carry.fault["kind"])
            found = fault_at(self, self.tick - 1, self._carry, self._carry) if limits else None
            return found or not_finite_since(self, first, self._carry)
        tick = self.tick - 1
        after = self._carry
        if isinstance(loop, Loop):
            tick, before, after = first_unsound(self, loop, before, first, made)
        found = fault_at(self, tick, before, after)
        if isinstance(loop, Loop):
            stops = self.plan.on_fault == "stop"
            self.tick, self._carry = (tick, before) if stops else (tick + 1, after)
        return found or not_finite_since(self, first, after)

    @property
    def values(self) -> Values:
        """The parameters, as the compiled loop takes them."""
        return self._parameters.values

    @property
    def step(self) -> Step:
        """The functions of a tick."""
        return self._loop.step

    @property
    def stacks(self) -> Stacks:
        """The blocks as the compiled loop has them."""
        return self._stacks

    @property
    def last_of_hosts(self) -> dict[int, dict[str, np.ndarray]]:
        """The hosts' outputs of their last tick, by kind; seeds lead."""
        return self._last

    @property
    def _wanted(self) -> np.ndarray:
        """Of the leaves of the state and of what sinks record, which are to be finite; none once that was warned of."""
        shapes = jax.tree.leaves(self.step.recorded_shapes(1))
        reals = sum(jnp.issubdtype(like.dtype, jnp.floating) for like in shapes)
        return np.concatenate([self._sound, np.ones(reals, bool)]) & (not self._goes_on)

    def sound(self, carry: Carry, seen: PyTree[np.ndarray], whole: Array | np.ndarray) -> bool:
        """Whether nothing went wrong, given the state, the record and what `Step.finite` says of the state."""
        if carry.fault and np.any(carry.fault["kind"]):
            return False
        if self._goes_on:
            return True
        return bool(np.asarray(whole)[: len(self._sound)][self._sound].all()) and finite(seen)

    def unstable_steps(self) -> list[str]:
        """What `timlab.unstable_steps` says of the start of the run."""
        return [] if self._hosts else unstable_modes(self._begun(), 0)

    def _tell(self, problem: Problem) -> None:
        self.warnings.append(problem)
        self.warn(str(problem))

    def _tell_chatter(self) -> None:
        """Warn of crossings that are reached without end and are not held, once for each block."""
        if "chatter" not in self._carry.fault or not np.any(self._carry.fault["chatter"]):
            return
        known = {problem.path for problem in self.warnings}
        for path, tick in chattering(self, self._carry):
            if path not in known:
                self._tell(Problem(path, None, CHATTER.format(tick=tick, time=f"{tick * self.plan.tick:.9g}")))

    def _begun(self) -> Self:
        """Another run at the start, without hosts."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.tick = 0
        other._carry = self._loop.init(self._parameters.values, self.seeds)
        return other

    def __getitem__(self, address: str) -> Any:
        """The current value of a parameter, by its address `"block.parameter"`."""
        return self._parameters[address]

    @precisely
    def __setitem__(self, address: str, value: object) -> None:
        """Set a parameter for all seeds, from the next tick on. Nothing is compiled."""
        self._parameters[address] = value

    @property
    def no_restore(self) -> dict[str, str]:
        """The blocks whose state cannot be saved, by path, with the reason. It is known before anything runs."""
        found = {}
        for placed in self.plan.blocks:
            if isinstance(placed.block, HostBlock) and placed.block.no_restore is not None:
                found[placed.path] = placed.block.no_restore
        return found

    @property
    def state(self) -> State:
        """A copy of everything that the future depends on: `tick`; `blocks`, each block's state by its identity; the
        current `parameters`; `hosts`, their snapshots. Seeds lead.

        **Raises** `ValueError` if a block cannot be saved.
        """
        for path, reason in self.no_restore.items():
            raise ValueError(f"{path}: cannot be saved: {reason}")
        hosts = {self._identity(k): host.snapshot() for k, host in self._hosts.items()}
        last = {self._identity(k): {n: v.copy() for n, v in outputs.items()} for k, outputs in self._last.items()}
        blocks = split_by_block(self._stacks, self._carry)
        parameters = self._parameters.by_block()
        pace = {name: np.array(array) for name, array in self._carry.pace.items()}
        state = {"tick": self.tick, "blocks": blocks, "parameters": parameters, "hosts": hosts, "last": last}
        return state | ({"pace": pace} if pace else {})

    @precisely
    def restore(self, state: State) -> None:
        """Return to a `state`. What follows is bit for bit what followed it before.

        **Raises** `ValueError` for the state of another diagram.
        """
        check_state(state, self.state)
        self._set_state(state)

    @precisely
    def restore_matching(self, state: State) -> list[str]:
        """Continue from the state of an earlier version of the diagram, for all blocks that are still the same.

        **Returns** the identities of the blocks that start anew.
        """
        own = self.state
        fresh: list[str] = []
        mixed: State = {"tick": state["tick"], "last": {}, "pace": own.get("pace", {})}
        for part in ("blocks", "hosts"):
            wrong = mismatches(state[part], own[part])
            fresh += wrong
            mixed[part] = {name: (own if name in wrong else state)[part][name] for name in own[part]}
        mixed["parameters"] = own["parameters"]
        mixed["last"] = {name: outputs for name, outputs in state["last"].items() if name not in fresh}
        self._set_state(mixed)
        return sorted(set(fresh))

    @precisely
    def functions_at(self, row: int) -> tuple[Step, Values, Carry]:
        """The functions of a tick with the current parameters and state of one seed, for differentiating them."""
        return self.functions_of(self._carry, row)

    def functions_of(self, carry: Carry, row: int) -> tuple[Step, Values, Carry]:
        """As `functions_at`, with another state."""
        axes = self._parameters.axes
        values = {
            k: {name: array if axes[k][name] is None else array[..., row] for name, array in arrays.items()}
            for k, arrays in self._parameters.values.items()
        }
        return self._loop.step, values, jax.tree.map(lambda x: jnp.asarray(x)[..., row], carry)

    def wait(self) -> None:
        """Wait until all ticks are computed. Where no sink records them, `advance` may return earlier."""
        jax.block_until_ready(self._carry)

    @precisely
    def peek(self) -> Record:
        """What the sinks would record at the next tick, without advancing.

        **Raises** `ValueError` if a host cannot be saved: with hosts, the tick is made and then undone.
        """
        if isinstance(self._loop, Loop):
            return self._record(
                self.tick, 1, self._loop.peek(self._parameters.values, self._carry, self.seeds, self.tick)
            )
        state = self.state
        try:
            return self.advance(1)
        finally:
            self._set_state(state)

    def reset(self, seeds: int | Sequence[int] | None = None) -> None:
        """Restart at tick 0 with the current parameters, optionally with the same number of other `seeds`. Nothing is
        compiled.
        """
        if seeds is not None:
            chosen = _checked_seeds(seeds)
            check(len(chosen) == len(self.seeds), "seeds", seeds, f"{len(self.seeds)} of them")
            self.seeds = chosen
        self.close()
        self.tick = 0
        self._start()

    def fork(self) -> Self:
        """Another run in the same state, which continues independently. Nothing is compiled."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other._parameters = self._parameters.copy()
        other._start()
        other._set_state(self.state)
        other.warnings = list(self.warnings)
        other._goes_on = self._goes_on
        other._sound = self._sound
        return other

    def close(self) -> None:
        """Release the hosts."""
        for host in self._hosts.values():
            host.close()

    @precisely
    def _set_state(self, state: State) -> None:
        carry = stack_by_kind(self._stacks, state["blocks"], self._carry)
        pace = {name: jnp.asarray(state["pace"][name]) for name in carry.pace}
        self._carry = carry._replace(pace=pace)
        self._parameters.restore(state["parameters"])
        kinds = {self._identity(k): k for k in self._hosts}
        for identity, snapshot in state["hosts"].items():
            self._hosts[kinds[identity]].restore(snapshot)
        self._last = {
            kinds[identity]: {name: value.copy() for name, value in outputs.items()}
            for identity, outputs in state["last"].items()
            if identity in kinds
        }
        self.tick = int(state["tick"])

    def _identity(self, k: int) -> str:
        return self.plan.blocks[self._stacks.kinds[k].members[0]].identity

    def _record(self, first: int, ticks: int, seen: Mapping[int, Mapping[str, np.ndarray]]) -> Record:
        """What the sinks recorded, by address; seeds lead, then samples."""
        signals = {}
        spacing = {}
        for k, ports in seen.items():
            for row, i in enumerate(self._stacks.kinds[k].members):
                placed = self.plan.blocks[i]
                samples = sampled(first, ticks, placed.ticks) - first
                for port, array in ports.items():
                    address = address_of(placed, port)
                    signals[address] = np.ascontiguousarray(np.moveaxis(array[samples, row], -1, 0))
                    spacing[address] = placed.ticks
        return Record(first, ticks, self.plan.tick, signals, spacing)


def _checked_seeds(seeds: int | Sequence[int]) -> np.ndarray:
    allowed = "a number of seeds up to 1,000,000, or distinct integers from 0 to 2147483647"
    whole = isinstance(seeds, int | np.integer)
    check(not isinstance(seeds, bool) and (whole or isinstance(seeds, Iterable)), "seeds", seeds, allowed)
    check(not whole or 1 <= seeds <= MAX_SEEDS, "seeds", seeds, allowed)  # type: ignore[operator]
    given = list(range(seeds) if whole else seeds)  # type: ignore[arg-type]
    numbers = all(isinstance(seed, int | np.integer) and 0 <= seed < 2**31 for seed in given)
    check(0 < len(given) <= MAX_SEEDS and numbers and len(set(given)) == len(given), "seeds", seeds, allowed)
    return np.asarray(given, np.int32)
