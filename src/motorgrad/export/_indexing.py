"""How elements at computed places are looked up and replaced."""

import jax.numpy as jnp
import numpy as np
from jax.extend.core import JaxprEqn
from jax.lax import GatherScatterMode

from motorgrad.export._builder import Builder, rule
from motorgrad.export._rules import as_index, clipped, number, out_of


def _strides(shape: tuple[int, ...]) -> list[int]:
    return [int(np.prod(shape[axis + 1 :])) for axis in range(len(shape))]


def _weighted(b: Builder, place: int, weight: int, total: int) -> int:
    """`total` plus `weight` times an array of places."""
    return b.elementwise("add", b.elementwise("mul", place, number(b, weight)), total)


@rule("gather")
def _gather(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    """Each element's place is a known offset, plus clipped starts that are looked up among the indices."""
    (source, indices) = operands
    out = out_of(equation)
    numbers = equation.params["dimension_numbers"]
    sizes = equation.params["slice_sizes"]
    shape = b.operations[source].shape
    looked = b.operations[indices].shape
    if b.known(indices) is not None:
        places = jnp.arange(int(np.prod(shape)), dtype=jnp.int32).reshape(shape)
        index = np.asarray(equation.primitive.bind(places, jnp.asarray(b.known(indices)), **equation.params))
        if index.size == 0 or 0 <= index.min() <= index.max() < np.prod(shape):
            return b.take(source, index)
    coordinates = np.indices(out.shape)
    strides = _strides(shape)
    batch = [coordinates[axis] for axis in range(len(out.shape)) if axis not in numbers.offset_dims]
    offset = np.zeros(out.shape, np.int64)
    gone = {*numbers.collapsed_slice_dims, *numbers.operand_batching_dims}
    kept = [axis for axis in range(len(shape)) if axis not in gone]
    for axis, dimension in zip(numbers.offset_dims, kept, strict=True):
        offset += strides[dimension] * coordinates[axis]
    for dimension, axis in zip(numbers.operand_batching_dims, numbers.start_indices_batching_dims, strict=True):
        offset += strides[dimension] * batch[axis]
    place = b.constant(offset.astype(np.int32))
    inside = None
    for column, dimension in enumerate(numbers.start_index_map):
        where = np.ravel_multi_index((*batch, np.full(out.shape, column)), looked)
        start = as_index(b, b.take(indices, where))
        most = shape[dimension] - sizes[dimension]
        inner = clipped(b, start, most)
        same = b.elementwise("eq", start, inner, dtype=bool)
        inside = same if inside is None else b.elementwise("and", inside, same)
        place = _weighted(b, inner, strides[dimension], place)
    made = b.pick(source, place)
    if equation.params["mode"] != GatherScatterMode.FILL_OR_DROP or inside is None:
        return made
    fill = equation.params["fill_value"]
    if fill is None:
        fill = np.nan if out.dtype.kind == "f" else out.dtype.kind == "b" or np.iinfo(out.dtype).min
    return b.elementwise("select", inside, made, b.constant(np.asarray(fill, out.dtype)))


@rule("dynamic_slice")
def _dynamic_slice(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    source, *starts = operands
    shape = b.operations[source].shape
    sizes = equation.params["slice_sizes"]
    strides = _strides(shape)
    offset = sum(stride * axis for stride, axis in zip(strides, np.indices(sizes), strict=True))
    place = b.constant(np.asarray(offset, np.int32))
    for start, stride, length, size in zip(starts, strides, shape, sizes, strict=True):
        place = _weighted(b, clipped(b, as_index(b, start), length - size), stride, place)
    return b.pick(source, place)


@rule("dynamic_update_slice")
def _dynamic_update_slice(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    """The new elements within the window, the old ones elsewhere."""
    source, update, *starts = operands
    shape = b.operations[source].shape
    sizes = b.operations[update].shape
    place = b.constant(np.zeros(shape, np.int32))
    inside = None
    for axis, (start, stride) in enumerate(zip(starts, _strides(sizes), strict=True)):
        begin = clipped(b, as_index(b, start), shape[axis] - sizes[axis])
        within = b.elementwise("sub", b.constant(np.indices(shape)[axis].astype(np.int32)), begin)
        inner = clipped(b, within, sizes[axis] - 1)
        same = b.elementwise("eq", within, inner, dtype=bool)
        inside = same if inside is None else b.elementwise("and", inside, same)
        place = _weighted(b, inner, stride, place)
    return update if inside is None else b.elementwise("select", inside, b.pick(update, place), source)
