"""Initial policies of units that respond everywhere: hyperplanes, softmax, motoneurons."""

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from motorgrad._errors import check
from motorgrad.policies._graded import GradedMotoneurons
from motorgrad.policies._graded_hyperplane import GradedHyperplanes
from motorgrad.policies._hyperplane import Hyperplanes
from motorgrad.policies._motoneuron import Motoneurons
from motorgrad.policies._querying import Querying
from motorgrad.policies._sizes import sizes
from motorgrad.policies._softmax import Softmax


def hyperplanes(task: Any, units: int | None = None) -> Hyperplanes:
    """Hyperplane units with zero weights: every unit fires with probability one half, the policy of most entropy.

    **Arguments:** `task`, a task or the number of inputs; `units`, by default the task's number of binary actions.
    """
    inputs, outputs = sizes(task, units)
    return Hyperplanes(jnp.zeros((outputs, inputs)), jnp.zeros(outputs))


def softmax(task: Any, units: int | None = None) -> Softmax:
    """A softmax policy with zero weights: every action is as likely."""
    inputs, outputs = sizes(task, units)
    return Softmax(jnp.zeros((outputs, inputs)))


def motoneurons(
    task: Any, units: int | None = None, low: float = 0.0, high: float = 1.0
) -> Callable[[jax.Array], Motoneurons]:
    """Motoneurons of gain 0 whose thresholds are drawn from U[`low`, `high`] (section 4.3.1 of the thesis)."""
    outputs = _motor_units("motoneurons", task, units, low, high)

    def initial(key: jax.Array) -> Motoneurons:
        return Motoneurons(jax.random.uniform(key, (outputs,), minval=low, maxval=high), jnp.zeros(outputs))

    return initial


def graded_motoneurons(
    task: Any,
    units: int | None = None,
    low: float = 0.0,
    high: float = 1.0,
    deviation: float = 0.3,
    floor: float = 0.02,
) -> Callable[[jax.Array], GradedMotoneurons]:
    """Graded motoneurons of gain 0, mean activation one half, whose thresholds are drawn from U[`low`, `high`].

    Their noise has the standard deviation `deviation`, which is learnt but stays above `floor`.
    """
    outputs = _motor_units("graded-motoneurons", task, units, low, high)
    noise = _log_deviation(outputs, deviation, floor)

    def initial(key: jax.Array) -> GradedMotoneurons:
        threshold = jax.random.uniform(key, (outputs,), minval=low, maxval=high)
        return GradedMotoneurons(threshold, jnp.zeros(outputs), noise, jnp.asarray(floor, noise.dtype))

    return initial


def graded_hyperplanes(
    task: Any, units: int | None = None, level: float = 0.0, deviation: float = 0.3, floor: float = 0.02
) -> GradedHyperplanes:
    """Graded units whose mean is `level` whatever they see: zero slopes.

    Their noise has the standard deviation `deviation`, which is learnt but stays above `floor`.
    """
    inputs, outputs = sizes(task, units)
    check(math.isfinite(level), "level", level, "a finite number")
    noise = _log_deviation(outputs, deviation, floor)
    least = jnp.asarray(floor, noise.dtype)
    return GradedHyperplanes(jnp.zeros((outputs, inputs)), jnp.full(outputs, float(level)), noise, least)


def querying_motoneurons(
    task: Any, units: int | None = None, low: float = 0.0, high: float = 1.0, explore: float = 0.1, cells: int = 32
) -> Callable[[jax.Array], Querying]:
    """Motoneurons as `motoneurons` makes them, one fewer than there are actions: the last is the next input.

    They ask for inputs from `low` to `high` in proportion to their entropy in each of `cells`, a share `explore`
    uniformly.
    """
    outputs = _motor_units("querying-motoneurons", task, units, low, high)
    check(outputs > 1, "outputs", outputs, "at least 2: the last is the input that is asked for")
    pool = motoneurons(1, outputs - 1, low, high)

    def initial(key: jax.Array) -> Querying:
        start, end, share = (jnp.asarray(value, jnp.result_type(float)) for value in (low, high, explore))
        return Querying(pool(key), start, end, share, cells)

    initial(jax.random.key(0))  # refuses at once what is impossible
    return initial


def _log_deviation(units: int, deviation: float, floor: float) -> jax.Array:
    """The parameter of units whose noise has this standard deviation."""
    check(0 < floor < deviation < math.inf, "floor, deviation", (floor, deviation), "positive, floor < deviation")
    return jnp.full(units, math.log(deviation - floor))


def _motor_units(name: str, task: Any, units: int | None, low: float, high: float) -> int:
    """How many units; refused where there is another number of inputs than 1."""
    inputs, outputs = sizes(task, units)
    if inputs != 1 and not isinstance(task, int):
        named = f"task {getattr(task, 'name', type(task).__name__)!r} has {inputs} observed numbers"
        raise ValueError(f"policy = {name!r}: {named}, a motoneuron has a single input")
    check(inputs == 1, "inputs", inputs, "1: a motoneuron has a single input")
    check(low < high, "low, high", (low, high), "an interval, low < high")
    return outputs
