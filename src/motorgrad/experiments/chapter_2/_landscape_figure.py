"""The drawing of figure 2.2: the objective as a surface, the same from above, and the reward beneath."""

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from motorgrad.experiments._experiment import Values

COLOURS = "viridis"
INK, NOISY = "#1a1a1a", "#ff7043"


def draw_landscape(values: "Values") -> "Figure":
    """The figure."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 6.6), dpi=200, layout="constrained")  # the surface is a picture, also within an SVG
    grid = figure.add_gridspec(2, 2, width_ratios=[1.35, 1], height_ratios=[2.6, 1])
    reached = values["reached"]
    scale = Normalize(min(0.3, float(reached.min())), float(values["best"]))
    colour = ScalarMappable(scale, COLOURS)
    _surface(figure.add_subplot(grid[:, 0], projection="3d", computed_zorder=False), values, colour)
    above = figure.add_subplot(grid[0, 1])
    _above(above, values, colour)
    _reward(figure.add_subplot(grid[1, 1], sharex=above), values, colour)
    bar = figure.colorbar(colour, ax=figure.axes, location="bottom", fraction=0.035, pad=0.02, aspect=60)
    bar.set_label("reward of the optimum to which hill climbing leads")
    return figure


def _surface(axes: Any, values: "Values", colour: Any) -> None:
    from matplotlib.colors import LightSource

    mean, deviation = np.meshgrid(values["means"], values["deviations"])
    light = LightSource(azdeg=-60, altdeg=50)
    face = light.shade_rgb(
        colour.to_rgba(values["reached"])[..., :3], values["objective"], blend_mode="soft", vert_exag=4
    )
    look = {"rcount": 101, "ccount": 201, "shade": False, "linewidth": 0, "antialiased": False}
    drawn = axes.plot_surface(mean, deviation, values["objective"], facecolors=face, **look)
    drawn.set_rasterized(True)
    # the reward itself is the front edge
    axes.plot(values["means"], 0 * values["means"], values["objective"][0], color=INK, linewidth=1.4)
    for path in values["paths"]:
        line = _thinned(path)
        height = _height(values, line) + 0.012
        axes.plot(line[:, 0], line[:, 1], height, color="white", linewidth=2.6)
        axes.plot(line[:, 0], line[:, 1], height, color=INK, linewidth=1.3)
        axes.plot(*line[0], height[0], "o", color=INK, markersize=4, markeredgecolor="white")
    axes.set(
        xlabel=r"mean $\theta_\mu$", ylabel=r"standard deviation $\theta_\sigma$", zlabel=r"objective $\rho(\theta)$"
    )
    axes.view_init(elev=40, azim=-72)
    axes.set_box_aspect((1.5, 1.3, 0.8), zoom=1.18)
    axes.set_title("the objective, and hill climbing on it", loc="left")


def _thinned(path: np.ndarray) -> np.ndarray:
    """A trajectory without the points that lie within a hundredth of the one drawn before; its last is kept."""
    kept = [0]
    for at in range(1, len(path)):
        if np.abs(path[at] - path[kept[-1]]).max() > 0.01:
            kept.append(at)
    return path[[*kept, len(path) - 1]]


def _height(values: "Values", points: np.ndarray) -> np.ndarray:
    """The surface at these points, as it is drawn."""
    from scipy.interpolate import RegularGridInterpolator

    deviation, mean = values["deviations"], values["means"]
    surface = RegularGridInterpolator((deviation, mean), values["objective"])
    inside = np.clip(points[:, ::-1], (0, mean[0]), (deviation[-1], mean[-1]))
    return surface(inside)


def _above(axes: "Axes", values: "Values", colour: Any) -> None:
    mean, deviation = values["means"], values["deviations"]
    axes.pcolormesh(mean, deviation, values["reached"], norm=colour.norm, cmap=COLOURS, rasterized=True)
    axes.contour(mean, deviation, values["objective"], levels=18, colors="white", linewidths=0.5, alpha=0.6)
    for path in (*values["shown wide"], *values["shown narrow"]):
        line = _thinned(path)
        axes.plot(line[:, 0], line[:, 1], color="white", linewidth=1.6, alpha=0.7)
        axes.plot(line[:, 0], line[:, 1], color=NOISY, linewidth=0.9)
        axes.plot(*path[0], "o", color=NOISY, markersize=4, markeredgecolor="white", clip_on=False)
    for path in values["paths"]:
        axes.plot(*_thinned(path).T, color=INK, linewidth=1.2)
        axes.plot(*path[0], "o", color=INK, markersize=4, markeredgecolor="white")
    axes.plot([], [], color=INK, label="exact gradient")
    axes.plot([], [], color=NOISY, label="from rewards alone")
    axes.set(ylabel=r"standard deviation $\theta_\sigma$", xlim=(mean[0], mean[-1]), ylim=(0, deviation[-1]))
    axes.tick_params(labelbottom=False)
    axes.set_title("from above", loc="left")
    axes.legend(loc="lower right", bbox_to_anchor=(1.01, 0.99), ncols=2, fontsize=9)


def _reward(axes: "Axes", values: "Values", colour: Any) -> None:
    mean, reward, reached = values["means"], values["objective"][0], values["reached"][1]
    ends = [0, *(np.flatnonzero(np.abs(np.diff(reached)) > 0.01) + 1), len(mean) - 1]
    for left, right in itertools.pairwise(ends):
        part = slice(left, right + 1)
        axes.fill_between(mean[part], reward[part], color=colour.to_rgba(reached[left]), linewidth=0)
    axes.plot(mean, reward, color=INK, linewidth=1.4)
    axes.set(xlabel=r"mean $\theta_\mu$, or action $x$", ylabel="reward $r(x)$", ylim=(0, None))
