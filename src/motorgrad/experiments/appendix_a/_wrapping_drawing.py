"""The pictures of figure A.1: the geometry with its names, and length and rate against the angle."""

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.bodies import wrapping_angle
from motorgrad.experiments._joint_drawing import draw_bones, draw_path
from motorgrad.experiments._style import EXTENSOR, FLEXOR
from motorgrad.experiments.appendix_a._wrapping_geometry import Shape, ends, path_at, turned

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ALPHA, BETA, THETA = "#2e8b57", EXTENSOR, "0.25"
WRAPPED, STRAIGHT = EXTENSOR, FLEXOR


def draw_geometry(axes: "Axes", angle: float, shape: Shape) -> None:
    """A muscle at θ, with the names of appendix A.2."""
    radius, points = shape[2], ends(angle, shape)
    path = path_at(angle, shape, arc=80)
    wraps = len(path) > 2
    draw_bones(axes, tuple(points), radius, width=7.0)
    for point in points:
        within = radius / np.linalg.norm(point)
        axes.plot(*zip((0, 0), within * point, strict=True), color="0.6", linewidth=1, zorder=2.6)
    draw_path(axes, path, WRAPPED if wraps else STRAIGHT)
    for name, point in zip("AB", points, strict=True):
        _name(axes, point * (1 + 0.017 / np.linalg.norm(point)), f"${name}$", "black", 13)
    axes.text(0.0, -0.3 * radius, "$C$", ha="center", va="center", fontsize=12, zorder=6)
    left, right = (float(np.arctan2(*point[::-1])) for point in points)
    _arc(axes, 1.35 * radius, -np.pi / 2 - angle / 2, -np.pi / 2 + angle / 2, r"$\theta$", THETA, inside=False)
    for name, point in zip("AB", points, strict=True):
        outward = np.array([-point[1], point[0]]) / np.linalg.norm(point) * (1 if name == "A" else -1)
        _name(axes, 0.66 * point + 0.011 * outward, f"$l_{name}$", "#6d6553", 10)
    if wraps:
        _touching(axes, path, left, right, radius)
        axes.set_title(r"$\theta < \theta_c$: wrapped, $L = L_A + r\beta + L_B$", fontsize=11)
    else:
        middle = path.mean(axis=0)
        axes.text(middle[0], middle[1] + 0.008, r"$L = \|A - B\|$", ha="center", va="bottom", color=STRAIGHT)
        axes.set_title(r"$\theta \geq \theta_c$: straight", fontsize=11)
    reach = 1.15 * max(shape[:2])
    axes.set(xlim=(-reach, reach), ylim=(-0.85 * reach, reach), aspect="equal")
    axes.set_axis_off()


def _touching(axes: "Axes", path: np.ndarray, left: float, right: float, radius: float) -> None:
    """Where the path touches: radii, right angles, and the angles between them."""
    touches, leaves = path[1], path[-2]
    first, last = (float(np.arctan2(*point[::-1])) for point in (touches, leaves))
    for point, end in ((touches, path[0]), (leaves, path[-1])):
        axes.plot(*zip((0, 0), point, strict=True), color="0.4", linewidth=1, linestyle="--", zorder=2.7)
        along, inward = (end - point) / np.linalg.norm(end - point), -point / radius
        corner = 0.14 * radius * np.array([along, along + inward, inward]) + point
        axes.plot(*corner.T, color="0.4", linewidth=0.8, zorder=2.7)
    _name(axes, 0.62 * touches + np.array([0.006, 0.003]), "$r$", "0.3", 10)
    _arc(axes, 0.36 * radius, first, left % (2 * np.pi), r"$\alpha_A$", ALPHA)
    _arc(axes, 0.36 * radius, right, last, r"$\alpha_B$", ALPHA)
    _arc(axes, 0.24 * radius, last, first, r"$\beta$", BETA)
    axes.text(0, 1.22 * radius, r"$r\beta$", ha="center", va="center", color=BETA)
    for name, (point, end) in {"A": (touches, path[0]), "B": (leaves, path[-1])}.items():
        middle, outward = (point + end) / 2, point / radius
        words = rf"$L_{name} = l_{name}\,\sin\alpha_{name}$"
        x, y = middle + 0.008 * outward
        axes.text(x, y, words, ha="right" if name == "A" else "left", va="bottom", color=BETA)


def _arc(axes: "Axes", radius: float, start: float, stop: float, name: str, colour: str, inside: bool = True) -> None:
    """An arc about the origin, anticlockwise, with its name at its middle."""
    turn = np.linspace(start, stop, 60)
    axes.plot(radius * np.cos(turn), radius * np.sin(turn), color=colour, linewidth=1.2, zorder=5)
    place = radius * (1.6 if inside else 1.18) * turned((start + stop) / 2)
    _name(axes, place, name, colour, 11)


def _name(axes: "Axes", place: np.ndarray, name: str, colour: str, size: float) -> None:
    axes.text(place[0], place[1], name, ha="center", va="center", color=colour, fontsize=size, zorder=6)


def draw_length(panels: Any, values: dict[str, np.ndarray], shape: Shape) -> None:
    """Length and rate against θ, the two regimes in their colours, θ_c marked."""
    critical = float(wrapping_angle(*shape))
    degrees = np.degrees(values["angle"])
    wraps = values["angle"] < critical
    for axes, quantity, unit in zip(panels, ("length", "rate"), (100, 1000), strict=True):
        for where, colour, words in ((wraps, WRAPPED, "wrapped"), (~wraps, STRAIGHT, "straight")):
            axes.plot(degrees[where], unit * values[quantity][where], color=colour, linewidth=2, label=words)
        axes.axvline(np.degrees(critical), color="0.5", linewidth=1, linestyle="--")
        axes.text(
            np.degrees(critical) + 4,
            0.96,
            rf"$\theta_c = {np.degrees(critical):.0f}°$",
            transform=axes.get_xaxis_transform(),
            va="top",
            color="0.35",
        )
        axes.set(xlabel=r"angle $\theta$ (°)", xlim=(0, 360), xticks=range(0, 361, 60))
    panels[0].set_ylabel("length $L$ (cm)")
    panels[0].legend(loc="lower left")
    panels[1].set_ylabel(r"$\mathrm{d}L/\mathrm{d}\theta$ (mm per rad)")
    panels[1].axhline(-1000 * shape[2], color="0.8", linewidth=1, zorder=0)
    panels[1].text(6, -1000 * shape[2] - 1, "$-r$", va="top", color="0.45")
