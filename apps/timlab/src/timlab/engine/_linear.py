"""The linear system that a diagram is near its current state, and whether fixed steps are short enough for it."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from motorgrad._errors import check, unknown
from timlab.compiler import SPAN, Carry, Continuous, Step, rk4_growth
from timlab.diagram import HostBlock, in_precision
from timlab.engine._compiled import Compiled


class Linear(NamedTuple):
    r"""A linear system, $\dot x = A x + B u$ or $x_{t+1} = A x_t + B u_t$, with $y = C x + D u$, in deviations from an
    operating point, whose values are `state`, `input` and `output`.

    - `A` (states, states), `B` (states, inputs), `C` (outputs, states), `D` (outputs, inputs).
    - `states`, `inputs`, `outputs`: their names, `"block"` or `"block.port"`, with `[k]` for elements of arrays.
    - `tick` (s): the length of a step; 0 for a continuous system.
    """

    A: Float[np.ndarray, "states states"]
    B: Float[np.ndarray, "states inputs"]
    C: Float[np.ndarray, "outputs states"]
    D: Float[np.ndarray, "outputs inputs"]
    states: list[str]
    inputs: list[str]
    outputs: list[str]
    state: Float[np.ndarray, " states"]
    input: Float[np.ndarray, " inputs"]
    output: Float[np.ndarray, " outputs"]
    tick: float


def linearised(run: Compiled, inputs: Sequence[str], outputs: Sequence[str], discrete: bool, seed: int) -> Linear:
    """The linear system that a diagram is near its current state; see `timlab.linearise`."""
    for placed in run.plan.blocks:
        if isinstance(placed.block, HostBlock):
            raise ValueError(f"{placed.path}: runs on the host and has no derivative: linearise the diagram without it")
    check(0 <= seed < len(run.seeds), "seed", seed, f"a row of the run, 0 … {len(run.seeds) - 1}")
    with in_precision(run.plan.solver.precision):
        return _linearised(run, inputs, outputs, discrete, seed)


def _linearised(run: Compiled, inputs: Sequence[str], outputs: Sequence[str], discrete: bool, seed: int) -> Linear:
    widths = [np.size(run[address]) for address in inputs]
    step, values, carry = run.functions_at(seed)
    tick = jnp.uint32(run.tick)
    number = jnp.int32(run.seeds[seed])
    span = jax.jit(step.numbers)(number, jnp.uint32(run.tick // SPAN))
    numbers = {k: drawn[run.tick % SPAN] for k, drawn in span.items()}
    states = _States(step, carry, discrete)
    places = [_parameter(step, address) for address in inputs]
    sources = [_output(step, address) for address in outputs]
    u, unravel = ravel_pytree([values[k][name][row] for k, row, name in places])

    def system(x: Array, u: Array) -> tuple[Array, Array]:
        own = {k: dict(arrays) for k, arrays in values.items()}
        for (k, row, name), part in zip(places, unravel(u), strict=True):
            own[k][name] = jnp.asarray(own[k][name]).at[row].set(part)
        now = carry._replace(states=states.unpacked(x))
        batches = range(len(step.stacks.batches))
        environment = step.outputs(batches, own, now, tick, numbers, step.empty())
        if discrete:
            after = step.finish(own, now, tick, numbers, environment).states
        else:
            movers = {k: now.states[k] for k in step.movers}
            after = Continuous(step, own, now, tick, numbers, environment).slopes(movers, 0.0)
        return states.packed(after), ravel_pytree(
            [environment[batch][port][row] * 1.0 for batch, row, port, _ in sources]
        )[0]

    @jax.jit  # one program: each operation by itself would be compiled
    def slopes(x: Array, u: Array) -> tuple[Any, Any, Array]:
        return jax.jacfwd(system, 0)(x, u), jax.jacfwd(system, 1)(x, u), system(x, u)[1]

    x = states.packed(carry.states)
    (a, c), (b, d), y = slopes(x, u)
    a, b, c, d, x, u, y = map(np.asarray, (a, b, c, d, x, u, y))
    names = states.names, _entry_names(inputs, widths), _entry_names(outputs, [size for *_, size in sources])
    return Linear(a, b, c, d, *names, x, u, y, run.plan.tick if discrete else 0.0)


class _States:
    """The real numbers in the states of a diagram, as one vector, block by block."""

    def __init__(self, step: Step, carry: Carry, discrete: bool):
        self._like = {k: jax.tree.flatten(state) for k, state in carry.states.items()}
        self._entries: list[tuple[int, int, int]] = []
        sizes: dict[str, int] = {}
        for i, placed in enumerate(step.plan.blocks):
            k, row = step.stacks.rows[i]
            if not discrete and k not in step.movers:
                continue
            for number, leaf in enumerate(self._like[k][0]):
                if jnp.issubdtype(leaf.dtype, jnp.floating):
                    self._entries.append((k, number, row))
                    sizes[placed.path] = sizes.get(placed.path, 0) + leaf[row].size
        self.names = _entry_names(list(sizes), list(sizes.values()))

    def packed(self, states: Mapping[int, Any]) -> Array:
        leaves = {k: jax.tree.leaves(state) for k, state in states.items()}
        return jnp.concatenate([jnp.zeros(0), *(leaves[k][leaf][row].ravel() for k, leaf, row in self._entries)])

    def unpacked(self, x: Array) -> dict[int, Any]:
        leaves = {k: list(flat) for k, (flat, _) in self._like.items()}
        start = 0
        for k, number, row in self._entries:
            leaf = leaves[k][number]
            part = x[start : start + leaf[row].size]
            leaves[k][number] = leaf.at[row].set(part.reshape(leaf[row].shape))
            start += part.size
        return {k: jax.tree.unflatten(tree, leaves[k]) for k, (_, tree) in self._like.items()}


def _parameter(step: Step, address: str) -> tuple[int, int, str]:
    """The kind, row and name of a parameter."""
    path, _, name = address.partition(".")
    k, row = step.stacks.rows[next(i for i, placed in enumerate(step.plan.blocks) if placed.path == path)]
    declared = step.kinds[k].block.parameters[name]
    check(declared.kind == "float", "inputs", address, f"real numbers; {address} must be {declared.allowed}")
    return k, row, name


def _output(step: Step, address: str) -> tuple[int, int, str, int]:
    """The batch, row, port and size of an output."""
    found = {
        f"{placed.path}.{name}": (*step.stacks.places[i], name, int(np.prod(port.shape)))
        for i, placed in enumerate(step.plan.blocks)
        for name, port in placed.block.outputs.items()
    }
    if address not in found:
        raise unknown("output", address, found)
    return found[address]


def _entry_names(addresses: Sequence[str], sizes: Sequence[int]) -> list[str]:
    """The names of single numbers, for addresses with these sizes."""
    pairs = zip(addresses, sizes, strict=True)
    return [address if size == 1 else f"{address}[{n}]" for address, size in pairs for n in range(size)]


def unstable_modes(run: Compiled, seed: int) -> list[str]:
    """The modes that die out, but grow under fixed steps, a line for each; see `timlab.unstable_steps`."""
    if run.plan.solver.adapts or not any(placed.block.is_continuous for placed in run.plan.blocks):
        return []
    linear = linearised(run, (), (), False, seed)
    step = run.plan.tick / run.plan.solver.substeps
    matrix = linear.A.astype(float)
    if not np.isfinite(matrix).all():
        return []
    rates: Any
    rates, right = np.linalg.eig(matrix)
    left = np.linalg.pinv(right)
    growth = rk4_growth(step * rates)
    lines: dict[str, str] = {}
    for n in np.flatnonzero((rates.real < 0) & (growth > 1 + 1e-5)):
        block = linear.states[int(np.argmax(np.abs(right[:, n] * left[n])))].partition("[")[0]
        lines.setdefault(
            block,
            f"{block}: RK4 steps of {step:g} s are unstable: they multiply a part that dies out at "
            f"{-rates[n].real:.3g} per second by {growth[n]:.3g} in each step; use a shorter tick, more substeps, or "
            'solver="rodas5p"',
        )
    return list(lines.values())
