"""Rules that express each operation of JAX by plain ones."""

import string
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax.extend.core import JaxprEqn

from motorgrad.export._builder import Builder, aval_of, rule
from motorgrad.export._program import Untranslatable
from motorgrad.export._special import special

UNARY = "neg abs sign floor ceil exp log sqrt sin cos tan asin acos atan sinh cosh tanh lgamma not is_finite"
BINARY = "add sub mul div rem pow max min atan2 and or xor shift_left shift_right_logical shift_right_arithmetic"
COMPARISONS = "eq ne lt le gt ge"
MOVES = "slice rev transpose tile"
IDENTITIES = "stop_gradient copy optimization_barrier reduce_precision"
MAX_UNROLLED_STEPS = 64


def out_of(equation: JaxprEqn) -> Any:
    """The shape and the type of what an operation makes, of its first array where it makes several."""
    return aval_of(equation.outvars[0])


@rule(*UNARY.split(), *BINARY.split(), *COMPARISONS.split(), "lt_to", "le_to")
def _elementwise(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    # the orders by which JAX searches and sorts are the usual ones but for NaN, which they place last, and for zeros
    return b.elementwise(equation.primitive.name.removesuffix("_to"), *operands, dtype=out_of(equation).dtype)


@rule(*IDENTITIES.split())
def _identity(b: Builder, operands: list[int], equation: JaxprEqn) -> list[int]:
    return operands


@rule("square")
def _square(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    return b.elementwise("mul", operands[0], operands[0])


@rule("integer_pow")
def _integer_pow(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    """A whole power, by repeated squaring, as XLA has it."""
    exponent = abs(equation.params["y"])
    base = operands[0]
    made = None
    one = b.constant(np.ones((), out_of(equation).dtype))
    while exponent:
        if exponent & 1:
            made = base if made is None else b.elementwise("mul", made, base)
        exponent >>= 1
        base = b.elementwise("mul", base, base) if exponent else base
    made = b.expand(one, out_of(equation).shape) if made is None else made
    return b.elementwise("div", one, made) if equation.params["y"] < 0 else made


@rule("rsqrt")
def _rsqrt(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    return b.elementwise("div", b.constant(np.ones((), out_of(equation).dtype)), b.elementwise("sqrt", operands[0]))


@rule("logistic")
def _logistic(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    one = b.constant(np.ones((), out_of(equation).dtype))
    falling = b.elementwise("exp", b.elementwise("neg", operands[0]))
    return b.elementwise("div", one, b.elementwise("add", one, falling))


@rule("round")
def _round(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    if "EVEN" in str(equation.params["rounding_method"]):
        return b.elementwise("rint", operands[0])
    half = b.constant(np.asarray(0.5, out_of(equation).dtype))
    size = b.elementwise("floor", b.elementwise("add", b.elementwise("abs", operands[0]), half))
    return b.elementwise("mul", b.elementwise("sign", operands[0]), size)


@rule("clamp")
def _clamp(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    low, x, high = operands
    return b.elementwise("min", b.elementwise("max", low, x), high)


@rule("convert_element_type")
def _convert(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    dtype = np.dtype(equation.params["new_dtype"])
    return operands[0] if b.operations[operands[0]].dtype == dtype else b.elementwise("convert", *operands, dtype=dtype)


@rule("bitcast_convert_type")
def _bitcast(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    return b.elementwise("bitcast", *operands, dtype=equation.params["new_dtype"])


@rule("select_n")
def _select(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    which, *cases = operands
    if b.operations[which].dtype == bool:
        return b.elementwise("select", which, cases[1], cases[0])
    made = cases[0]
    for number, case in enumerate(cases[1:], 1):
        there = b.elementwise("eq", which, b.constant(np.asarray(number, b.operations[which].dtype)), dtype=bool)
        made = b.elementwise("select", there, case, made)
    return made


@rule("reshape", "squeeze", "expand_dims")
def _reshape(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    return b.reshape(operands[0], out_of(equation).shape)


@rule("broadcast_in_dim")
def _broadcast(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    shape = equation.params["shape"]
    axes = equation.params["broadcast_dimensions"]
    ones = [1] * len(shape)
    for axis, size in zip(axes, b.operations[operands[0]].shape, strict=True):
        ones[axis] = size
    return b.expand(b.reshape(operands[0], tuple(ones)), shape)


@rule("iota")
def _iota(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    shape = equation.params["shape"]
    axis = equation.params["dimension"]
    return b.constant(np.indices(shape)[axis].astype(out_of(equation).dtype))


@rule(*MOVES.split())
def _move(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    """What only moves elements is applied to their places, which tells where each comes from."""
    shape = b.operations[operands[0]].shape
    places = jnp.arange(int(np.prod(shape)), dtype=jnp.int32).reshape(shape)
    return b.take(operands[0], np.asarray(equation.primitive.bind(places, **equation.params)))


@rule("concatenate")
def _concatenate(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    out = out_of(equation)
    return b.add("concatenate", tuple(operands), out.shape, out.dtype, axis=equation.params["dimension"])


@rule("stack")
def _stack(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    out = out_of(equation)
    axis = equation.params["axis"]
    shape = (*out.shape[:axis], 1, *out.shape[axis + 1 :])
    return b.add("concatenate", tuple(b.reshape(each, shape) for each in operands), out.shape, out.dtype, axis=axis)


@rule("pad")
def _pad(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    x, value = operands
    operation = b.operations[x]
    out = out_of(equation)
    size = int(np.prod(operation.shape))
    places = jnp.arange(size, dtype=jnp.int32).reshape(operation.shape)
    index = np.asarray(equation.primitive.bind(places, jnp.asarray(size, jnp.int32), **equation.params))
    if (index < size).all():
        return b.take(x, index)
    parts = b.reshape(x, (size,)), b.reshape(value, (1,))
    return b.take(b.add("concatenate", parts, (size + 1,), out.dtype, axis=0), index)


@rule("split")
def _split(b: Builder, operands: list[int], equation: JaxprEqn) -> list[int]:
    shape = b.operations[operands[0]].shape
    places = np.arange(int(np.prod(shape))).reshape(shape)
    ends = np.cumsum(equation.params["sizes"])[:-1]
    return [b.take(operands[0], index) for index in np.split(places, ends, equation.params["axis"])]


@rule("scan")
def _scan(b: Builder, operands: list[int], equation: JaxprEqn) -> list[int]:
    """A loop of few steps, written out."""
    params = equation.params
    length = params["length"]
    consts = params["num_consts"]
    carried = params["num_carry"]
    if length > MAX_UNROLLED_STEPS:
        raise Untranslatable(f"scan of {length} steps: an export writes out at most {MAX_UNROLLED_STEPS}")
    still = operands[:consts]
    carry = operands[consts : consts + carried]
    rows = operands[consts + carried :]
    seen: dict[int, list[int]] = {}
    for step in reversed(range(length)) if params["reverse"] else range(length):
        own = [_row(b, place, step) for place in rows]
        made = b.run(params["jaxpr"].jaxpr, params["jaxpr"].consts, [*still, *carry, *own])
        carry = made[:carried]
        seen[step] = made[carried:]
    stacks = []
    for number, variable in enumerate(equation.outvars[carried:]):
        parts = [seen[step][number] for step in range(length)]
        flat = tuple(b.reshape(part, (1, *b.operations[part].shape)) for part in parts)
        stacks.append(b.add("concatenate", flat, aval_of(variable).shape, aval_of(variable).dtype, axis=0))
    return [*carry, *stacks]


def _row(b: Builder, place: int, step: int) -> int:
    value = b.known(place)
    operation = b.operations[place]
    if value is not None:
        return b.constant(value[step])
    places = np.arange(int(np.prod(operation.shape))).reshape(operation.shape)
    return b.take(place, places[step])


def number(b: Builder, value: int) -> int:
    return b.constant(np.asarray(value, np.int32))


def clipped(b: Builder, place: int, most: int) -> int:
    return b.elementwise("min", b.elementwise("max", place, number(b, 0)), number(b, most))


def as_index(b: Builder, place: int) -> int:
    return place if b.operations[place].dtype == np.int32 else b.elementwise("convert", place, dtype=np.int32)


@rule("cond")
def _cond(b: Builder, operands: list[int], equation: JaxprEqn) -> list[int]:
    """All branches, of which one is chosen."""
    which, *given = operands
    branches = [b.run(branch.jaxpr, branch.consts, given) for branch in equation.params["branches"]]
    known = b.known(which)
    which = clipped(b, as_index(b, which), len(branches) - 1)
    if known is not None:
        return branches[int(np.clip(known, 0, len(branches) - 1))]
    made = branches[0]
    for n, branch in enumerate(branches[1:], 1):
        there = b.elementwise("eq", which, number(b, n), dtype=bool)
        made = [b.elementwise("select", there, new, old) for new, old in zip(branch, made, strict=True)]
    return made


@rule("erf", "erfc", "expm1", "log1p")
def _special(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    name = equation.primitive.name
    return special(b, name, operands[0]) if name in b.lacks else b.elementwise(name, operands[0])


@rule("reduce_sum", "reduce_prod", "reduce_max", "reduce_min", "reduce_and", "reduce_or")
def _reduce(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    out = out_of(equation)
    axes = tuple(int(axis) for axis in equation.params["axes"])
    if not axes:
        return operands[0]
    kind = {"and": "all", "or": "any"}.get(equation.primitive.name[7:], equation.primitive.name[7:])
    return b.add(f"reduce {kind}", tuple(operands), out.shape, out.dtype, axes=axes)


@rule("argmax", "argmin")
def _arg(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    out = out_of(equation)
    (axis,) = equation.params["axes"]
    return b.add(equation.primitive.name, tuple(operands), out.shape, out.dtype, axis=int(axis))


@rule("cumsum", "cumprod", "cummax", "cummin")
def _cumulative(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    out = out_of(equation)
    axis = int(equation.params["axis"])
    flip = np.flip(np.arange(int(np.prod(out.shape))).reshape(out.shape), axis)
    backward = equation.params["reverse"]
    x = b.take(operands[0], flip) if backward else operands[0]
    made = b.add(f"cumulative {equation.primitive.name[3:]}", (x,), out.shape, out.dtype, axis=axis)
    return b.take(made, flip) if backward else made


@rule("dot_general")
def _dot(b: Builder, operands: list[int], equation: JaxprEqn) -> int:
    out = out_of(equation)
    (left, right), (left_batch, right_batch) = equation.params["dimension_numbers"]
    letters = iter(string.ascii_lowercase)
    first = {axis: next(letters) for axis in range(len(b.operations[operands[0]].shape))}
    shared = {int(j): first[i] for i, j in zip((*left, *left_batch), (*right, *right_batch), strict=True)}
    second = {
        axis: shared[axis] if axis in shared else next(letters) for axis in range(len(b.operations[operands[1]].shape))
    }
    batch = [first[i] for i in left_batch]
    free = [first[i] for i in first if i not in (*left, *left_batch)]
    free += [second[j] for j in second if j not in (*right, *right_batch)]
    spec = f"{''.join(first.values())},{''.join(second.values())}->{''.join([*batch, *free])}"
    return b.add("einsum", tuple(operands), out.shape, out.dtype, spec=spec)
