"""Initial policies of several pools."""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.policies._factored import Factored
from motorgrad.policies._gated import Gated
from motorgrad.policies._gaussian import LocalGaussians
from motorgrad.policies._hyperplane import Hyperplanes
from motorgrad.policies._initial_global import graded_hyperplanes, hyperplanes
from motorgrad.policies._initial_local import ends_of, lattice, tiles
from motorgrad.policies._mirrored import Mirrored
from motorgrad.policies._primitives import Primitives
from motorgrad.policies._sizes import sizes


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
    inputs, outputs = sizes(task, units)
    valid = isinstance(hyperplanes, int) and 1 <= hyperplanes < outputs
    check(valid, "hyperplanes", hyperplanes, f"from 1 to {outputs - 1}, fewer than the {outputs} units")
    check(-math.inf < bias < math.inf, "bias", bias, "a finite number")
    everywhere = Hyperplanes(jnp.zeros((hyperplanes, inputs)), jnp.full(hyperplanes, bias))
    return Factored([tiles(task, outputs - hyperplanes, copies, width, p_max), everywhere])


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
    inputs, outputs = sizes(task, units)
    for name, value in (("gates", gates), ("levels", levels)):
        check(isinstance(value, int) and value >= 1, name, value, "a whole number of at least 1")
    check(0 < width < math.inf, "width", width, "positive")
    check(0 < p_max <= 1, "p_max", p_max, "in (0, 1]")
    ends = ends_of(task, inputs)
    places = lattice(gates, inputs)

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


def mirrored(task: Any, units: int | None = None) -> Mirrored:
    """Hyperplane units with zero weights, each of which acts for both sides of a symmetric body (`Mirrored`).

    There is a unit for every two actions that are each other's mirror image, by the `mirror` of the task.

    **Raises:** `ValueError` for a task without a mirror, or with an action of the middle, and for sizes alone.
    """
    inputs, outputs = sizes(task, units)
    mirror = getattr(task, "mirror", None)
    name = repr(getattr(task, "name", type(task).__name__))
    if mirror is None:
        told = f"there is none of {task} inputs" if isinstance(task, int) else f"task {name} has none"
        raise ValueError(f"policy = 'mirrored': needs a task with a mirror of left and right, {told}")
    check(outputs == len(mirror.outputs), "units", outputs, f"{len(mirror.outputs)}, as the task's mirror has them")
    middle = [i for i, image in enumerate(mirror.outputs) if i == image]
    if middle:
        raise ValueError(f"policy = 'mirrored': actions {middle} of task {name} are their own mirror image, of no side")
    left = [i for i, image in enumerate(mirror.outputs) if i < image]
    pool = hyperplanes(inputs, len(left))
    return Mirrored(pool, mirror.inputs, mirror.signs, left, [mirror.outputs[i] for i in left])


def primitives(
    task: Any, units: int | None = None, count: int = 2, deviation: float = 0.3, floor: float = 0.02
) -> Primitives:
    """Motor primitives, `count` of them, each of which begins half of the times it can, whatever is observed.

    Their movement parameters have mean 0 and the standard deviation `deviation`, which is learnt but stays above
    `floor`. `units` is the length of an action: `count`, and as many parameters for each.
    """
    inputs, outputs = sizes(task, units)
    whole = isinstance(count, int) and not isinstance(count, bool) and count >= 1
    check(whole and outputs % count == 0 and outputs > count, "count", count, f"a divisor of {outputs}, below it")
    check(inputs > count, "inputs", inputs, f"more than the {count} flags of what can begin")
    return Primitives(
        hyperplanes(inputs - count, count), graded_hyperplanes(inputs - count, outputs - count, 0.0, deviation, floor)
    )
