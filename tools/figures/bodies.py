"""Figures of muscles and bodies."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from typing import Any

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from motorgrad.bodies import (
    Hopper,
    away_angle,
    compile_model,
    native_force_length,
    path_points,
    tension,
    wrapped_length,
    wrapping_angle,
)
from timsim import draw
from tools.figures._style import EXTENSOR, FAINT, FLEXOR, GREEN, panels

HOPPER = Hopper()
REACH, CAPSULE = HOPPER.attachment_distance, HOPPER.capsule_radius
MUSCLES: tuple[tuple[str, bool, str], ...] = (("flexor", False, FLEXOR), ("extensor", True, EXTENSOR))


def muscle() -> Figure:
    """The law of the force, and the path around a joint at two angles."""
    figure, (force, *joints) = panels(3, height=2.7, width_ratios=[1.3, 1, 1])
    ratio = np.linspace(0, 2.2, 221)
    for shape, colour in ((0.25, FAINT), (HOPPER.muscle_shape, EXTENSOR), (1.0, FLEXOR)):
        force.plot(ratio, tension(1.0, ratio, 0.0, 1.0, 1.0, shape), color=colour, label=rf"$k_{{CE}}$ = {shape:g}")
    native = native_force_length(ratio, 1.0, HOPPER.muscle_shape)
    force.plot(ratio, native, color=GREEN, linestyle="--", label='0.5, "native"')
    force.set(title="contractile force", xlabel="length / rest length", ylabel=r"force / $f_{max}$", ylim=(0, 1.45))
    force.legend(fontsize=7, ncols=2, loc="upper center", columnspacing=1)
    for axes, interior in zip(joints, (80.0, 150.0), strict=True):
        _joint(axes, np.deg2rad(interior))
        axes.set_title(f"knee at {interior:g}°")
    return figure


def _joint(axes: Axes, interior: float) -> None:
    """Two bones at an angle, and the paths of a flexor and an extensor around the capsule."""
    from matplotlib.patches import Circle

    # the bones open to the right, so that in front of the joint is at the right
    ends = REACH * np.array([[np.cos(interior / 2), 0, sign * np.sin(interior / 2)] for sign in (1, -1)])
    for end in ends:
        axes.plot(*np.array([[0, 0], 1.35 * end[[0, 2]]]).T, color="0.75", linewidth=7, solid_capstyle="round")
    axes.add_patch(Circle((0, 0), CAPSULE, facecolor="0.9", edgecolor=FAINT, zorder=3))
    for name, behind, colour in MUSCLES:
        side = np.array([-0.1 if behind else 0.1, 0.0, 0.0])
        path = path_points(ends[0], ends[1], np.zeros(3), CAPSULE, side)
        length = wrapped_length(away_angle(interior, behind), REACH, REACH, CAPSULE)
        axes.plot(path[:, 0], path[:, 2], color=colour, linewidth=2, zorder=4, label=f"{name}, {100 * length:.1f} cm")
    axes.plot(ends[:, 0], ends[:, 2], "o", color="0.2", markersize=4, zorder=5)
    axes.set(xlim=(-0.08, 0.18), ylim=(-0.17, 0.17), aspect="equal")
    axes.set_axis_off()
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), fontsize=7)


def hopper() -> Figure:
    """The hopper with its parts named, and what its muscles can do at each angle of the knee."""
    model = compile_model(HOPPER.spec())
    figure, axes = panels(2, height=4.0, rows=2, width_ratios=[1.25, 1], sharex="col")
    (body, length), (gone, force) = axes
    gone.remove()
    body.set_subplotspec(axes[0, 0].get_gridspec()[:, 0])
    draw(body, model, np.zeros(model.nq), np.array([0.0, 1.0, 0.0, 1.0]), linewidth=3)
    _names(body, model)
    body.set_axis_off()
    angle = np.linspace(*HOPPER.knee_range, 200)
    for name, behind, colour in MUSCLES:
        muscle = next(each for each in HOPPER.muscles if each.group == name)
        away = away_angle(np.deg2rad(angle), behind)
        path = wrapped_length(away, REACH, REACH, CAPSULE)
        length.plot(angle, 100 * path, color=colour, label=name)
        length.axhline(100 * muscle.rest_length, color=colour, linewidth=0.8, linestyle=":")
        pull = tension(1.0, path, 0.0, muscle.strength, muscle.rest_length, muscle.shape)
        force.plot(angle, pull, color=colour, label=name)
        wraps = angle[away < wrapping_angle(REACH, REACH, CAPSULE)]
        if len(wraps) < len(angle):
            at = wraps[0]
            length.plot(at, np.interp(at, angle, 100 * path), "o", color=colour, markersize=4)
            length.annotate("wraps beyond", (at, np.interp(at, angle, 100 * path)), (12, -13), color=colour,
                            textcoords="offset points", ha="right", fontsize=7)  # fmt: skip
    length.set(ylabel="path (cm)", title="length; dotted: rest length")
    force.set(
        ylabel="tension (N)",
        xlabel="interior angle of the knee (°)",
        title="tension of an active muscle at this length",
    )
    force.legend(fontsize=7, loc="center right")
    return figure


def _names(axes: Axes, model: mujoco.MjModel) -> None:
    """Name the parts where they are, the left half's muscles and the right half's bones."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    place = {name: data.body(name).xpos for name in ("load", "thigh_left", "shank_left", "foot", "shank_right")}
    knee_left = place["shank_left"]
    knee_right = place["shank_right"]
    thigh = (place["load"] + knee_right) / 2
    top = place["load"][2]

    def name(words: str, at: Any, beside: tuple[float, float], side: str) -> None:
        style = {"arrowstyle": "-", "color": FAINT, "linewidth": 0.8, "shrinkB": 1}
        axes.annotate(words, (at[0], at[-1]), beside, arrowprops=style, ha=side, va="center", fontsize=8, color="0.2")

    name(f"load, {HOPPER.load_mass:g} kg,\non a vertical slide", place["load"], (0.13, top + 0.08), "left")
    name(f"thigh, {HOPPER.link_mass:g} kg", thigh, (0.2, top - 0.02), "left")
    name("knee, with its\ncapsule", knee_right, (0.27, knee_right[2]), "left")
    name("shank", (place["foot"] + knee_right) / 2, (0.2, 0.06), "left")
    name(f"foot, {HOPPER.foot_mass:g} kg,\nwith a contact sensor", place["foot"], (0.1, -0.07), "left")
    inner = knee_left + np.array([0.085, 0, -0.05])
    name("flexor", inner, (-0.24, knee_left[2] - 0.13), "right")
    name("extensor", knee_left + np.array([-0.04, 0, 0]), (-0.26, knee_left[2]), "right")
    axes.set_aspect("equal", adjustable="box")
    axes.set(xlim=(-0.4, 0.48), ylim=(-0.14, top + 0.16))
