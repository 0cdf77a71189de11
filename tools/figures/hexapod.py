"""Figures of the hexapod: its body, its muscles, its fixed controller, and the ground that it walks on."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from typing import Any

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from motorgrad.bodies import Hexapod, OnTerrain, Terrain, TripodController, biomimetic_hexapod, compile_model, walk
from motorgrad_thesis.chapter_5.hexapod._drawing import TOUCH, draw_angles, draw_contacts, draw_states, draw_view
from timsim import draw
from tools.figures._style import EXTENSOR, FAINT, FLEXOR, panels

WALKER = Hexapod(drive="servos")
TERRAIN_KINDS = ("bumps", "slopes", "steps", "waves")


def body() -> Figure:
    """Both bodies from the side and from above, with the parts of one leg named."""
    figure, axes = panels(2, rows=2, height=4.3, height_ratios=[1, 2.3])
    for column, (title, hexapod) in zip(
        axes.T, (("Hexapod()", Hexapod()), ("biomimetic_hexapod()", biomimetic_hexapod())), strict=True
    ):
        for axes_, view, span in zip(column, ("side", "above"), ((-0.06, 0.30), (-0.45, 0.45)), strict=True):
            draw_view(axes_, hexapod, view)
            axes_.set(xlim=(-0.72, 0.72), ylim=span)
        column[0].set_title(title, family="monospace")
    _names(axes[1, 0])
    return figure


def _names(axes: Axes) -> None:
    """Name the parts of the legs, seen from above, and their muscles."""
    style = {"arrowstyle": "-", "color": FAINT, "linewidth": 0.8, "shrinkB": 1}
    for words, at, beside, side in (
        ("foot", (0.26, 0.37), (0.42, 0.41), "left"),
        ("femur", (0.263, 0.31), (0.42, 0.34), "left"),
        ("coxa", (0.265, 0.19), (0.42, 0.27), "left"),
        ("protractor", (0.315, 0.175), (0.42, 0.2), "left"),
        ("levator over\ndepressor", (-0.265, 0.27), (-0.42, 0.34), "right"),
        ("retractor", (-0.315, 0.175), (-0.42, 0.2), "right"),
        ("spine joint", (0.13, 0.0), (0.13, -0.42), "center"),
    ):
        axes.annotate(words, at, beside, arrowprops=style, ha=side, va="center", fontsize=7, color="0.2")


def muscles() -> Figure:
    """The torque of each active muscle of a leg at each angle of its joint."""
    hexapod = Hexapod()
    model = compile_model(hexapod)
    (figure, axes) = panels(2, height=2.7)
    for panel, freedom, pair in (
        (axes[0], "lateral", (("protractor", FLEXOR), ("retractor", EXTENSOR))),
        (axes[1], "vertical", (("levator", FLEXOR), ("depressor", EXTENSOR))),
    ):
        least, greatest = getattr(hexapod.middle.leg, freedom).range
        angle = np.linspace(least, greatest, 120)
        for kind, colour in pair:
            torque = [_torque(model, f"{freedom}_left_middle", f"{kind}_left_middle", np.radians(a)) for a in angle]
            panel.plot(angle, torque, color=colour, label=kind)
        panel.axhline(0.0, color="0.8", linewidth=0.8, zorder=0)
        panel.set(ylabel="torque (N m)", title=f"{freedom} joint")
        panel.legend(loc="center right")
    axes[0].set_xlabel("lateral angle (°), positive forward")
    axes[1].set_xlabel("vertical angle (°), positive up")
    return figure


def _torque(model: mujoco.MjModel, joint: str, muscle: str, angle: float) -> float:
    """What one active muscle does to a joint at rest at an angle in rad, N m."""
    data = mujoco.MjData(model)
    data.qpos[:] = model.key(0).qpos
    data.joint(joint).qpos[0] = angle
    data.ctrl[model.actuator(muscle).id] = 1.0
    mujoco.mj_forward(model, data)
    return float(data.qfrc_actuator[model.joint(joint).dofadr[0]])


def controller() -> Figure:
    """Two seconds of a walk: the states of the legs, the tripods' angles, and the feet on the ground."""
    found = walk(WALKER, seconds=4.0)
    part = found.time > 2.0
    time = found.time[part] - 2.0
    figure, (states, angles, contacts) = panels(rows=3, height=5.0, sharex=True, height_ratios=[1.2, 1, 0.9])
    draw_states(states, time, found.states[part, 0])
    draw_angles(angles, time, found.reading.lateral[part, 0])
    for limit in (TripodController().back, TripodController().forward):
        angles.axhline(limit, color="0.6", linewidth=0.8, linestyle=":")
    draw_contacts(contacts, time, found.reading.contact[part, 0])
    contacts.set(xlabel="time (s)", xlim=(0, 2), title=f"feet on the ground, with more than {TOUCH:g} N")
    return figure


def terrain() -> Figure:
    """Each kind of ground from above, and a hexapod that has walked onto it."""
    figure, axes = panels(4, rows=2, height=3.6, height_ratios=[1.6, 1])
    grounds = [Terrain(kind, height=0.16) for kind in TERRAIN_KINDS]
    found = walk([OnTerrain(WALKER, ground) for ground in grounds], seconds=6.0)
    shown: Any = None
    for row, (above, beside, ground) in enumerate(zip(*axes, grounds, strict=True)):
        (x, y) = ground.axes
        heights = ground.heights()
        extent = (x[0], x[-1], y[0], y[-1])
        near = heights[abs(y) < 4][:, abs(x) < 4]
        shown = above.imshow(
            heights - near.min(), extent=extent, origin="lower", vmin=0.0, vmax=0.16, interpolation="bilinear"
        )
        path = found.reading.position[:, row]
        above.plot(path[:, 0], path[:, 1], color="white", linewidth=1.2)
        above.set(xlim=(-1, 4), ylim=(-2.5, 2.5), title=f'"{ground.kind}"', xticks=[0, 2, 4], yticks=[-2, 0, 2])
        above.set_yticklabels([] if row else ["−2", "0", "2"])
        model = found.models[row]
        draw(beside, model, found.posture[-1, row], np.zeros(model.nu), linewidth=1)
        middle = path[-1]
        beside.set_aspect("equal", adjustable="box")
        beside.set(xlim=(middle[0] - 0.65, middle[0] + 0.65), ylim=(middle[2] - 0.45, middle[2] + 0.3))
        beside.set_axis_off()
    axes[0, 0].set(ylabel="y (m)")
    for above in axes[0]:
        above.set_xlabel("x (m)")
    figure.colorbar(shown, ax=list(axes[0]), label="height (m)", pad=0.01)
    return figure
