"""The loop over the ticks of a diagram with hosts: the parts between them are compiled, and called at every tick."""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from timlab.compiler._evaluation import Axes, Carry, Numbers, Values
from timlab.compiler._stack import Environment
from timlab.compiler._step import SPAN, Step, draw_start
from timlab.diagram import Host, HostBlock, HostMoment, Placed

Rows = dict[int, dict[str, np.ndarray]]
"""By kind of host: arrays by port; seeds lead."""
MAX_RECORDED_TICKS = 1024  # before the record is handed on


class HostLoop:
    """Ticks of all seeds, one after the other. Arguments as for `Loop`."""

    longest = MAX_RECORDED_TICKS

    def __init__(self, step: Step, seeds: np.ndarray, axes: Axes):
        self.step, self.seeds, self.axes = step, seeds, axes
        self.kinds = [k for k, kind in enumerate(step.kinds) if isinstance(kind.block, HostBlock)]
        self._ticks = {k: self._placed(k).ticks for k in self.kinds}
        outputs = {k: step.kinds[k].block.outputs for k in self.kinds}
        self._ports = {k: [(n, port.dtype, port.shape) for n, port in outputs[k].items()] for k in self.kinds}
        self.init = jax.jit(jax.vmap(step.init, in_axes=(axes, 0), out_axes=-1))
        self._stages = self._split_stages()
        self._draw = jax.jit(jax.vmap(step.numbers, in_axes=(0, None), out_axes=-1))
        self._calls = [self._compiled(pure, s + 1 == len(self._stages)) for s, (_, pure) in enumerate(self._stages)]

    @property
    def compilations(self) -> int:
        """How often a part of the tick was compiled."""
        return max(call._cache_size() for call in self._calls)

    def hosts(self, values: Values, seeds: np.ndarray, threads: int) -> dict[int, Host]:
        """The hosts of all seeds before the first tick."""
        started = {}
        for k in self.kinds:
            block = self._block(k, values)
            placed = self._placed(k)
            size = block.init_uniforms
            numbers = jax.vmap(lambda seed, s=placed.stream, size=size: draw_start(seed, s, size))(seeds)
            started[k] = block.start(seeds, np.asarray(numbers), threads)
        return started

    def advance(
        self,
        values: Values,
        carry: Carry,
        seeds: np.ndarray,
        first: int,
        ticks: int,
        hosts: Mapping[int, Host],
        last: Rows,
        sound: np.ndarray,
    ) -> tuple[Carry, Any, int, np.ndarray, Carry]:
        """Run ticks, up to one with a fault of the solver or with a number that was finite and is no more. **Returns**
        the state afterwards; what the sinks recorded, `(ticks, rows, …, seeds)`; the number of ticks; what
        `Step.finite` says of the state and the record; and the state before the last tick.

        `sound` are the leaves of floats that are to be finite; `last` holds the hosts' outputs of their last tick, and
        is updated.
        """
        seen = []
        drawn = {}
        chance = {}
        span = None
        blocks = {k: self._block(k, values) for k in self.kinds}
        before = carry
        finite = np.ones(len(sound), bool)
        for tick in range(first, first + ticks):
            before = carry
            if self.step.chance and tick // SPAN != span:
                span = tick // SPAN
                drawn = self._draw(seeds, np.uint32(span))
                chance = {k: np.moveaxis(np.asarray(drawn[k]), -1, 1)[:, :, 0] for k in self.kinds if k in drawn}
            due = [k for k in self.kinds if tick % self._ticks[k] == 0]
            now = {k: self._now(k, tick, chance[k][tick % SPAN] if k in chance else None) for k in due}
            environment = self.step.empty()
            asked = {}
            known = {}
            out: Any = None
            for (ready, _), call in zip(self._stages, self._calls, strict=True):
                for k in ready:
                    if k in due:
                        last[k] = self._output(k, hosts[k], blocks[k], asked.get(k, {}), now[k])
                known |= {k: last[k] for k in ready}
                environment, asked, out = call(values, carry, np.uint32(tick), drawn, known, environment)
            carry, inputs, saw, finite = out
            finite = np.all(np.asarray(finite), axis=-1).reshape(-1)
            seen.append(jax.tree.map(np.asarray, saw))
            # wait for the call: it may read the hosts' outputs without copying them, and `update` may overwrite them
            inputs = jax.tree.map(np.array, inputs)
            for k in due:
                hosts[k].update(blocks[k], inputs[k], now[k])
            faulty = self.step.adapts and np.any(carry.fault["kind"])
            if faulty or not finite[sound].all():
                break
        jax.block_until_ready(carry)
        record = jax.tree.map(lambda *parts: np.stack(parts), *seen) if seen else {}
        return carry, record, len(seen), finite, before

    def compile(self, values: Values, carry: Carry, seeds: np.ndarray) -> Carry:
        """Compile now, by a tick without hosts whose results are dropped. **Returns** the same state."""
        drawn = self._draw(seeds, np.uint32(0)) if self.step.chance else {}
        known = {}
        environment = self.step.empty()
        out = None
        for (ready, _), call in zip(self._stages, self._calls, strict=True):
            for k in ready:
                known[k] = {name: np.zeros((len(seeds), *shape), kind) for name, kind, shape in self._ports[k]}
            environment, _, out = call(values, carry, np.uint32(0), drawn, dict(known), environment)
        jax.block_until_ready(out)
        return carry

    def _split_stages(self) -> list[tuple[list[int], list[int]]]:
        """The stages of a tick: hosts whose outputs are requested, then batches that can be computed."""
        stages: list[tuple[list[int], list[int]]] = [([], [])]
        for b, batch in enumerate(self.step.stacks.batches):
            if batch.kind not in self.kinds:
                stages[-1][1].append(b)
                continue
            waits = any(port.feedthrough for port in self.step.kinds[batch.kind].block.inputs.values())
            if stages[-1][1] or (waits and stages[-1][0]):
                stages.append(([], []))
            stages[-1][0].append(batch.kind)
        return stages

    def _compiled(self, batches: list[int], final: bool) -> Any:
        """The compiled function of a stage for all seeds: the outputs so far, the inputs of hosts with feedthrough, and
        at the end the new state.
        """
        step = self.step
        places = {batch.kind: b for b, batch in enumerate(step.stacks.batches) if batch.kind in self.kinds}

        def one(
            values: Values, carry: Carry, tick: Array, drawn: Numbers, last: Rows, environment: Environment
        ) -> tuple[Any, ...]:
            numbers = {k: all[tick % SPAN] for k, all in drawn.items()}
            environment = list(environment)
            for k, outputs in last.items():
                environment[places[k]] = {name: jnp.asarray(value)[None] for name, value in outputs.items()}
            environment = step.outputs(batches, values, carry, tick, numbers, environment)
            if not final:
                asked = {k: step.host_inputs(k, environment, feedthrough=True) for k in self._hosts_after(batches)}
                return environment, asked, ()
            inputs = {k: step.host_inputs(k, environment, feedthrough=False) for k in self.kinds}
            after = step.finish(values, carry, tick, numbers, environment)
            saw = step.recorded(environment)
            return step.empty(), {}, (after, inputs, saw, step.finite((after.states, after.held, saw)))

        outs = (-1, 0, (-1, 0, -1, -1) if final else ())
        return jax.jit(
            jax.vmap(one, in_axes=(self.axes, -1, None, -1, 0, -1), out_axes=outs, axis_size=len(self.seeds))
        )

    def _hosts_after(self, batches: list[int]) -> list[int]:
        """The hosts of the stage after these batches."""
        following = next(s for s, (_, pure) in enumerate(self._stages) if pure is batches) + 1
        return self._stages[following][0]

    def _output(
        self, k: int, host: Host, block: HostBlock, inputs: Mapping[str, Any], now: HostMoment
    ) -> dict[str, np.ndarray]:
        """A host's outputs. Their shapes are checked here, because hosts are not part of compiled code, where mistakes
        would show.
        """
        given = host.output(block, {name: np.array(value) for name, value in inputs.items()}, now)
        made = {}
        for name, kind, shape in self._ports[k]:
            made[name] = value = np.array(given[name], kind)
            if value.shape[1:] != shape or len(value) != len(self.seeds):
                address = f"{self._placed(k).path}.{name}"
                wanted = (len(self.seeds), *shape)
                raise ValueError(f"{address}: the host returns shape {value.shape}: must be {wanted}, seeds first")
        return made

    def _block(self, k: int, values: Values) -> HostBlock:
        """A host block with its current parameters."""
        block = self.step.kinds[k].block
        assert isinstance(block, HostBlock)
        return block.bound({name: rows[0] for name, rows in values[k].items()})

    def _placed(self, k: int) -> Placed:
        return self.step.plan.blocks[self.step.kinds[k].members[0]]

    def _now(self, k: int, tick: int, uniforms: np.ndarray | None) -> HostMoment:
        length = self.step.plan.tick
        numbers = np.zeros((len(self.seeds), 0), np.float32) if uniforms is None else uniforms
        return HostMoment(tick, tick * length, self._ticks[k] * length, numbers)
