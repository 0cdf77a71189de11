"""Pools of motoneurons as the thesis draws them: how many units fire at each input, and how surely."""

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from motorgrad.experiments.chapter_4._pools import firing
from motorgrad.policies import Motoneurons

if TYPE_CHECKING:
    from matplotlib.axes import Axes

THRESHOLD, EXPECTED, IDEAL = "#c0392b", "black", "#1b6b3a"
NEVER, ALWAYS = "#ffffff", "#5a9bd4"  # light enough for lines of any colour to be seen on it


def fires_at(
    thresholds: npt.ArrayLike, gains: npt.ArrayLike, inputs: npt.ArrayLike
) -> Float[np.ndarray, "inputs units"]:
    """The probability that each unit of one pool fires at each input."""
    pool = Motoneurons(jnp.asarray(thresholds, jnp.float32), jnp.asarray(gains, jnp.float32))
    return firing(jax.tree.map(lambda leaf: leaf[None], pool), inputs)[0].astype(float)


def count_chances(fires: npt.ArrayLike) -> Float[np.ndarray, "... counts"]:
    """The probabilities that 0, 1 … N of N independent units fire (Poisson's binomial distribution), exactly.

    **Arguments:** `fires` (..., units), the probability that each does. **Returns:** (..., units + 1).
    """
    each = np.asarray(fires, float)
    chances = np.ones((*each.shape[:-1], 1))
    for p in np.moveaxis(each, -1, 0):
        p = p[..., None]
        silent, active = chances * (1 - p), chances * p
        nothing = np.zeros_like(p)
        chances = np.concatenate([silent, nothing], -1) + np.concatenate([nothing, active], -1)
    return chances


def draw_pool(axes: "Axes", thresholds: npt.ArrayLike, gains: npt.ArrayLike, inputs: np.ndarray) -> Any:
    """A pool over evenly spaced inputs: the colour is the probability of each number of active units, the black curve
    the expected number, and red lines the thresholds (dashed where a unit's gain is negative).

    **Returns:** the coloured mesh, for a colour bar.
    """
    from matplotlib.colors import LinearSegmentedColormap

    fires = fires_at(thresholds, gains, inputs)
    chances = count_chances(fires)
    units = chances.shape[1] - 1
    shades = LinearSegmentedColormap.from_list("chance", [NEVER, ALWAYS])
    mesh = axes.pcolormesh(inputs, np.arange(units + 1), chances.T, cmap=shades, vmin=0, vmax=1, shading="nearest")
    mesh.set_rasterized(True)
    for threshold, gain in zip(np.asarray(thresholds), np.asarray(gains), strict=True):
        axes.axvline(threshold, color=THRESHOLD, linewidth=1.1, linestyle="-" if gain > 0 else "--")
    axes.plot(inputs, fires.sum(1), color=EXPECTED, linewidth=1.8)
    axes.set(xlim=(inputs[0], inputs[-1]), ylim=(-0.5, units + 0.5), yticks=range(units + 1))
    return mesh


def draw_thresholds(
    axes: "Axes", thresholds: np.ndarray, gains: np.ndarray, reach: tuple[float, float], order: np.ndarray
) -> None:
    """The thresholds of every seed's pool `(seeds, units)`, a row each, the first of `order` at the top.

    A cross is a unit of negative gain; what lies outside of `reach` is an arrow head at the border.
    """
    places, positive = thresholds[order], gains[order] > 0
    row = np.broadcast_to(np.arange(len(order))[:, None], places.shape)
    left, right = places < reach[0], places > reach[1]
    for chosen, mark in ((left, "<"), (right, ">"), (~left & ~right, None)):
        for these, usual, colour in ((chosen & positive, "o", THRESHOLD), (chosen & ~positive, "x", "black")):
            if not these.any():
                continue
            look: dict[str, Any] = {"color": colour, "markersize": 3.2, "clip_on": False, "zorder": 3}
            axes.plot(np.clip(places[these], *reach), row[these], mark or usual, **look)
    axes.set(xlim=reach, ylim=(len(order) - 0.4, -0.6), yticks=[])
