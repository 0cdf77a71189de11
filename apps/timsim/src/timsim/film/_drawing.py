"""A body drawn with matplotlib, without OpenGL: outlines of its parts, muscles along their paths, and the ground."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad._labels import literal
from timsim.film._annotations import Arrow
from timsim.film._appearance import (
    MARK,
    MARK_OPACITY,
    check_posture,
    geom_colours,
    height_grid,
    muscle_colour,
    muscle_width,
    set_posture,
    tendon_activation,
    tendon_paths,
)
from timsim.film._framing import DOWNWARDS, SIDEWAYS, UPWARDS, View, camera_axes, visible_geoms
from timsim.film._scenery import SKY, nice_step
from timsim.film._sight import Parallel, Perspective, Sight
from timsim.film._viewpoint import Viewpoint

if TYPE_CHECKING:
    import mujoco
    from matplotlib.axes import Axes


OUTLINE_POINTS = 40
CIRCLE = np.stack([f(2 * np.pi * np.arange(OUTLINE_POINTS) / OUTLINE_POINTS) for f in (np.cos, np.sin)], 1)


def outline(model: mujoco.MjModel, data: mujoco.MjData, geom: int, sight: Sight) -> np.ndarray:
    """The silhouette of a sphere, capsule, ellipsoid, cylinder, box, or the convex hull of a mesh.

    **Arguments:** `sight`: how the picture is projected.

    **Returns:** `(OUTLINE_POINTS, 2)` m: the support point, the farthest of the shape, in each of that many directions
    of the picture. This works for any orientation.
    """
    turn = data.geom_xmat[geom].reshape(3, 3)
    # slightly off the axes, so that an upright box has one farthest corner rather than an edge
    angles = 2 * np.pi * np.arange(OUTLINE_POINTS) / OUTLINE_POINTS + 1e-3
    screen = sight.screen(data.geom_xpos[geom])
    ways = np.stack([np.cos(angles), np.sin(angles)], 1) @ screen @ turn  # (OUTLINE_POINTS, 3), in the geom's own axes
    points = _support(model, geom, ways)
    return sight.flat(points @ turn.T + data.geom_xpos[geom])


def _support(model: mujoco.MjModel, geom: int, ways: np.ndarray) -> np.ndarray:
    """The farthest points of the geom in given directions, in its own axes: `(n, 3)` of `(n, 3)`."""
    import mujoco

    kind = model.geom_type[geom]
    size = model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return size[0] * ways / _length(ways)
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return size**2 * ways / _length(size * ways)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return size[0] * ways / _length(ways) + np.outer(np.sign(ways[:, 2]), [0, 0, size[1]])
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        round_ = ways * [1, 1, 0]
        return size[0] * round_ / _length(round_) + np.outer(np.sign(ways[:, 2]), [0, 0, size[1]])
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        corners = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        return corners[np.argmax(ways @ corners.T, 1)]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return np.sign(ways) * size
    middle = model.geom_aabb[geom, :3]
    half = model.geom_aabb[geom, 3:]
    return middle + np.sign(ways) * half  # a signed distance field: its bounding box


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)


def ground_line(
    model: mujoco.MjModel, data: mujoco.MjData, through: np.ndarray, screen: np.ndarray, along: np.ndarray
) -> np.ndarray | None:
    """The line in which planes and height fields cut a vertical plane through a point, seen horizontally.

    **Arguments:** `through`: `(3,)`, a point of the plane; `screen`: `(2, 3)`, right and up; `along`: `(n,)` m to the
    right, where the height is wanted.

    **Returns:** `(n,)` heights of the highest ground; None for a model without ground, or seen from above.
    """
    if abs(screen[1, 2]) < 0.5:
        return None
    return ground_height(model, data, through + np.outer(along - through @ screen[0], screen[0]))


def ground_height(model: mujoco.MjModel, data: mujoco.MjData, places: np.ndarray) -> np.ndarray | None:
    """Heights `(n,)` of the highest plane or height field above or below places `(n, 3)`; None without either."""
    import mujoco

    heights = []
    for geom in range(model.ngeom):
        point = data.geom_xpos[geom]
        turn = data.geom_xmat[geom].reshape(3, 3)
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE and turn[2, 2] > 0.1:
            heights.append(point[2] - (places - point)[:, :2] @ turn[:2, 2] / turn[2, 2])
        elif model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_HFIELD:
            heights.append(_field_height(model, model.geom_dataid[geom], (places - point) @ turn) + point[2])
    return np.max(heights, axis=0) if heights else None


def _field_height(model: mujoco.MjModel, field: int, places: np.ndarray) -> np.ndarray:
    """Heights of a field above its origin at places in its own axes, by bilinear interpolation, constant beyond its
    edge.
    """
    grid = height_grid(model, field)
    (wide, deep, tall) = model.hfield_size[field, :3]
    rows, columns = grid.shape
    column = np.clip((places[:, 0] / wide + 1) / 2, 0, 1) * (columns - 1)
    row = np.clip((places[:, 1] / deep + 1) / 2, 0, 1) * (rows - 1)
    left = np.minimum(column.astype(int), columns - 2)
    low = np.minimum(row.astype(int), rows - 2)
    x = column - left
    y = row - low
    below = grid[low, left] * (1 - x) + grid[low, left + 1] * x
    above = grid[low + 1, left] * (1 - x) + grid[low + 1, left + 1] * x
    return tall * (below * (1 - y) + above * y)


DISC = 0.75  # radius of the ground that is drawn as a camera sees it, in sizes of the body
GROUND = "#dcdcd6"
SURFACE = "#8e9088"
MUSCLE_EDGE = "#5c1a1a"


class Drawing:
    """A body on matplotlib axes, made by `draw`; `update` moves it without creating new artists.

    `parts` and `muscles` are the matplotlib collections of the body's outlines and tendon paths, in metres to the right
    and up.
    """

    def __init__(
        self, ax: Axes, model: mujoco.MjModel, sight: Sight, linewidth: float, alpha: float, ground: bool
    ) -> None:
        import mujoco
        from matplotlib.collections import LineCollection, PolyCollection

        self._model = model
        self._data = mujoco.MjData(model)
        self._sight, self._linewidth = sight, linewidth
        self._screen = sight.axes[:2]
        self._forward = sight.axes[2]
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
        self._rimmed = alpha == 1  # a rim under a transparent muscle would colour it
        self._ground: Any = None
        if ground:
            self._ground = PolyCollection([], facecolors=GROUND, edgecolors=SURFACE, linewidths=1.0, zorder=0.5)
            self._marks = LineCollection([], colors=SURFACE, linewidths=1.0, zorder=0.6)
            ax.add_collection(self._ground, autolim=False)
            ax.add_collection(self._marks, autolim=False)

    def update(self, position: np.ndarray, activation: np.ndarray) -> None:
        """Move the body to the posture `position` `(nq,)`, with its muscles at `activation` `(nu,)` in [0, 1]."""
        model, data = self._model, self._data
        position, activation = check_posture(model, position, activation)
        set_posture(model, data, position)
        # far ones first, by the face towards the viewer; rounded, as all parts of a planar body are equally far
        turns = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        middle = model.geom_aabb[self._geoms, :3]
        half = model.geom_aabb[self._geoms, 3:]
        towards = np.einsum("gij,i->gj", turns, self._forward)
        far = self._sight.depth(data.geom_xpos[self._geoms])
        face = np.sum(middle * towards + half * np.abs(towards), 1) - far
        order = np.argsort(np.round(face, 6), kind="stable")
        order = order[np.isfinite(far[order])]  # the others are behind the camera
        self.parts.set_verts([outline(model, data, geom, self._sight) for geom in self._geoms[order]])
        self.parts.set_facecolor(self._fill[order])
        self.parts.set_edgecolor(self._edge[order])
        pieces = [piece for piece in tendon_paths(model, data) if np.isfinite(self._sight.depth(piece[1])).all()]
        level = tendon_activation(model, activation)[[tendon for tendon, _ in pieces]]
        lines = [self._sight.flat(points) for _, points in pieces]
        wide = self._linewidth * muscle_width(level)
        self._rims.set_segments(lines if self._rimmed else [])
        self._rims.set_linewidth((wide + 0.5 * self._linewidth).tolist())
        self.muscles.set_segments(lines)
        self.muscles.set_linewidth(wide.tolist())
        self.muscles.set_color(muscle_colour(level))  # type: ignore[arg-type]

    def update_ground(self, centre: np.ndarray, reach: float, size: float) -> None:
        """Draw the ground within `reach` metres of the point `centre` `(3,)`, marked for a body of `size` metres."""
        if self._ground is None:
            return
        if isinstance(self._sight, Perspective):
            self._draw_disc(centre, size)
            return
        middle = centre @ self._screen[0]
        step = nice_step(size / 2)
        # whole steps from the origin, so that marks stay fixed in the world while the camera moves
        first = np.floor((middle - reach) / step)
        last = np.ceil((middle + reach) / step)
        along = step * np.linspace(first, last, 8 * int(last - first) + 1)
        height = ground_line(self._model, self._data, centre, self._screen, along)
        if height is None:
            return
        surface = np.stack([along, height * self._screen[1, 2]], 1)
        floor = surface[:, 1].min() - 10 * reach
        self._ground.set_verts([np.concatenate([surface, [[along[-1], floor], [along[0], floor]]])])
        marks = surface[::8]
        self._marks.set_segments([np.stack([mark, mark - [0, 0.02 * size]]) for mark in marks])

    def _draw_disc(self, centre: np.ndarray, size: float) -> None:
        """Draw the ground around and below a point as a camera sees it."""
        angle = np.linspace(0, 2 * np.pi, 96, endpoint=False)
        rim = centre + DISC * size * np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
        height = ground_height(self._model, self._data, rim)
        if height is not None:
            rim[:, 2] = height
            seen = rim[np.isfinite(self._sight.depth(rim))]
            self._ground.set_verts([self._sight.flat(seen)] if len(seen) > 2 else [])
            self._ground.set_edgecolor("none")

    def bounds(self) -> np.ndarray:
        """The lower and upper corners of the body and its muscles on the axes: `(2, 2)` m."""
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

    Spheres, capsules, ellipsoids, cylinders, boxes and convex meshes are outlined, far ones first. Tendons run along
    the path on which MuJoCo wraps them, pale pink while silent, strong red and twice as wide while active. Planes and
    height fields are a line of ground with marks every 1, 2 or 5 times a power of ten metres.

    **Arguments:**

    - `position`: `(nq,)`; `activation`: `(nu,)` in [0, 1].
    - `azimuth`, `elevation`: the line of sight in degrees, as of MuJoCo's free camera: at azimuth 90 it looks along +y,
      with x to the right; at 180 along -x, with y to the right; at elevation -90 it looks straight down.
    - `linewidth`: of a silent muscle, in points.
    - `alpha`: of the body, in (0, 1]; low for the older postures of a sequence.
    - `ground`: whether to draw it; False for all but the first of several bodies on the same axes.

    **Returns:** a `Drawing`, whose `update(position, activation)` moves the body.

    **Raises:** `ValueError` for shapes that do not fit the model, or `alpha` or `linewidth` out of range.

    The axes get equal scales and, unless they have limits of your own, limits around the body.

    ```py
    draw(axes, model, position[0], activation[0], azimuth=90)
    ```
    """
    check_arguments(draw, locals())
    check(0 < alpha <= 1, "alpha", alpha, "in (0, 1]")
    check(linewidth > 0, "linewidth", linewidth, "above 0")
    check(np.isfinite(azimuth), "azimuth", azimuth, "a finite number of degrees")
    check(-90 <= elevation <= 90, "elevation", elevation, "in [-90, 90] degrees")
    drawing = Drawing(ax, model, Parallel(camera_axes(azimuth, elevation)), linewidth, alpha, ground)
    drawing.update(position, activation)
    bounds = drawing.bounds()
    size = max(float((bounds[1] - bounds[0]).max()), 1e-3)
    centre = bounds.mean(0) @ drawing._screen
    drawing.update_ground(centre, 20 * size, size)
    ax.set_aspect("equal", adjustable="datalim")
    ax.update_datalim(np.stack([bounds[0] - 0.1 * size, bounds[1] + 0.1 * size]))
    ax.autoscale_view()
    return drawing


DOTS_PER_INCH = 100


class MatplotlibRenderer:
    """Draws pictures of one body with matplotlib; it has the arguments and methods of `GlRenderer`.

    One figure is drawn again and again, with its artists moved from frame to frame.
    """

    def __init__(
        self, model: mujoco.MjModel, view: View, which: int, width: int, height: int, ground: str = "marked"
    ) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.collections import PolyCollection
        from matplotlib.figure import Figure

        # horizontally or from straight above: in an oblique orthographic view the ground is not a line
        above = view.elevation < -60
        axes = camera_axes(view.azimuth, -90.0 if above else 0.0)
        figure = Figure((width / DOTS_PER_INCH, height / DOTS_PER_INCH), dpi=DOTS_PER_INCH, facecolor=tuple(SKY))
        self._canvas = FigureCanvasAgg(figure)
        self._axes: Any = figure.add_axes((0, 0, 1, 1))
        self._axes.set_axis_off()
        self._screen = axes[:2]
        self._which = which
        self._aspect = width / height
        self.set_view(view)
        self._model = model
        self._line = height / 480 * 2.4
        self._marked = ground == "marked"
        self._viewpoint: Viewpoint | None = None
        self._drawing = Drawing(self._axes, model, Parallel(axes), self._line, 1.0, self._marked)
        self._drawing.parts.set_gid("parts")  # names of the groups in a vector picture
        self._drawing.muscles.set_gid("muscles")
        self._marks = PolyCollection([], facecolors=tuple(MARK), alpha=MARK_OPACITY, linewidths=0, zorder=2.3)
        self._axes.add_collection(self._marks, autolim=False)
        self._arrows: list[Any] = []

    def set_view(self, view: View) -> None:
        """Change to another view from the same side."""
        self._centres = view.centres[self._which]
        self._half = np.abs(self._screen) @ view.half
        # m from the middle to the sides; the picture's lower and upper halves share what the margins leave
        tall = 2 * self._half[1] / (DOWNWARDS + UPWARDS)
        self._reach = max(self._half[0] / SIDEWAYS, tall * self._aspect)
        self._tall = self._reach / self._aspect
        self._lift = self._tall * (DOWNWARDS - UPWARDS) / 2
        self._size = 2 * float(self._half.max())

    def look(self, viewpoint: Viewpoint | None) -> None:
        """Look from a viewpoint, or, with None, as the view says."""
        if viewpoint is not None and viewpoint != self._viewpoint:
            self._viewpoint = viewpoint
            self._drawing._sight = Perspective(viewpoint)
            self._drawing._forward = viewpoint.axes[2]

    def paint(
        self,
        frame: int,
        position: np.ndarray,
        activation: np.ndarray,
        marks: np.ndarray,
        beside: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]] = (),
        arrows: Sequence[Arrow] = (),
    ) -> np.ndarray:
        """The picture `(height, width, 3)`, uint8, of one posture with its marks; the next call overwrites it. It
        shows no further bodies.
        """
        del beside
        centre = self._centres[frame]
        viewpoint = self._viewpoint
        sight = self._drawing._sight
        if viewpoint is None:
            right, up = self._screen @ centre
            wide = self._reach
            tall = self._tall
            up = up + self._lift
        else:
            right = up = 0.0
            tall = viewpoint.distance * np.tan(np.radians(viewpoint.field_of_view) / 2)
            wide = self._aspect * tall
        self._axes.set_xlim(right - wide, right + wide)
        self._axes.set_ylim(up - tall, up + tall)
        self._drawing.update(position, activation)
        self._drawing.update_ground(centre, 1.1 * self._reach, self._size)
        self._marks.set_verts([sight.flat(at[None, :3]) + at[3] * CIRCLE for at in marks])
        self._draw_arrows(arrows, tall)
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[..., :3]

    def _draw_arrows(self, arrows: Sequence[Arrow], tall: float) -> None:
        """Draw arrows with their names in a picture of twice as many metres from its lower to its upper edge."""
        from matplotlib.patches import FancyArrowPatch

        for artist in self._arrows:
            artist.remove()
        self._arrows = []
        figure, sight = self._canvas.figure, self._drawing._sight
        points = 72 * figure.get_figheight() / (2 * tall)  # of a metre
        for arrow in arrows:
            if np.isnan(sight.depth(arrow.ends)).any():
                continue
            start, end = sight.flat(arrow.ends)
            wide = max(1.0, 2 * arrow.radius * points)
            style: dict[str, Any] = {"color": arrow.colour, "linewidth": wide, "shrinkA": 0, "shrinkB": 0, "zorder": 3}
            patch = FancyArrowPatch(tuple(start), tuple(end), arrowstyle="-|>", mutation_scale=3 * wide, **style)
            style = {"textcoords": "offset points", "ha": "center", "zorder": 3}
            name = self._axes.annotate(literal(arrow.name), end, (0, 4), **style)
            name.set_fontsize(3.3 * self._line)
            self._arrows += [self._axes.add_patch(patch), name]

    def svg(self) -> bytes:
        """The last picture as vector graphics, without a background."""
        from matplotlib import rc_context

        content = io.BytesIO()
        # no date and no random names, so that the same posture is the same file; text stays text
        with rc_context({"svg.hashsalt": "motorgrad", "svg.fonttype": "none"}):
            figure = self._canvas.figure
            figure.savefig(content, format="svg", transparent=True, metadata={"Date": None, "Creator": "motorgrad"})
            self._canvas.figure.set_canvas(self._canvas)
        return content.getvalue()

    def close(self) -> None:
        """Do nothing; `GlRenderer` has this method."""
