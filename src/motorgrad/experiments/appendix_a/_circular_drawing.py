"""Drawings of the circular field of force and of its orbits."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.sim import draw_paths, draw_regions
from motorgrad.worlds import ParticlePhysics

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_field(
    axes: "Axes", physics: ParticlePhysics, force: Callable[..., np.ndarray] | None, paths: Sequence[np.ndarray]
) -> None:
    """The unit square with arrows of the force, paths, the radius r* and the orbit."""
    draw_regions(axes, ())
    if force is not None:
        side = np.linspace(0.04, 0.96, 15)
        places = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
        arrows = force(physics.field, places)
        strength = np.linalg.norm(arrows, axis=1)
        drawn: Any = axes.quiver(*places.T, *arrows.T, strength, cmap="viridis_r", width=0.006, scale=7)
        axes.figure.colorbar(drawn, ax=axes, shrink=0.8, label="force")
    draw_paths(axes, paths)
    turn = np.linspace(0, 2 * np.pi, 181)
    for radius, line, label in (
        (physics.field.radius, ":", f"r* = {physics.field.radius:g}"),
        (physics.orbit_radius, "-", f"orbit, {physics.orbit_radius:.3f}"),
    ):
        x, y = (c + radius * f(turn) for c, f in zip(physics.field.centre, (np.cos, np.sin), strict=True))
        axes.plot(x, y, line, color="#CC3311", linewidth=1.6, label=label, zorder=3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=2, fontsize=8)
    axes.set_title("the force" if force is not None else "paths from rest, no pushes", fontsize=10)


def draw_limits(axes: "Axes", values: Values, radius: float) -> None:
    """The orbit's radius against how strong the tangential part is: the formula and what was measured."""
    part = np.linspace(0, 0.93, 200)
    axes.plot(part, 1 / (1 - part**2), color="0.3", label=r"$1/(1-k_1^2/k_2)$")
    count = len(values["share"])
    axes.plot(values["share"], values["measured"][:count] / radius, "o", color="#0061B0", label="measured")
    axes.axvline(1, color="#CC3311", linestyle="--", linewidth=1, label="no orbit from here on")
    axes.set(xlabel=r"$k_1/\sqrt{k_2}$", ylabel="radius of the orbit / r*", xlim=(0, 1.05), ylim=(0, 8))
    axes.set_title("mass and drag 1", fontsize=10)
    axes.legend(loc="upper left", fontsize=8)
