"""Rewards, local units, trajectories and occupancy in the plane of a particle, drawn on matplotlib axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from jaxtyping import Array, Bool, Float

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad.policies import abilities

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from matplotlib.typing import ColorType

    from motorgrad.policies import Policy
    from motorgrad.tasks import ParticleTask, Region
    from motorgrad.worlds import Walls


# Anticlockwise from the right. Right, up, left and down can be told apart by colour-blind people; arrows show the rest.
WHEEL = ("#A0307A", "#A03024", "#B07500", "#5E8F1F", "#0061B0", "#1D3E63", "#2B2E34", "#5E2350")
ROUND = np.linspace(0, 2 * np.pi, 49)
ELLIPSE = np.stack([np.cos(ROUND), np.sin(ROUND)], axis=1)


@dataclass(frozen=True)
class Shapes:
    """Local units in the plane: their centres; the half axes of their ellipsoids or boxes, projected onto the plane, as
    columns; whether they are boxes rather than ellipsoids; whether they are switched on; and the probability of firing
    at the centre."""

    centre: Float[np.ndarray, "units 2"]
    axes: Float[np.ndarray, "units 2 inputs"]
    square: Bool[np.ndarray, " units"]
    active: Bool[np.ndarray, " units"]
    certainty: Float[np.ndarray, " units"]

    def outlines(self, which: Bool[np.ndarray, " units"]) -> list[np.ndarray]:
        """The closed outline of each of these units: of the shadow of its region on the plane."""
        rows = zip(self.centre[which], self.axes[which], self.square[which], strict=True)
        return [centre + (_box_shadow if square else _ellipse_shadow)(axes) for centre, axes, square in rows]

    def ellipses(self) -> tuple[Float[np.ndarray, "units 2"], Float[np.ndarray, " units"]]:
        """The half axes of each unit's ellipse, and the angle of the first of them with x, in rad. For a box this is
        the ellipse within the outline that has its axes."""
        directions, half, _ = np.linalg.svd(self.axes)
        return half, np.arctan2(directions[:, 1, 0], directions[:, 0, 0])


def _ellipse_shadow(axes: Float[np.ndarray, "2 inputs"]) -> Float[np.ndarray, "points 2"]:
    """The outline of the shadow of an ellipsoid with these half axes."""
    return ELLIPSE @ np.linalg.cholesky(axes @ axes.T).T


def _box_shadow(axes: Float[np.ndarray, "2 inputs"]) -> Float[np.ndarray, "points 2"]:
    """The outline of the shadow of a box with these half axes: a polygon with two sides along each of them."""
    sides = axes.T[np.any(axes != 0, axis=0)]
    down = (sides[:, 1] < 0) | ((sides[:, 1] == 0) & (sides[:, 0] < 0))
    sides = np.where(down[:, None], -sides, sides)
    sides = sides[np.argsort(np.arctan2(sides[:, 1], sides[:, 0]))]
    there = -sides.sum(0) + np.cumsum(np.concatenate([np.zeros((1, 2)), 2 * sides]), axis=0)
    return np.concatenate([there, -there[1:]])


def shapes_of(policy: Policy) -> Shapes:
    """The shapes of a policy's units. **Raises** `ValueError` for units without a centre in the plane."""
    check_arguments(shapes_of, locals())
    import jax
    import jax.numpy as jnp

    regions = abilities.regions(policy)
    local = regions is not None and regions.centre.shape[-1] >= 2
    wanted = "made of local units, which have a centre in the plane and a width"
    check(local, "policy", type(policy).__name__, wanted)
    assert regions is not None
    certainty = np.diagonal(np.asarray(jax.vmap(policy.prob)(jnp.asarray(regions.centre))))
    centre = regions.centre[:, :2]
    axes = regions.axes[:, :2]
    return Shapes(centre, axes, regions.box, regions.active, np.nan_to_num(np.clip(certainty, 0, 1)))


def has_local_units(task: object, policy: object) -> bool:
    """Whether this is a task on a particle with a policy of units that have a place in its plane."""
    from motorgrad.policies import Policy
    from motorgrad.tasks import ParticleTask

    if not isinstance(task, ParticleTask) or not isinstance(policy, Policy):
        return False
    try:
        shapes_of(policy)
    except ValueError:
        return False
    return True


def direction_colours(forces: Float[np.ndarray, "units 2"]) -> Float[np.ndarray, "units 4"]:
    """A colour for the direction of each force, from a colour wheel; grey for no force."""
    check_arguments(direction_colours, locals())
    from matplotlib.colors import LinearSegmentedColormap, to_rgba

    wheel = LinearSegmentedColormap.from_list("directions", [*WHEEL, WHEEL[0]], N=360)
    turn = np.arctan2(forces[:, 1], forces[:, 0]) / (2 * np.pi) % 1
    colours = wheel(turn)
    colours[~np.any(forces != 0, axis=1)] = to_rgba("0.45")
    return colours


GOOD = "#009E73"
BAD = "#CC3311"
INK = "#26292e"
"""Reward, penalty and paths: a green and a red that colour-blind people can tell apart."""
GRID = 161  # points along each side at which a reward is evaluated
DASH = 0.62  # share of a transition that is drawn; the rest is a gap


def draw_regions(axes: Axes, regions: Sequence[Region], walls: Walls | None = None) -> None:
    """Draw the reward of Gaussian `regions` (`motorgrad.tasks.Region`) as filled contours in the box of the `walls`, by
    default the unit square: green where positive, red where negative.

    Contour lines are at half of the greatest amplitude, solid for reward and dashed for penalty. Without regions only
    the box is drawn. The axes get the box as fixed limits, equal scales and no ticks; a side without a wall is dotted.
    """
    check_arguments(draw_regions, locals())
    walls = _box(axes, walls)
    if not len(regions):
        return

    def reward_at(place: Float[Array, " 2"]) -> Any:
        from motorgrad.tasks import region_reward

        return region_reward(regions, place)

    _field(axes, reward_at, walls, max(abs(region[0]) for region in regions))


def draw_reward(axes: Axes, task: ParticleTask) -> None:
    """Draw the reward of any task on a particle as filled contours in its box, as `draw_regions` does. A goal is a
    green disc of its width. For a task without regions this is the reward for being at rest at each place."""
    check_arguments(draw_reward, locals())
    from matplotlib.patches import Ellipse

    from motorgrad.tasks import FallingParticle, ParticleNavigation

    walls = task.physics.walls
    if isinstance(task, FallingParticle):
        draw_regions(axes, task.places, walls)
    elif isinstance(task, ParticleNavigation):
        draw_regions(axes, task.obstacles, walls)
        _, x, y, *widths = task.goal_region
        axes.add_patch(Ellipse((x, y), *(2 * np.array(widths)), facecolor=GOOD, edgecolor="none", alpha=0.7))
    else:
        _field(axes, _reward_at_rest(task), _box(axes, walls), None)


def draw_units(
    axes: Axes,
    policy: Policy,
    forces: Float[np.ndarray, "units 2"] | Sequence[Any],
    active: npt.ArrayLike | None = None,
) -> DrawnUnits:
    """Draw each local unit as an ellipse of one standard deviation about its centre, with an arrow in the direction of
    its force.

    Soft spheres are circles of their radius, soft boxes rectangles; oriented units are drawn as they lie. With more
    inputs than x and y, what is drawn is the shadow on the plane. Colours show the directions of the forces: purple to
    the right, ochre up, blue to the left, black down, grey without a force. A line is fainter, the lower the unit's
    probability of firing at its centre. Inactive units of a `Masked` pool are left out.

    **Arguments:** `policy`, of local units over x and y, which further inputs may follow; `forces`, one for each unit,
    such as `task.dynamics.forces`; `active`, true for the units to draw, in addition to the policy's own mask.

    **Returns** a `DrawnUnits`, whose `update` shows another policy with the same number of units. **Raises**
    `ValueError` for units without a centre in the plane, and for a wrong number of forces.
    """
    check_arguments(draw_units, locals())
    return DrawnUnits(axes, policy, forces, active)


def draw_paths(axes: Axes, paths: Sequence[Float[Any, "decisions 2"]], colour: ColorType = INK) -> DrawnPaths:
    """Draw trajectories, as the function of that name returns them, with a dash for each decision and a dot at the
    start; the longer a dash, the faster the particle. **Returns** a `DrawnPaths`, whose `update` shows others."""
    check_arguments(draw_paths, locals())
    return DrawnPaths(axes, paths, colour)


def draw_occupancy(
    axes: Axes, occupancy: Float[np.ndarray, "rows columns"], walls: Walls | None = None, most: float | None = None
) -> AxesImage:
    """Draw how often the particle visits each place, as `occupancy` returns it, in the box of the `walls`, by default
    the unit square: the darker, the more often. Shades follow the square root, so that rare places show too. `most` is
    the value drawn black, by default the one that one cell in two hundred exceeds. Use the same value for pictures that
    are compared."""
    check_arguments(draw_occupancy, locals())
    from matplotlib.colors import PowerNorm

    walls = _box(axes, walls)
    shares = np.asarray(occupancy)
    check(shares.ndim == 2, "occupancy", shares.shape, "a grid, rows and columns")
    top = float(np.percentile(shares, 99.5)) if most is None else most
    extent = (walls.left, walls.right, walls.bottom, walls.top)
    norm = PowerNorm(0.5, 0, top or 1.0, clip=True)
    return axes.imshow(shares, cmap="Greys", norm=norm, origin="lower", extent=extent, interpolation="nearest")


class DrawnUnits:
    """Units on axes, made by `draw_units`."""

    def __init__(self, axes: Axes, policy: Policy, forces: npt.ArrayLike, active: npt.ArrayLike | None = None) -> None:
        check_arguments(DrawnUnits, locals())
        from matplotlib.collections import PolyCollection

        self._forces = np.asarray(forces, float)
        check(self._forces.shape[1:] == (2,), "forces", self._forces.shape, "of shape (units, 2)")
        self._colours = direction_colours(self._forces)
        (x0, x1) = axes.get_xlim()
        (y0, y1) = axes.get_ylim()
        self._length = 0.06 * min(abs(x1 - x0), abs(y1 - y0))
        self._outlines = PolyCollection([], facecolors="none", linewidths=1.3, zorder=3)
        self._arrows = PolyCollection([], edgecolors="white", linewidths=0.4, zorder=4)
        for part in (self._outlines, self._arrows):
            axes.add_collection(part, autolim=False)
        self.artists = (self._outlines, self._arrows)
        """The matplotlib artists."""
        self.update(policy, active)

    def update(self, policy: Policy, active: npt.ArrayLike | None = None) -> None:
        """Show another policy with the same number of units."""
        shapes = shapes_of(policy)
        count = len(self._forces)
        check(len(shapes.centre) == count, "forces", count, f"as many as there are units, {len(shapes.centre)}")
        wanted = np.ones(count, bool) if active is None else np.asarray(active, bool)
        check(wanted.shape == (count,), "active", wanted.shape, f"true or false for each unit, {(count,)}")
        there = shapes.active & wanted
        colours = self._colours[there].copy()
        self._arrows.set_verts(_arrows(shapes, there, self._forces, self._length))
        self._arrows.set(facecolor=colours[np.any(self._forces[there] != 0, axis=1)])
        colours[:, 3] = 0.2 + 0.8 * shapes.certainty[there]
        self._outlines.set_verts(shapes.outlines(there))
        self._outlines.set(edgecolor=colours)


class DrawnPaths:
    """Trajectories on axes, made by `draw_paths`."""

    def __init__(self, axes: Axes, paths: Sequence[Any], colour: ColorType = INK) -> None:
        check_arguments(DrawnPaths, locals())
        from matplotlib.collections import LineCollection

        self._dashes = LineCollection([], colors=[colour], linewidths=1.0, alpha=0.8, zorder=2, capstyle="butt")
        axes.add_collection(self._dashes, autolim=False)
        (self._starts,) = axes.plot([], [], "o", color=colour, markersize=3, alpha=0.9, zorder=2.5, scaley=False)
        self.artists = (self._dashes, self._starts)
        """The matplotlib artists."""
        self.update(paths)

    def update(self, paths: Sequence[Any]) -> None:
        """Show other trajectories, of any number and lengths."""
        listed = [np.asarray(path, float) for path in paths]
        for path in listed:
            check(path.ndim == 2 and path.shape[1] == 2, "paths", path.shape, "positions of two numbers in each path")
        pieces = [np.stack([path[:-1], path[:-1] + DASH * np.diff(path, axis=0)], axis=1) for path in listed]
        self._dashes.set_segments([dash for path in pieces for dash in path])
        starts = np.array([path[0] for path in listed if len(path)]).reshape(-1, 2)
        self._starts.set_data(*starts.T)


def _arrows(shapes: Shapes, there: np.ndarray, forces: np.ndarray, length: float) -> list[np.ndarray]:
    """Outlines of arrows from each centre in the direction of the force; the strongest has the full length."""
    template = length * np.array(
        [(0, 0.09), (0.55, 0.09), (0.55, 0.3), (1, 0), (0.55, -0.3), (0.55, -0.09), (0, -0.09)]
    )
    most = np.hypot(*forces.T).max() or 1.0
    along = forces / most
    pushing = there & np.any(forces != 0, axis=1)
    turned = [np.stack([template @ (fx, -fy), template @ (fy, fx)], axis=1) for fx, fy in along[pushing]]
    return [arrow + centre for arrow, centre in zip(turned, shapes.centre[pushing], strict=True)]


def _box(axes: Axes, walls: Walls | None) -> Walls:
    """Fix the axes to the box, without ticks."""
    from motorgrad.worlds import Walls

    walls = Walls() if walls is None else walls
    across, up = walls.spans
    axes.set(xlim=across, ylim=up, aspect="equal", xticks=(), yticks=())
    for side, spine in axes.spines.items():
        spine.set(visible=True, linestyle=":" if side in walls.open else "-", color=INK, linewidth=1.0)
    return walls


def _field(
    axes: Axes, reward_at: Callable[[Float[Array, " 2"]], Float[Array, ""]], walls: Walls, most: float | None
) -> None:
    """Draw a function of the position as filled contours, with one scale for reward and penalty."""
    import jax
    import jax.numpy as jnp
    from matplotlib.colors import LinearSegmentedColormap

    x, y = np.meshgrid(*(np.linspace(low, high, GRID) for low, high in walls.spans))
    places = np.stack([x, y], axis=-1, dtype=np.float32).reshape(-1, 2)
    values = np.asarray(jax.vmap(reward_at)(jnp.asarray(places))).reshape(x.shape)
    # overlapping regions may add up to more than the greatest amplitude
    most = max(float(np.abs(values).max()), most or 0.0) or 1.0
    shades = LinearSegmentedColormap.from_list("reward", [BAD, "#eda396", "white", "#8fd0bb", GOOD])
    axes.contourf(x, y, values, levels=np.linspace(-most, most, 22), cmap=shades, alpha=0.75, zorder=0)
    for level, line in ((-most / 2, "--"), (most / 2, "-")):
        if values.min() < level < values.max():
            axes.contour(x, y, values, [level], colors=[BAD if level < 0 else GOOD], linestyles=line, linewidths=0.8)


def _reward_at_rest(task: ParticleTask) -> Any:
    """The function that gives a task's reward for a particle at rest at a place, without any force."""
    import jax.numpy as jnp

    from motorgrad.worlds import ParticleState

    def reward_at(place: Float[Array, " 2"]) -> Any:
        state = ParticleState(place, jnp.zeros(2), jnp.zeros(4, bool))
        memory = task.init(jnp.zeros(task.init_uniforms))
        return task.reward(memory, state, jnp.zeros(task.action_size))[1]

    return reward_at
