"""Initial policies of local units, laid out over the range of the inputs or drawn from it."""

import math
from collections.abc import Callable
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check, choice
from motorgrad.policies._binary import BinaryUnits
from motorgrad.policies._box import SoftBoxes
from motorgrad.policies._gaussian import LocalGaussians
from motorgrad.policies._graded_pool import GradedPool
from motorgrad.policies._masked import Masked
from motorgrad.policies._sizes import sizes
from motorgrad.policies._sphere import SoftSpheres


def gaussians(
    task: Any, units: int | None = None, width: float = 0.5, p_max: float = 1.0, low: float = -1.0, high: float = 1.0
) -> Callable[[jax.Array], LocalGaussians]:
    """Local Gaussian units of one `width` whose centres are drawn from U[`low`, `high`] in every input."""
    inputs, outputs = sizes(task, units)
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
    inputs, outputs = sizes(task, units)
    check(isinstance(copies, int) and 1 <= copies <= outputs, "copies", copies, f"from 1 to the {outputs} units")
    check(0 < width < math.inf, "width", width, "positive")
    check(0 < p_max <= 1, "p_max", p_max, "in (0, 1]")
    ends = ends_of(task, inputs, low, high)
    limits = (least_log_width, most_log_width)
    check(limits[0] < limits[1], "least_log_width, most_log_width", limits, "an interval")
    spread = ends[:, 1] - ends[:, 0]
    places = ends[:, 0] + spread * lattice(-(-outputs // copies), inputs)
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


def soft_spheres(
    task: Any,
    units: int | None = None,
    radius: float = 0.5,
    hardness: float = 10.0,
    low: float = -1.0,
    high: float = 1.0,
) -> Callable[[jax.Array], SoftSpheres]:
    """Soft spheres of one `radius` and `hardness` whose centres are drawn from U[`low`, `high`] in every input."""
    inputs, outputs = sizes(task, units)
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
    inputs, outputs = sizes(task, units)
    _check_local({"width": width, "hardness": hardness}, low, high)

    def initial(key: jax.Array) -> SoftBoxes:
        centre = jax.random.uniform(key, (outputs, inputs), minval=low, maxval=high)
        wall = jnp.full(outputs, math.log(hardness), centre.dtype)
        return SoftBoxes(centre, jnp.full_like(centre, math.log(width)), wall)

    return initial


def growing(
    task: Any,
    units: int | None = None,
    shape: Literal["gaussians", "soft-spheres", "soft-boxes"] = "gaussians",
    p_max: float = 0.5,
    hardness: float = 10.0,
) -> Masked:
    """A pool of local units of which none is there yet, for a learner that grows (`motorgrad.learning.Growth`), which
    places them; `p_max` is that of Gaussians, `hardness` that of the other kinds."""
    inputs, outputs = sizes(task, units)
    check(0 < p_max <= 1, "p_max", p_max, "in (0, 1]")
    check(0 < hardness < math.inf, "hardness", hardness, "positive")
    kinds: dict[str, Callable[[], BinaryUnits]] = {
        "gaussians": lambda: LocalGaussians(centre, jnp.zeros_like(centre), p_max=jnp.asarray(p_max)),
        "soft-spheres": lambda: SoftSpheres(centre, jnp.zeros(outputs), wall),
        "soft-boxes": lambda: SoftBoxes(centre, jnp.zeros_like(centre), wall),
    }
    choice("shape", shape, kinds)
    centre, wall = jnp.zeros((outputs, inputs)), jnp.full(outputs, math.log(hardness))
    return Masked(kinds[shape](), jnp.zeros(outputs, bool))


def lattice(places: int, inputs: int) -> np.ndarray:
    """So many points spread evenly over the unit cube, in the middle of cells: `(places, inputs)`."""
    if inputs == 1:
        return (np.arange(places)[:, None] + 0.5) / places
    rows = max(1, round(places ** (1 / inputs)))
    parts = [len(part) for part in np.array_split(np.arange(places), rows)]
    layers = [np.insert(lattice(part, inputs - 1), 0, (n + 0.5) / rows, axis=1) for n, part in enumerate(parts)]
    return np.concatenate(layers)


def ends_of(task: Any, inputs: int, low: float | None = None, high: float | None = None) -> np.ndarray:
    """The range of each input, `(inputs, 2)`: the task's, or from 0 to 1, or what is given."""
    spans = getattr(task, "observation_range", None) or [(0.0, 1.0)] * inputs
    ends = np.array([(a if low is None else low, b if high is None else high) for a, b in spans])
    check((ends[:, 0] < ends[:, 1]).all(), "low, high", (low, high), "an interval, low < high, in every input")
    return ends


def _check_local(sizes: dict[str, float], low: float, high: float) -> None:
    for name, value in sizes.items():
        check(0 < value < math.inf, name, value, "positive")
    check(low < high, "low, high", (low, high), "an interval, low < high")
