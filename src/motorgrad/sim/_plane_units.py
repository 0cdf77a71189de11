"""Where local units are in the plane, how wide they are, and what colour their force has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float

from motorgrad._errors import check

if TYPE_CHECKING:
    from motorgrad.policies import Policy

# Anticlockwise from the right. Colour-blind people can tell right, up, left and down apart; arrows say the rest.
WHEEL = ("#A0307A", "#A03024", "#B07500", "#5E8F1F", "#0061B0", "#1D3E63", "#2B2E34", "#5E2350")
ROUND = np.linspace(0, 2 * np.pi, 49)
ELLIPSE = np.stack([np.cos(ROUND), np.sin(ROUND)], axis=1)
RECTANGLE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)], float)


@dataclass(frozen=True)
class Shapes:
    """Units in the plane.

    `centre` and `half`: their centres and half their extents; `square`: rectangles and not ellipses; `there`: not
    switched off; `surely`: with which probability each fires at its centre.
    """

    centre: Float[np.ndarray, "units 2"]
    half: Float[np.ndarray, "units 2"]
    square: Bool[np.ndarray, " units"]
    there: Bool[np.ndarray, " units"]
    surely: Float[np.ndarray, " units"]

    def outlines(self, which: Bool[np.ndarray, " units"]) -> list[np.ndarray]:
        """The outline of each of these units, closed."""
        rows = zip(self.centre[which], self.half[which], self.square[which], strict=True)
        return [centre + half * (RECTANGLE if square else ELLIPSE) for centre, half, square in rows]


def shapes_of(policy: Policy) -> Shapes:
    """Where the units of a policy are. **Raises** `ValueError` for units without a centre in the plane."""
    import jax
    import jax.numpy as jnp

    regions = policy.regions()
    local = regions is not None and regions.centre.shape[-1] >= 2
    wanted = "made of local units, which have a centre in the plane and a width"
    check(local, "policy", type(policy).__name__, wanted)
    assert regions is not None
    surely = np.diagonal(np.asarray(jax.vmap(policy.prob)(jnp.asarray(regions.centre))))
    centre, half = regions.centre[:, :2], regions.half[:, :2]
    return Shapes(centre, half, regions.box, regions.active, np.nan_to_num(np.clip(surely, 0, 1)))


def direction_colours(forces: Float[np.ndarray, "units 2"]) -> Float[np.ndarray, "units 4"]:
    """A colour for the direction of each force, on a wheel; grey for none."""
    from matplotlib.colors import LinearSegmentedColormap, to_rgba

    wheel = LinearSegmentedColormap.from_list("directions", [*WHEEL, WHEEL[0]], N=360)
    turn = np.arctan2(forces[:, 1], forces[:, 0]) / (2 * np.pi) % 1
    colours = wheel(turn)
    colours[~np.any(forces != 0, axis=1)] = to_rgba("0.45")
    return colours
