"""The continuous states of a diagram as a program: from time, inlets and states to outlets and time derivatives."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._errors import check
from motorgrad.export import Program, traced
from timlab.compiler import Carry, Continuous, Step, Values
from timlab.diagram import Diagram, HostBlock, Inlet, Outlet, Port, in_precision
from timlab.engine import Run
from timlab.fmi._step import NO_HOST, ports_of, resting_values, with_inlets

OTHERS = "without memory, random numbers or jumps, beside continuous states: others are exported for co-simulation"


@dataclasses.dataclass(frozen=True)
class SlopeProgram:
    """A diagram as ordinary differential equations.

    - `step`: inputs `u0`, `u1`, …, the states `x0`, `x1`, …, and `time` in seconds. Outputs `y0`, `y1`, …, and the
      derivatives `dx0`, `dx1`, ….
    - `start`: the states to begin with.
    - `states`: the names of the elements of all states, in order.
    - `inlets`, `outlets`, `resting`, `length`, `stops`: as of a `TickProgram`.
    """

    step: Program
    start: dict[str, np.ndarray]
    states: list[str]
    inlets: dict[str, Port]
    outlets: dict[str, Port]
    resting: list[np.ndarray]
    length: float
    stops: bool


def slope_program(source: Diagram | Run) -> SlopeProgram:
    """The program of a diagram, or of a run of one seed, from its present states.

    **Raises:** `ValueError` for a diagram in single precision, a run of several seeds, and a block with anything but
    continuous states; `Untranslatable` for a block that uses an operation which an export does not know.
    """
    run = Run(source) if isinstance(source, Diagram) else source
    check(len(run.seeds) == 1, "seeds", run.seeds.tolist(), "a single one, to be exported")
    precision = run.plan.solver.precision
    check(precision == "double", "precision", precision, "'double', to be exported for model exchange")
    with in_precision(precision):
        return _program(run)


def _program(run: Run) -> SlopeProgram:
    step, values, carry = run.functions_at(0)
    _check_continuous(step, values, carry)
    places = ports_of(run.plan)
    blocks = run.plan.blocks
    rows = step.stacks.rows
    begin = {k: carry.states[k] for k in step.movers}
    leaves, structure = jax.tree.flatten(begin)

    def slopes(time: Array, **given: Array) -> dict[str, Any]:
        inputs = {rows[i]: given[f"u{n}"] for n, i in enumerate(places[Inlet])}
        now = with_inlets(step, values, inputs)
        states = jax.tree.unflatten(structure, [given[f"x{n}"] for n in range(len(leaves))])
        own = Carry({**carry.states, **states}, carry.held, carry.above, carry.pace, carry.shares, carry.fault)
        start = jnp.uint32(0)
        held = step.outputs(range(len(step.stacks.batches)), now, own, start, {}, step.empty())
        system = Continuous(step, now, own, start, {}, held)
        there, found = system.seen(states, time[0])
        recorded = step.recorded(there)
        outputs = {f"y{n}": recorded[rows[i][0]]["u"][rows[i][1]] for n, i in enumerate(places[Outlet])}
        return outputs | {f"dx{n}": slope for n, slope in enumerate(jax.tree.leaves(found))}

    start = {f"x{n}": np.asarray(leaf) for n, leaf in enumerate(leaves)}
    inlets = {blocks[i].path: blocks[i].block.outputs["y"] for i in places[Inlet]}
    like = {f"u{n}": jax.ShapeDtypeStruct(port.shape, port.dtype) for n, port in enumerate(inlets.values())}
    program = traced(slopes, {**start, **like, "time": jax.ShapeDtypeStruct((1,), jnp.float64)})
    outlets = {blocks[i].path: blocks[i].block.inputs["u"] for i in places[Outlet]}
    resting = resting_values(values, rows, places[Inlet], inlets)
    names = [name for k in step.movers for name in _names(step, k, carry.states[k])]
    return SlopeProgram(program, start, names, inlets, outlets, resting, run.plan.tick, run.plan.on_fault == "stop")


def _names(step: Step, k: int, state: PyTree[Array]) -> list[str]:
    """The names of the elements of a kind's states, leaf by leaf: paths of blocks, with indices in larger states."""
    found = []
    leaves = jax.tree.leaves(state)
    for number, leaf in enumerate(leaves):
        for row, *place in np.ndindex(leaf.shape):
            indices = ([] if len(leaves) == 1 else [number]) + place
            path = step.plan.blocks[step.kinds[k].members[row]].path
            where = f"[{','.join(map(str, indices))}]" if indices else ""
            found.append(f"{path}.state{where}")
    return found


def _check_continuous(step: Step, values: Values, carry: Carry) -> None:
    """Refuse blocks that differential equations cannot say."""
    for placed in step.plan.blocks:
        check(not isinstance(placed.block, HostBlock), placed.path, type(placed.block).__name__, NO_HOST)
    first = next((step.plan.blocks[i].path for i in step.plan.torn), "")
    check(not step.plan.torn, first, "an algebraic loop", "part of none, to be exported")
    for k, kind in enumerate(step.kinds):
        stateful = not kind.block.is_continuous and (kind.held or bool(jax.tree.leaves(carry.states.get(k, ()))))
        eventful = k in step.crossings or k in step.jumping or bool(kind.block.uniforms)
        wrong = stateful or eventful or (k in step.movers and _moves_at_ticks(step, k, values, carry))
        check(not wrong, step.plan.blocks[kind.members[0]].path, type(kind.block).__name__, OTHERS)


def _moves_at_ticks(step: Step, k: int, values: Values, carry: Carry) -> bool:
    """Whether a continuous state is changed at the end of a tick, as by limits."""
    now = step.now(k, jnp.uint32(0), {})
    inputs = {
        name: jnp.zeros((len(step.kinds[k].members), *port.shape), port.dtype)
        for name, port in step.kinds[k].block.inputs.items()
    }
    made = jax.make_jaxpr(lambda state: step.apply("update", k, values[k], state, inputs, now))(carry.states[k])
    return list(made.jaxpr.outvars) != list(made.jaxpr.invars)
