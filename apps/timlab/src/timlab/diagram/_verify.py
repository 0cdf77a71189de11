"""Checks that a block's functions match its declarations, by abstract evaluation: only shapes and dtypes are
computed.
"""

import functools
import math
from collections.abc import Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, PyTree

from timlab.diagram._block import Block, HostBlock, Moment, Signals
from timlab.diagram._declarations import Port
from timlab.diagram._foreign import Foreign
from timlab.diagram._placed import Placed, Problem

Shape = jax.ShapeDtypeStruct


def kind_of(block: Block) -> tuple[Any, ...]:
    """What blocks must share to be evaluated together: type, settings, and shapes of parameters."""
    shapes = [(name, np.shape(value)) for name, value in block.values().items()]
    return type(block), block.structure, tuple(shapes), jnp.result_type(float).name


def verify(placed: Placed) -> list[Problem]:
    """The problems with a block's functions."""
    if isinstance(placed.block, Foreign) and not placed.block.is_trusted:
        return [Problem(placed.path, None, placed.block.distrust)]
    if isinstance(placed.block, HostBlock):
        return []
    found = _verified(_ByKind(placed.block))
    return [Problem(placed.path, port, message) for port, message in found]


class _ByKind:
    """A block that compares equal to all blocks of its kind, so that each kind is checked once."""

    def __init__(self, block: Block):
        self.block = block
        self.kind = kind_of(block)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByKind) and self.kind == other.kind

    def __hash__(self) -> int:
        return hash(self.kind)


@functools.lru_cache(4096)
def _verified(one: _ByKind) -> list[tuple[str | None, str]]:
    return list(function_problems(one.block))


def function_problems(block: Block) -> Iterator[tuple[str | None, str]]:
    """The problems with a block's functions, each with the output port that it concerns."""
    real = jnp.result_type(float)
    values = {name: Shape(value.shape, value.dtype) for name, value in block.values().items()}
    seconds = Shape((), real)
    now: Any = Moment(Shape((), jnp.uint32), seconds, seconds, Shape((block.uniforms,), real), *(seconds,) * 3)  # type: ignore[arg-type]
    all_inputs = _signals(block.inputs)
    direct = _signals({name: port for name, port in block.inputs.items() if port.feedthrough})

    def shapes(name: str, *arguments: PyTree[Shape]) -> Any:
        def function(values: Mapping[str, Array], *rest: PyTree[Array]) -> Any:
            return getattr(block.bound(values), name)(*rest)

        return jax.eval_shape(function, values, *arguments)

    name = "init"
    try:
        state = shapes(name, Shape((block.init_uniforms,), real))
        name = "output"
        given = shapes(name, state, direct, now)
        yield from _outputs(block, given)
        if block.jumps and block.timing == "continuous":
            name = "next_jump"
            given = shapes(name, now)
            if given.shape != () or not jnp.issubdtype(given.dtype, jnp.floating):
                yield None, f"next_jump: returns {given.dtype}{list(given.shape)}: must be one time in seconds"
        name = "crossings"
        given = shapes(name, state, all_inputs, now)
        if given.ndim != 1 or not jnp.issubdtype(given.dtype, jnp.floating):
            yield None, f"crossings: returns {given.dtype}{list(given.shape)}: must be one row of real numbers"
            return
        name = "update"
        after = [(name, shapes(name, state, all_inputs, now))]
        if block.switches:
            name = "crossed"
            sides = Shape(given.shape, bool)
            after.append((name, shapes(name, state, all_inputs, now._replace(above=sides, turned=sides))))
        if block.is_continuous:
            name = "derivative"
            after.append((name, shapes(name, state, all_inputs, now)))
            if not all(jnp.issubdtype(leaf.dtype, jnp.floating) for leaf in jax.tree.leaves(state)):
                yield None, "init: a continuous state must consist of floats"
    except KeyError as error:
        yield None, f"{name}: reads the input {error}, which does not exist or is declared without feedthrough"
        return
    except Exception as error:  # the block's own code may raise anything
        yield None, f"{name}: {type(error).__name__}: {' '.join(str(error).split())[:200]}"
        return
    for name, tree in after:
        yield from _same(name, tree, state)


def crossings_of(block: Block) -> int:
    """The number of a block's zero crossings."""
    return 0 if type(block).crossings is Block.crossings else _crossings(_ByKind(block))


@functools.lru_cache(4096)
def _crossings(one: _ByKind) -> int:
    block = one.block
    real = jnp.result_type(float)
    values = {name: Shape(value.shape, value.dtype) for name, value in block.values().items()}

    def function(values: Mapping[str, Array], inputs: Signals, numbers: Array, own: Array) -> Any:
        now = Moment(jnp.uint32(0), *(numbers[0],) * 2, own, *(numbers[0],) * 3)  # type: ignore[call-arg]
        bound = block.bound(values)  # type: ignore[call-arg]
        return bound.crossings(bound.init(numbers[1:]), inputs, now)

    numbers = Shape((1 + block.init_uniforms,), real)
    own = Shape((block.uniforms,), real)
    return jax.eval_shape(function, values, _signals(block.inputs), numbers, own).shape[0]


def numbers_at_ports(block: Block) -> int:
    """How many numbers a block takes and gives at a time."""
    return sum(math.prod(port.shape) for ports in (block.inputs, block.outputs) for port in ports.values())


def numbers_in_state(block: Block) -> int:
    """How many numbers a block's state has; a host keeps its own."""
    return 0 if isinstance(block, HostBlock) or type(block).init is Block.init else _numbers_in_state(_ByKind(block))


@functools.lru_cache(4096)
def _numbers_in_state(one: _ByKind) -> int:
    block = one.block
    values = {name: Shape(value.shape, value.dtype) for name, value in block.values().items()}
    uniforms = Shape((block.init_uniforms,), jnp.result_type(float))
    state = jax.eval_shape(lambda values, uniforms: block.bound(values).init(uniforms), values, uniforms)
    return sum(math.prod(leaf.shape) for leaf in jax.tree.leaves(state))


def _signals(ports: Mapping[str, Port]) -> dict[str, Shape]:
    return {name: Shape(port.shape, port.dtype) for name, port in ports.items()}


def _outputs(block: Block, given: object) -> Iterator[tuple[str | None, str]]:
    if not isinstance(given, dict) or set(given) != set(block.outputs):
        names = sorted(given) if isinstance(given, dict) else type(given).__name__
        yield None, f"output: returns {names}, but the block declares {sorted(block.outputs)}"
        return
    for name, port in block.outputs.items():
        shape = tuple(given[name].shape)
        kind = jnp.result_type(given[name])
        if shape != port.shape or not _converts(kind, port.dtype):
            yield name, f"output: returns {kind.name}{list(shape)}, but the port declares {port.describe()}"


def _same(name: str, tree: PyTree[Shape], state: PyTree[Shape]) -> Iterator[tuple[str | None, str]]:
    if jax.tree.structure(tree) != jax.tree.structure(state):
        yield None, f"{name}: returns {jax.tree.structure(tree)}, but the state is {jax.tree.structure(state)}"
        return
    for (place, leaf), own in zip(jax.tree_util.tree_leaves_with_path(tree), jax.tree.leaves(state), strict=True):
        if leaf.shape != own.shape or not _converts(leaf.dtype, own.dtype):
            where = f"state{jax.tree_util.keystr(place)}"
            yield (
                None,
                f"{name}: returns {leaf.dtype}{list(leaf.shape)} for {where}, which is {own.dtype}{list(own.shape)}",
            )


def _converts(given: DTypeLike, wanted: DTypeLike) -> bool:
    """Whether a dtype converts to another one without loss of kind."""
    order = [jnp.issubdtype(kind, jnp.floating) * 2 + jnp.issubdtype(kind, jnp.integer) for kind in (given, wanted)]
    return order[0] <= order[1]
