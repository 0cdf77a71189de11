"""One tick of a diagram as a program: from the state and the inlets to the outlets and the next state."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad.export import Program, traced
from timlab.compiler import Plan, Step, Values
from timlab.diagram import Diagram, HostBlock, Inlet, Outlet, Port
from timlab.engine import Run
from timlab.fmi._random import draw


@dataclasses.dataclass(frozen=True)
class TickProgram:
    """A diagram as a program.

    - `step`: one tick. Inputs `u0`, `u1`, …, the `state0`, `state1`, …, and `tick`, the number of completed ticks.
      Outputs `y0`, `y1`, …, the state after the tick, and `tick`.
    - `outputs`: from the same inputs the same `y0`, `y1`, … alone, so those at the time that the state belongs to.
    - `start`: the state and the tick to begin with.
    - `inlets`, `outlets`: the ports by their names in the diagram, in the order of `u0`, … and `y0`, ….
    - `resting`: the values of the inlets where nothing is set.
    - `length` of a tick, in seconds.
    - `owners`: for each array of the state that is to stay finite, the paths of the blocks that its rows belong to.
    - `stops`: whether a number that is not finite ends a simulation.
    """

    step: Program
    outputs: Program
    start: dict[str, np.ndarray]
    inlets: dict[str, Port]
    outlets: dict[str, Port]
    resting: list[np.ndarray]
    length: float
    owners: dict[str, list[str]]
    stops: bool


def tick_program(source: Diagram | Run) -> TickProgram:
    """The program of a diagram, from its first tick, or of a run of one seed, from its present state.

    **Raises:** `ValueError` for a run of several seeds, a solver other than RK4, double precision, and a block that
    runs on the host; `Untranslatable` for a block that uses an operation which an export does not know; `DiagramError`
    for a diagram that cannot run.
    """
    check_arguments(tick_program, locals())
    run = Run(source) if isinstance(source, Diagram) else source
    check(len(run.seeds) == 1, "seeds", run.seeds.tolist(), "a single one, to be exported")
    check(not run.plan.solver.adapts, "solver", run.plan.solver.name, "'rk4', to be exported")
    check(run.plan.solver.precision == "single", "precision", run.plan.solver.precision, "'single', to be exported")
    blocks = run.plan.blocks
    for placed in blocks:
        check(not isinstance(placed.block, HostBlock), placed.path, type(placed.block).__name__, NO_HOST)
    if any(placed.block.is_continuous for placed in blocks):
        for placed in (blocks[i] for i in sorted(run.plan.moving)):
            check(not placed.block.jumps, placed.path, type(placed.block).__name__, NO_JUMPS)
    places = ports_of(run.plan)
    step, values, carry = run.functions_at(0)
    rows = step.stacks.rows
    leaves, structure = jax.tree.flatten(carry)
    names = [f"state{n}" for n in range(len(leaves))]
    seed = int(run.seeds[0])

    def ticked(tick: Array, **given: Array) -> dict[str, Any]:
        inputs = [given[f"u{n}"] for n in range(len(places[Inlet]))]
        now = with_inlets(step, values, {rows[i]: u for i, u in zip(places[Inlet], inputs, strict=True)})
        before = jax.tree.unflatten(structure, [given[name] for name in names])
        numbers = _numbers(step, seed, tick)
        environment = step.outputs(range(len(step.stacks.batches)), now, before, tick, numbers, step.empty())
        after = step.finish(now, before, tick, numbers, environment)
        seen = step.recorded(environment)
        outputs = {f"y{n}": seen[rows[i][0]]["u"][rows[i][1]] for n, i in enumerate(places[Outlet])}
        return outputs | dict(zip(names, jax.tree.leaves(after), strict=True)) | {"tick": tick + 1}

    start = dict(zip(names, map(np.asarray, leaves), strict=True)) | {"tick": np.asarray(run.tick, np.uint32)}
    inlets = {blocks[i].path: blocks[i].block.outputs["y"] for i in places[Inlet]}
    like = {f"u{n}": jax.ShapeDtypeStruct(port.shape, port.dtype) for n, port in enumerate(inlets.values())}
    program = traced(ticked, {**start, **like})
    shown = {name: place for name, place in program.outputs.items() if name not in program.inputs}
    outputs = traced(
        lambda **given: {name: value for name, value in ticked(**given).items() if name in shown}, start | like
    )
    outlets = {blocks[i].path: blocks[i].block.inputs["u"] for i in places[Outlet]}
    resting = resting_values(values, rows, places[Inlet], inlets)
    owners = {
        name: [blocks[i].path for i in step.kinds[place[1].key].members]
        for name, (place, leaf) in zip(names, jax.tree_util.tree_leaves_with_path(carry), strict=True)
        if place[0].name == "states" and leaf.dtype.kind == "f" and np.isfinite(leaf).all()
    }
    stops = run.plan.on_fault == "stop"
    return TickProgram(program, outputs, start, inlets, outlets, resting, run.plan.tick, owners, stops)


NO_JUMPS = "a source that is held within a tick, beside continuous blocks: set its period to that of the diagram's tick"
NO_HOST = "a block that is compiled: one that runs on the host cannot be exported"


def ports_of(plan: Plan) -> dict[Any, list[int]]:
    """The indices of the inlets and of the outlets of the outermost diagram."""
    outermost = [(i, type(each.block)) for i, each in enumerate(plan.blocks) if "/" not in each.path]
    return {kind: [i for i, own in outermost if own is kind] for kind in (Inlet, Outlet)}


def resting_values(
    values: Values, rows: Sequence[tuple[int, int]], places: list[int], inlets: dict[str, Port]
) -> list[np.ndarray]:
    """The values of the inlets where nothing is set."""
    found = [np.asarray(values[rows[i][0]]["value"][rows[i][1]]) for i in places]
    ports = inlets.values()
    return [np.broadcast_to(own, port.shape).astype(port.dtype) for own, port in zip(found, ports, strict=True)]


def with_inlets(step: Step, values: Values, given: dict[tuple[int, int], Any]) -> Any:
    """The parameters with the values of inlets."""
    changed = {k: dict(names) for k, names in values.items()}
    for k in {k for k, _ in given}:
        kept = values[k]["value"]
        shape = step.kinds[k].block.outputs["y"].shape
        rows = [given.get((k, row), kept[row]) for row in range(len(kept))]
        changed[k]["value"] = jnp.stack([jnp.broadcast_to(jnp.asarray(each, kept.dtype), shape) for each in rows])
    return changed


def _numbers(step: Step, seed: int, tick: Array) -> dict[int, Any]:
    """The random numbers of a tick, by kind."""
    made = {}
    for k in step.chance:
        streams = [step.plan.blocks[i].stream for i in step.kinds[k].members]
        made[k] = jnp.stack([draw(seed, stream, tick, step.kinds[k].block.uniforms) for stream in streams])
    return made
