"""Initial policies for a task: the usual starting points by name.

Each takes a task (anything with `observation_size` and `action_size`) or the sizes themselves. Where the start is
random the result is a function of a key, so that every seed starts differently.
"""

import math
from collections.abc import Callable
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check, choice, unknown
from motorgrad.policies._binary import BinaryUnits
from motorgrad.policies._box import SoftBoxes
from motorgrad.policies._factored import Factored
from motorgrad.policies._gated import Gated
from motorgrad.policies._gaussian import LocalGaussians
from motorgrad.policies._graded import GradedMotoneurons
from motorgrad.policies._graded_pool import GradedPool
from motorgrad.policies._hyperplane import Hyperplanes
from motorgrad.policies._masked import Masked
from motorgrad.policies._motoneuron import Motoneurons
from motorgrad.policies._policy import Policy
from motorgrad.policies._querying import Querying
from motorgrad.policies._softmax import Softmax
from motorgrad.policies._sphere import SoftSpheres

Initial = Policy | Callable[[jax.Array], Policy]
"""A policy, or a function that makes one from a seed's key."""


def _sizes(task: Any, outputs: int | None) -> tuple[int, int]:
    sized = isinstance(task, int) or all(hasattr(task, name) for name in ("observation_size", "action_size"))
    check(sized and not isinstance(task, type), "task", task, "a task, such as motorgrad.make('hopper'), or a number")
    inputs = task if isinstance(task, int) else task.observation_size
    outputs = (None if isinstance(task, int) else task.action_size) if outputs is None else outputs
    check(inputs > 0, "inputs", inputs, "a positive number of inputs")
    check(outputs is not None and outputs > 0, "outputs", outputs, "a positive number of units or actions")
    return inputs, int(outputs or 0)


def hyperplanes(task: Any, units: int | None = None) -> Hyperplanes:
    """Hyperplane units with zero weights: every unit fires with probability one half, the policy of most entropy.

    **Arguments:** `task`, a task or the number of inputs; `units`, by default the task's number of binary actions.
    """
    inputs, outputs = _sizes(task, units)
    return Hyperplanes(jnp.zeros((outputs, inputs)), jnp.zeros(outputs))


def softmax(task: Any, units: int | None = None) -> Softmax:
    """A softmax policy with zero weights: every action is as likely."""
    inputs, outputs = _sizes(task, units)
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
    check(0 < floor < deviation < math.inf, "floor, deviation", (floor, deviation), "positive, floor < deviation")

    def initial(key: jax.Array) -> GradedMotoneurons:
        threshold = jax.random.uniform(key, (outputs,), minval=low, maxval=high)
        noise = jnp.full(outputs, math.log(deviation - floor), threshold.dtype)
        return GradedMotoneurons(threshold, jnp.zeros(outputs), noise, jnp.asarray(floor, noise.dtype))

    return initial


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


def _motor_units(name: str, task: Any, units: int | None, low: float, high: float) -> int:
    """How many units; refused where there is another number of inputs than 1."""
    inputs, outputs = _sizes(task, units)
    if inputs != 1 and not isinstance(task, int):
        named = f"task {getattr(task, 'name', type(task).__name__)!r} has {inputs} observed numbers"
        raise ValueError(f"policy = {name!r}: {named}, a motoneuron has a single input")
    check(inputs == 1, "inputs", inputs, "1: a motoneuron has a single input")
    check(low < high, "low, high", (low, high), "an interval, low < high")
    return outputs


def gaussians(
    task: Any, units: int | None = None, width: float = 0.5, p_max: float = 1.0, low: float = -1.0, high: float = 1.0
) -> Callable[[jax.Array], LocalGaussians]:
    """Local Gaussian units of one `width` whose centres are drawn from U[`low`, `high`] in every input."""
    inputs, outputs = _sizes(task, units)
    _check_local({"width": width}, low, high)
    check(0 < p_max <= 1, "p_max", p_max, "in (0, 1]")

    def initial(key: jax.Array) -> LocalGaussians:
        centre = jax.random.uniform(key, (outputs, inputs), minval=low, maxval=high)
        return LocalGaussians(centre, jnp.full_like(centre, jnp.log(width)), p_max=jnp.asarray(p_max))

    return initial


def tiles(
    task: Any,
    units: int | None = None,
    copies: int = 1,
    width: float = 0.16,
    p_max: float = 1.0,
    low: float | None = None,
    high: float | None = None,
    least_log_width: float = -4.0,
    most_log_width: float = 2.0,
) -> LocalGaussians:
    """Local Gaussian units laid out evenly over the range of the inputs (section 6.3 of the thesis).

    The range is that of the task (`observation_range`), from 0 to 1 where it has none, or from `low` to `high` in every
    input. Places are laid in rows, as many rows as there are places in a row, or nearly so; `copies` units that follow
    each other share a place, such as a push to the left and one to the right. `width` is a standard deviation as part
    of the range. Learning keeps the logarithms of the widths within the two limits.
    """
    inputs, outputs = _sizes(task, units)
    check(isinstance(copies, int) and 1 <= copies <= outputs, "copies", copies, f"from 1 to the {outputs} units")
    check(0 < width < math.inf, "width", width, "positive")
    check(0 < p_max <= 1, "p_max", p_max, "in (0, 1]")
    ends = _ends(task, inputs, low, high)
    limits = (least_log_width, most_log_width)
    check(limits[0] < limits[1], "least_log_width, most_log_width", limits, "an interval")
    spread = ends[:, 1] - ends[:, 0]
    places = ends[:, 0] + spread * _lattice(-(-outputs // copies), inputs)
    log_width = np.clip(np.log(width * spread), *limits)
    centre = jnp.asarray(np.repeat(places, copies, axis=0)[:outputs], jnp.result_type(float))
    wide = jnp.broadcast_to(jnp.asarray(log_width, centre.dtype), centre.shape)
    return LocalGaussians(centre, wide, p_max=jnp.asarray(p_max), log_width_limits=limits)


def graded_tiles(
    task: Any,
    units: int | None = None,
    copies: int = 1,
    width: float = 0.16,
    p_max: float = 1.0,
    strength: float = 0.0,
    deviation: float = 0.5,
    floor: float = 0.05,
) -> GradedPool:
    """Units as `tiles` lays them out, each of which acts with a learnt `strength` when it fires: positive with its
    force, negative against it.

    The strength is drawn with a standard deviation, which is learnt too, from `deviation`, but stays above `floor`.
    """
    check(-math.inf < strength < math.inf, "strength", strength, "a finite number")
    check(0 < floor < deviation < math.inf, "floor, deviation", (floor, deviation), "positive, floor < deviation")
    pool = tiles(task, units, copies, width, p_max)
    spread = jnp.full(pool.outputs, math.log(deviation - floor), pool.centre.dtype)
    return GradedPool(pool, jnp.full_like(spread, strength), spread, jnp.asarray(floor, spread.dtype))


def mixture(
    task: Any,
    units: int | None = None,
    hyperplanes: int = 2,
    copies: int = 1,
    width: float = 0.16,
    p_max: float = 1.0,
    bias: float = 0.0,
) -> Factored:
    """Local units as `tiles` lays them out, and beside them `hyperplanes` global ones, the last of the actions, with
    zero weights and one `bias` (section 6.5.2 of the thesis)."""
    inputs, outputs = _sizes(task, units)
    valid = isinstance(hyperplanes, int) and 1 <= hyperplanes < outputs
    check(valid, "hyperplanes", hyperplanes, f"from 1 to {outputs - 1}, fewer than the {outputs} units")
    check(-math.inf < bias < math.inf, "bias", bias, "a finite number")
    everywhere = Hyperplanes(jnp.zeros((hyperplanes, inputs)), jnp.full(hyperplanes, bias))
    return Factored([tiles(task, outputs - hyperplanes, copies, width, p_max), everywhere])


def _lattice(places: int, inputs: int) -> np.ndarray:
    """So many points spread evenly over the unit cube, in the middle of cells: `(places, inputs)`."""
    if inputs == 1:
        return (np.arange(places)[:, None] + 0.5) / places
    rows = max(1, round(places ** (1 / inputs)))
    parts = [len(part) for part in np.array_split(np.arange(places), rows)]
    layers = [np.insert(_lattice(part, inputs - 1), 0, (n + 0.5) / rows, axis=1) for n, part in enumerate(parts)]
    return np.concatenate(layers)


def soft_spheres(
    task: Any,
    units: int | None = None,
    radius: float = 0.5,
    hardness: float = 10.0,
    low: float = -1.0,
    high: float = 1.0,
) -> Callable[[jax.Array], SoftSpheres]:
    """Soft spheres of one `radius` and `hardness` whose centres are drawn from U[`low`, `high`] in every input."""
    inputs, outputs = _sizes(task, units)
    _check_local({"radius": radius, "hardness": hardness}, low, high)

    def initial(key: jax.Array) -> SoftSpheres:
        centre = jax.random.uniform(key, (outputs, inputs), minval=low, maxval=high)
        size, wall = (jnp.full(outputs, math.log(value), centre.dtype) for value in (radius, hardness))
        return SoftSpheres(centre, size, wall)

    return initial


def soft_boxes(
    task: Any,
    units: int | None = None,
    width: float = 0.5,
    hardness: float = 10.0,
    low: float = -1.0,
    high: float = 1.0,
) -> Callable[[jax.Array], SoftBoxes]:
    """Soft boxes `width` wide from the centre to each wall, of one `hardness`, whose centres are drawn from U[`low`,
    `high`] in every input."""
    inputs, outputs = _sizes(task, units)
    _check_local({"width": width, "hardness": hardness}, low, high)

    def initial(key: jax.Array) -> SoftBoxes:
        centre = jax.random.uniform(key, (outputs, inputs), minval=low, maxval=high)
        wall = jnp.full(outputs, math.log(hardness), centre.dtype)
        return SoftBoxes(centre, jnp.full_like(centre, math.log(width)), wall)

    return initial


def growing(
    task: Any,
    units: int | None = None,
    kind: Literal["gaussians", "soft-spheres", "soft-boxes"] = "gaussians",
    p_max: float = 0.5,
    hardness: float = 10.0,
) -> Masked:
    """A pool of local units of which none is there yet, for a learner that grows (`motorgrad.learning.Growth`), which
    places them; `p_max` is that of Gaussians, `hardness` that of the other kinds."""
    inputs, outputs = _sizes(task, units)
    check(0 < p_max <= 1, "p_max", p_max, "in (0, 1]")
    check(0 < hardness < math.inf, "hardness", hardness, "positive")
    kinds: dict[str, Callable[[], BinaryUnits]] = {
        "gaussians": lambda: LocalGaussians(centre, jnp.zeros_like(centre), p_max=jnp.asarray(p_max)),
        "soft-spheres": lambda: SoftSpheres(centre, jnp.zeros(outputs), wall),
        "soft-boxes": lambda: SoftBoxes(centre, jnp.zeros_like(centre), wall),
    }
    choice("kind", kind, kinds)
    centre, wall = jnp.zeros((outputs, inputs)), jnp.full(outputs, math.log(hardness))
    return Masked(kinds[kind](), jnp.zeros(outputs, bool))


def gated(
    task: Any,
    units: int | None = None,
    gates: int = 1,
    levels: int = 1,
    width: float = 0.3,
    p_max: float = 1.0,
) -> Gated:
    """Local Gaussian gates over the range of the inputs, and hyperplane units behind each (thesis, section 6.5.4).

    The units begin with zero weights. The gates lie as the places of `tiles` do. With more than one of `levels` there
    are further gates behind each, laid out alike from one of its widths below its centre to one above; the units are
    behind the last. `units` counts gates too: behind each gate are as many of the rest as behind another, or one fewer.
    An action is ordered as in `Gated`: the gates, then all that is behind the first, and so on. `width` is a standard
    deviation as part of the range.
    """
    inputs, outputs = _sizes(task, units)
    for name, value in (("gates", gates), ("levels", levels)):
        check(isinstance(value, int) and value >= 1, name, value, "a whole number of at least 1")
    check(0 < width < math.inf, "width", width, "positive")
    check(0 < p_max <= 1, "p_max", p_max, "in (0, 1]")
    ends = _ends(task, inputs)
    places = _lattice(gates, inputs)

    def pool(low: np.ndarray, spread: np.ndarray, count: int, level: int) -> Gated:
        wanted = f"more than the {gates} gates of each pool: at least one unit behind every gate"
        check(count >= 2 * gates, "outputs", outputs, wanted)
        centre, wide = low + spread * places, width * spread
        shares = [len(part) for part in np.array_split(np.arange(count - gates), gates)]
        gate = LocalGaussians(centre, np.log(np.broadcast_to(wide, centre.shape)), p_max=jnp.asarray(p_max))
        below = zip(centre, shares, strict=True)
        if level == 1:
            return Gated(gate, [hyperplanes(inputs, share) for _, share in below])
        return Gated(gate, [pool(middle - wide, 2 * wide, share, level - 1) for middle, share in below])

    return pool(ends[:, 0], ends[:, 1] - ends[:, 0], outputs, levels)


def _ends(task: Any, inputs: int, low: float | None = None, high: float | None = None) -> np.ndarray:
    """The range of each input, `(inputs, 2)`: the task's, or from 0 to 1, or what is given."""
    spans = getattr(task, "observation_range", None) or [(0.0, 1.0)] * inputs
    ends = np.array([(a if low is None else low, b if high is None else high) for a, b in spans])
    check((ends[:, 0] < ends[:, 1]).all(), "low, high", (low, high), "an interval, low < high, in every input")
    return ends


def _check_local(sizes: dict[str, float], low: float, high: float) -> None:
    for name, value in sizes.items():
        check(0 < value < math.inf, name, value, "positive")
    check(low < high, "low, high", (low, high), "an interval, low < high")


INITIAL: dict[str, Callable[..., Initial]] = {
    "gated": gated,
    "gaussians": gaussians,
    "graded-motoneurons": graded_motoneurons,
    "graded-tiles": graded_tiles,
    "growing": growing,
    "hyperplanes": hyperplanes,
    "mixture": mixture,
    "motoneurons": motoneurons,
    "querying-motoneurons": querying_motoneurons,
    "soft-boxes": soft_boxes,
    "soft-spheres": soft_spheres,
    "softmax": softmax,
    "tiles": tiles,
}
"""Initial policies by the name used in configurations and on the command line."""


def initial(name: str, task: Any, **settings: Any) -> Initial:
    """The initial policy called `name` for `task`; an unknown name is refused with the nearest one."""
    if name not in INITIAL:
        raise unknown("policy", name, INITIAL)
    return INITIAL[name](task, **settings)
