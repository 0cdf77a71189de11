"""A body drawn with matplotlib, without OpenGL: outlines of its parts, its muscles along their paths, the ground."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad._errors import check
from motorgrad.sim._colours import geom_colours
from motorgrad.sim._framing import axes as view_axes
from motorgrad.sim._framing import visible_geoms
from motorgrad.sim._ground import ground_line
from motorgrad.sim._muscles import colour, tendon_activation, width
from motorgrad.sim._outline import outline
from motorgrad.sim._pose import pose, tendon_paths
from motorgrad.sim._scenery import nice_step

if TYPE_CHECKING:
    import mujoco
    from matplotlib.axes import Axes

GROUND, SURFACE = "#dcdcd6", "#8e9088"
MUSCLE_EDGE = "#5c1a1a"


class Drawing:
    """A body on matplotlib axes, as `draw` makes it; `update` moves it without new artists.

    `parts` and `muscles` are the matplotlib collections of the body's outlines and of its tendons' paths, in metres to
    the right and up.
    """

    def __init__(
        self, ax: Axes, model: mujoco.MjModel, screen: np.ndarray, linewidth: float, alpha: float, ground: bool
    ) -> None:
        import mujoco
        from matplotlib.collections import LineCollection, PolyCollection

        self._model, self._data = model, mujoco.MjData(model)
        self._screen, self._linewidth = screen, linewidth
        self._forward = np.cross(screen[0], screen[1])  # towards the viewer
        seen = visible_geoms(model)
        flat = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
        self._geoms = seen[~np.isin(model.geom_type[seen], flat)]
        fill = geom_colours(model)[self._geoms]
        fill[:, 3] *= alpha
        self._fill: Any = fill
        self._edge: Any = fill * [0.5, 0.5, 0.5, 1]
        self.parts = PolyCollection([], linewidths=0.4 * linewidth, joinstyle="round", zorder=2)
        shape: dict[str, Any] = {"capstyle": "round", "joinstyle": "round"}
        self._rims = LineCollection([], colors=MUSCLE_EDGE, alpha=alpha, zorder=2.1, **shape)
        self.muscles = LineCollection([], alpha=alpha, zorder=2.2, **shape)
        for collection in (self.parts, self._rims, self.muscles):
            ax.add_collection(collection, autolim=False)
        self._rimmed = alpha == 1  # a rim under a muscle that is seen through would colour it
        self._ground: Any = None
        if ground:
            self._ground = PolyCollection([], facecolors=GROUND, edgecolors=SURFACE, linewidths=1.0, zorder=0.5)
            self._marks = LineCollection([], colors=SURFACE, linewidths=1.0, zorder=0.6)
            ax.add_collection(self._ground, autolim=False)
            ax.add_collection(self._marks, autolim=False)

    def update(self, position: np.ndarray, activation: np.ndarray) -> None:
        """Put the body into the posture `position` `(nq,)` with its muscles at `activation` `(nu,)` in [0, 1]."""
        model, data = self._model, self._data
        position, activation = np.asarray(position, float), np.asarray(activation, float)
        check(position.shape == (model.nq,), "position.shape", position.shape, f"({model.nq},): (nq of the model,)")
        check(activation.shape == (model.nu,), "activation.shape", activation.shape, f"({model.nu},): (actuators,)")
        pose(model, data, position)
        # far ones first, by the face towards the viewer; rounded, as the parts of a planar body are all as far
        turns = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        middle, half = model.geom_aabb[self._geoms, :3], model.geom_aabb[self._geoms, 3:]
        towards = np.einsum("gij,i->gj", turns, self._forward)
        face = data.geom_xpos[self._geoms] @ self._forward + np.sum(middle * towards + half * np.abs(towards), 1)
        order = np.argsort(np.round(face, 6), kind="stable")
        self.parts.set_verts([outline(model, data, geom, self._screen) for geom in self._geoms[order]])
        self.parts.set_facecolor(self._fill[order])
        self.parts.set_edgecolor(self._edge[order])
        pieces = tendon_paths(model, data)
        level = tendon_activation(model, activation)[[tendon for tendon, _ in pieces]]
        lines = [points @ self._screen.T for _, points in pieces]
        wide = self._linewidth * width(level)
        self._rims.set_segments(lines if self._rimmed else [])
        self._rims.set_linewidth((wide + 0.5 * self._linewidth).tolist())
        self.muscles.set_segments(lines)
        self.muscles.set_linewidth(wide.tolist())
        self.muscles.set_color(colour(level))  # type: ignore[arg-type]

    def update_ground(self, centre: np.ndarray, reach: float, size: float) -> None:
        """Draw the ground within `reach` metres of the point `centre` `(3,)`, marked for a body of `size` metres."""
        if self._ground is None:
            return
        middle = centre @ self._screen[0]
        step = nice_step(size / 2)
        # whole steps from the origin, so that marks stay where they are in the world while the camera moves
        first, last = np.floor((middle - reach) / step), np.ceil((middle + reach) / step)
        along = step * np.linspace(first, last, 8 * int(last - first) + 1)
        height = ground_line(self._model, self._data, centre, self._screen, along)
        if height is None:
            return
        surface = np.stack([along, height * self._screen[1, 2]], 1)
        floor = surface[:, 1].min() - 10 * reach
        self._ground.set_verts([np.concatenate([surface, [[along[-1], floor], [along[0], floor]]])])
        marks = surface[::8]
        self._marks.set_segments([np.stack([mark, mark - [0, 0.02 * size]]) for mark in marks])

    def bounds(self) -> np.ndarray:
        """Lowest and highest corner of the body with its muscles on the axes: `(2, 2)`, metres."""
        outlines = [path.vertices for path in self.parts.get_paths()]
        points = np.concatenate([*outlines, *self.muscles.get_segments(), np.empty((0, 2))])
        return np.stack([points.min(0), points.max(0)]) if len(points) else np.zeros((2, 2))


def draw(
    ax: Axes,
    model: mujoco.MjModel,
    position: np.ndarray,
    activation: np.ndarray,
    *,
    azimuth: float = 90.0,
    elevation: float = 0.0,
    linewidth: float = 2.0,
    alpha: float = 1.0,
    ground: bool = True,
) -> Drawing:
    """Draw a body with its muscles on matplotlib axes, orthographic, in metres; needs no OpenGL.

    Spheres, capsules, ellipsoids, cylinders, boxes and convex meshes are outlined, far ones first; tendons run along
    the path on which MuJoCo wraps them, pale pink while silent, strong red and twice as wide while firing; planes and
    height fields are a line of ground with marks every 1, 2 or 5 times a power of ten metres.

    **Arguments:**

    - `position`: `(nq,)`; `activation`: `(nu,)` in [0, 1].
    - `azimuth`, `elevation`: the line of sight in degrees, as of MuJoCo's free camera: at azimuth 90 it looks along
      +y, with x to the right; at 180 along -x, with y to the right; at elevation -90 it looks straight down.
    - `linewidth`: of a silent muscle, in points.
    - `alpha`: of the body, in (0, 1]; low for the older postures of a sequence.
    - `ground`: whether to draw it; False for all but the first of several bodies on the same axes.

    **Returns:** a `Drawing`, whose `update(position, activation)` moves the body.

    **Raises:** `ValueError` for shapes that do not fit the model, or `alpha` or `linewidth` out of range.

    The axes are set to equal scales and, where they did not hold limits of your own, to limits around the body.
    """
    check(0 < alpha <= 1, "alpha", alpha, "in (0, 1]")
    check(linewidth > 0, "linewidth", linewidth, "above 0")
    check(np.isfinite(azimuth), "azimuth", azimuth, "a finite number of degrees")
    check(-90 <= elevation <= 90, "elevation", elevation, "in [-90, 90] degrees")
    drawing = Drawing(ax, model, view_axes(azimuth, elevation)[:2], linewidth, alpha, ground)
    drawing.update(position, activation)
    bounds = drawing.bounds()
    size = max(float((bounds[1] - bounds[0]).max()), 1e-3)
    centre = bounds.mean(0) @ drawing._screen
    drawing.update_ground(centre, 20 * size, size)
    ax.set_aspect("equal", adjustable="datalim")
    ax.update_datalim(np.stack([bounds[0] - 0.1 * size, bounds[1] + 0.1 * size]))
    ax.autoscale_view()
    return drawing
