"""A pure function of JAX as a short list of plain operations on arrays, for other languages to spell."""

from collections.abc import Callable, Collection, Mapping

import jax
from jaxtyping import Array

import motorgrad.export._indexing
import motorgrad.export._rules  # noqa: F401  (their rules)
from motorgrad.export._builder import Builder, Shaped
from motorgrad.export._program import Operation, Program


def traced(
    function: Callable[..., Mapping[str, Array]], inputs: Mapping[str, Shaped], lacks: Collection[str] = ()
) -> Program:
    """The program of a pure function of JAX, in which what depends on no input is computed now.

    **Arguments:**

    - `function`: takes the inputs by name and returns arrays by name.
    - `inputs`: an array, or anything else with a shape and a dtype, for each input.
    - `lacks`: special functions that a target lacks, of `erf`, `erfc`, `expm1` and `log1p`. Others take their place.

    **Raises:** `Untranslatable` that names the operation of JAX, where there is no rule for it.

    ```python
    program = traced(lambda angle: {"torque": -2.0 * jnp.sin(angle)}, {"angle": jnp.zeros(3)})
    ```
    """
    closed, shapes = jax.make_jaxpr(lambda given: dict(function(**given)), return_shape=True)(dict(inputs))
    builder = Builder(lacks)
    leaves = [builder.given(name, inputs[name]) for name in sorted(inputs)]
    made = builder.run(closed.jaxpr, closed.consts, leaves)
    found = dict(zip(sorted(shapes), made, strict=True))
    return _needed(builder.operations, {name: found[name] for name in shapes}, inputs)


def _needed(operations: list[Operation], outputs: dict[str, int], inputs: Mapping[str, Shaped]) -> Program:
    """The program of the operations that the outputs need, and of all inputs."""
    names = {
        operation.attributes["name"]: place for place, operation in enumerate(operations) if operation.kind == "input"
    }
    needed = set(names.values())
    waiting = list(outputs.values())
    while waiting:
        place = waiting.pop()
        if place not in needed:
            needed.add(place)
            waiting += operations[place].operands
    order = {place: new for new, place in enumerate(sorted(needed))}
    kept = tuple(
        operations[place]._replace(operands=tuple(order[each] for each in operations[place].operands))
        for place in order
    )
    return Program(
        kept, {name: order[names[name]] for name in inputs}, {name: order[place] for name, place in outputs.items()}
    )
