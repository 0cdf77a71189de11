"""Steps with an estimate of their error: explicit Runge–Kutta and Rosenbrock methods."""

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, PyTree

from motorgrad._linear_algebra import linear_solve

if TYPE_CHECKING:
    import diffrax  # loading it takes longer than all of TimLab

Evaluate = Callable[[PyTree[Array], Array], tuple[PyTree[Array], Array]]
"""Of a state and the seconds since the tick: the state's slope, and the levels of the zero crossings."""
Attempted = tuple[PyTree[Array], PyTree[Array], PyTree[Array], Array]
"""A new state, its estimated error, the slope there, and the levels there."""


class Method(NamedTuple):
    """A method with steps of any length.

    `attempt(evaluate, state, within, step, first, rolled)` returns the state one `step` after `within`, its estimated
    error, and the slope and the levels there; `first` is the slope at `within`. The error is of the given `order` in
    the step. With `rolled`, the stages are a loop: that is slower, but what is compiled is smaller.
    """

    order: int
    stiff: bool
    attempt: Callable[[Evaluate, PyTree[Array], Array, Array, PyTree[Array], bool], Attempted]


def explicit(tableau: "diffrax.ButcherTableau", order: int) -> Method:
    """The explicit Runge–Kutta method of one of diffrax's tableaus, whose last stage is the new state's slope."""
    stages = list(zip(tableau.c.tolist(), map(tuple, tableau.a_lower), strict=True))
    errors = tuple(np.asarray(tableau.b_error, float))

    def attempt(
        evaluate: Evaluate, state: PyTree[Array], within: Array, step: Array, first: PyTree[Array], rolled: bool
    ) -> Attempted:
        def stage(
            slopes: PyTree[Array], place: Array | float, weights: Array | Sequence[float]
        ) -> tuple[PyTree[Array], tuple[PyTree[Array], PyTree[Array], Array]]:
            there = jax.tree.map(lambda x, k: x + step * k, state, _weighted(weights, slopes))
            slope, levels = evaluate(there, within + place * step)
            return slope, (there, slope, levels)

        slopes, (there, slope, levels) = _one_by_one(stage, stages, [first], first, rolled)
        return there, jax.tree.map(lambda k: step * k, _weighted(errors, slopes)), slope, levels

    return Method(order, False, attempt)


def _one_by_one(
    stage: Callable[..., tuple[Any, Any]],
    table: Sequence[tuple[Any, ...]],
    known: list[PyTree[Array]],
    like: PyTree[Array],
    rolled: bool,
) -> tuple[Any, Any]:
    """The results of all stages, and what else the last one returns.

    **Arguments:** `stage`: of the results before it, to be used by `_weighted`, and of its row of the `table`. `known`:
    results before the first stage. `like`: a tree as each result is. `rolled`: whether to loop, so that the stages
    appear only once in what is compiled.
    """
    if not rolled:
        last = None
        for row in table:
            result, last = stage(known, *row)
            known = [*known, result]
        return known, last
    count = len(known) + len(table)
    real = jnp.result_type(float)

    def column(cells: tuple[Any, ...]) -> Array:
        padded = [[*cell, *[0.0] * (count - len(cell))] if isinstance(cell, tuple) else cell for cell in cells]
        return jnp.asarray(np.array(padded, float), real)

    def next_stage(results: PyTree[Array], at: tuple[Array | np.ndarray, ...]) -> tuple[PyTree[Array], PyTree[Array]]:
        n, *row = at
        result, other = stage(results, *row)
        return jax.tree.map(lambda all, new: all.at[n].set(new), results, result), other

    results = jax.tree.map(lambda x: jnp.zeros((count, *x.shape), x.dtype), like)
    for n, result in enumerate(known):
        results = jax.tree.map(lambda all, new, n=n: all.at[n].set(new), results, result)
    rows = (np.arange(len(known), count), *map(column, zip(*table, strict=True)))
    results, others = jax.lax.scan(next_stage, results, rows)
    return results, jax.tree.map(lambda each: each[-1], others)


def _weighted(weights: Array | Sequence[float], results: PyTree[Array] | list[PyTree[Array]]) -> PyTree[Array]:
    """The weighted sum of results: of a list of them, or stacked."""
    if not isinstance(results, list):
        dense = jnp.asarray(weights, jnp.result_type(float))
        return jax.tree.map(lambda k: jnp.tensordot(dense, k, 1), results)
    used = [(float(weight), result) for weight, result in zip(weights, results, strict=True) if weight]
    return jax.tree.map(
        lambda *ks: sum(weight * k for (weight, _), k in zip(used, ks, strict=True)), *(k for _, k in used)
    )


GAMMA = 0.21193756319429014
STAGES = (
    (0.0, GAMMA, (), ()),
    (0.6358126895828704, -0.42387512638858027, (3.0,), (-14.155112264123755,)),
    (
        *(0.4095798393397535, -0.3384627126235924),
        (2.849394379747939, 0.45842242204463923),
        (-17.97296035885952, -2.859693295451294),
    ),
    (
        *(0.9769306725060716, 1.8046452872882734),
        (-6.954028509809101, 2.489845061869568, -10.358996098473584),
        (147.12150275711716, -1.41221402718213, 71.68940251302358),
    ),
    (
        *(0.4288403609558664, 2.325825639765069),
        (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
        (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
    ),
    (
        *(1.0, 0.0),
        (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946),
        (24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471),
    ),
    (
        *(1.0, 0.0),
        (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, 1.0),
        (
            *(30.91273214028599, -3.1208243349937974, 77.79954646070892),
            *(34.28646028294783, -19.097331116725623, -28.087943162872662),
        ),
    ),
    (
        *(1.0, 0.0),
        (
            *(-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256),
            *(0.030198172008377946, 1.0, 1.0),
        ),
        (
            *(37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047),
            *(-40.06618937091002, -54.66780262877968, -9.48861652309627),
        ),
    ),
)
"""Of Rodas5P (Steinebach, 2023): the place in the step, the weight of the slope in time, and the weights of the earlier
stages in the state and in the right-hand side. The new state adds the last stage once more; it is the error."""
UNROLLED = 16  # larger matrices are inverted by LAPACK


def _rodas5p(
    evaluate: Evaluate, state: PyTree[Array], within: Array, step: Array, first: PyTree[Array], rolled: bool
) -> Attempted:
    x, unravel = ravel_pytree(state)

    def slope(x: Array, within: Array) -> Array:
        return ravel_pytree(evaluate(unravel(x), within)[0])[0]

    within = jnp.asarray(within, x.dtype)
    jacobian, rate = jax.jacfwd(slope, (0, 1))(x, within)
    inverse = inverted(jnp.eye(len(x), dtype=x.dtype) / (GAMMA * step) - jacobian)

    def stage(
        changes: PyTree[Array],
        place: Array | float,
        weight: Array | float,
        inside: Array | Sequence[float],
        outside: Array | Sequence[float],
    ) -> tuple[Array, tuple[Array, Array]]:
        there = x
        right = step * weight * rate
        if len(changes):
            there = x + _weighted(inside, changes)
            right = right + _weighted(outside, changes) / step
        change = jnp.sum(inverse * (slope(there, within + place * step) + right), axis=-1)
        return change, (there, change)

    _, (there, change) = _one_by_one(stage, STAGES, [], x, rolled)
    new = unravel(there + change)
    return new, unravel(change), *evaluate(new, within + step)


def inverted(matrix: Array) -> Array:
    """The inverse, for small matrices by Gauss–Jordan elimination with partial pivoting: unlike a call of LAPACK, it
    does not break up the compiled loop, and many seeds are eliminated together.
    """
    size = len(matrix)
    if size > UNROLLED:
        return linear_solve(matrix, jnp.eye(size, dtype=matrix.dtype))
    rows = jnp.concatenate([matrix, jnp.eye(size, dtype=matrix.dtype)], axis=1)
    numbers = np.arange(size)
    for column in range(size):
        sizes = jnp.where(numbers >= column, jnp.abs(rows[:, column]), -1.0)
        pivot = jnp.argmax(sizes)
        chosen = jnp.sum(jnp.where((numbers == pivot)[:, None], rows, 0.0), axis=0)
        moved = jnp.where((numbers == pivot)[:, None], rows[column], rows)
        chosen = chosen / chosen[column]
        below = moved - moved[:, column, None] * chosen
        rows = jnp.where((numbers == column)[:, None], chosen, below)
    return rows[:, size:]


@functools.cache
def method_named(solver: str) -> Method:
    """The method of a solver. diffrax has no Rosenbrock method: its implicit ones iterate, and a call with many seeds
    waits for the slowest iteration."""
    if solver == "rodas5p":
        return Method(5, True, _rodas5p)
    import diffrax

    tableau, order = {"tsit5": (diffrax.Tsit5.tableau, 5), "dopri8": (diffrax.Dopri8.tableau, 8)}[solver]
    return explicit(tableau, order)
