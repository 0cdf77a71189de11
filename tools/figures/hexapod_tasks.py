"""Figures of the hexapod's tasks: what is observed and paid, and the synergies."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from matplotlib.figure import Figure

from motorgrad.bodies import LEGS, TRIPODS, BodyBatch, BodyState, compile_model
from motorgrad.tasks import Hexapod, HexapodSynergy
from timsim import draw
from tools.figures._style import BLUE, FAINT, ORANGE, RED, panels

ALL = Hexapod(observes=("lateral", "current", "contact", "yaw", "course"), lag=2, course=50)
SECONDS = 4.0


def task() -> Figure:
    """What the task shows and pays along a walk on two synergies in turn."""
    decisions = round(SECONDS / ALL.period)
    states, body = _walked(decisions)

    def decide(memory: Any, state: BodyState) -> Any:
        memory, paid, _ = ALL.reward(memory, state, jnp.zeros(24))
        memory, seen = ALL.observe(memory, state, jnp.zeros(0))
        return memory, (seen, paid)

    memory, _ = ALL.observe(ALL.init(jnp.zeros(0)), body, jnp.zeros(0))
    _, (seen, paid) = jax.lax.scan(decide, memory, states)
    seen = np.asarray(seen)
    time = ALL.period * np.arange(1, decisions + 1)
    figure, (angles, feet, turning, reward) = panels(rows=4, height=5.6, sharex=True, height_ratios=[1.2, 1, 1, 1])
    angles.plot(time, seen[:, 6], color=BLUE, label='"current"')
    angles.plot(time, seen[:, 0], color=ORANGE, label=f'"lateral", lag {ALL.lag}')
    angles.set(ylabel="left front\nlateral angle / 30°", ylim=(-1.3, 1.3))
    for row, leg in enumerate(LEGS):
        colour = BLUE if leg in TRIPODS[0] else RED
        down = seen[:, 12 + row] > 0
        feet.fill_between(time, row, row + 0.8 * down, step="pre", color=colour, linewidth=0)
    feet.set(ylabel='"contact"', ylim=(6, -0.2), yticks=np.arange(6) + 0.4)
    feet.set_yticklabels([leg.replace("_", " ") for leg in LEGS], fontsize=6)
    turning.plot(time, seen[:, 18], color=BLUE, label='"yaw" (rad/s)')
    turning.plot(time, seen[:, 19], color=ORANGE, label=f'"course" (rad), of {ALL.course} decisions')
    reward.plot(time, paid, color="0.25", label='reward_type="heading"')
    reward.axhline(0.0, color="0.8", linewidth=0.8, zorder=0)
    reward.set(xlabel="time (s)", ylabel="reward", xlim=(0, SECONDS))
    for axes in (angles, turning, reward):
        axes.legend(loc="upper right", ncols=2)
        axes.set_ylim(top=axes.get_ylim()[1] + 0.25 * np.ptp(axes.get_ylim()))
    return figure


def _walked(decisions: int) -> tuple[BodyState, BodyState]:
    """The states after each decision, and the start, of a body whose tripods swing in turn, each for 0.24 s."""
    synergies = HexapodSynergy()
    batch = BodyBatch(ALL.body, 1, ALL.substeps)
    packed = []
    begin = jax.tree.map(lambda part: jnp.array(part[0]), batch.unpack(batch.packed.copy()))
    for decision in range(decisions):
        second = decision // 12 % 2
        batch.step(np.asarray(synergies.control(np.array([[1 - second, second, second, 1 - second]], np.float32))))
        packed.append(batch.packed[0].copy())
    return batch.unpack(np.stack(packed)), begin


def synergies() -> Figure:
    """The muscles that each of the four units drives, from above."""
    task = HexapodSynergy()
    model = compile_model(task.body)
    drives = task.drives
    assert drives is not None
    figure, axes = panels(4, height=2.1)
    names = [f"{phase}, {which} tripod" for which in ("first", "second") for phase in ("swing", "stance")]
    for unit, (panel, firing, name) in enumerate(zip(axes, drives, names, strict=True)):
        draw(panel, model, model.key(0).qpos, firing, elevation=-90.0, linewidth=1.4, ground=False)
        panel.set_aspect("equal", adjustable="box")
        panel.set(xlim=(-0.45, 0.45), ylim=(-0.42, 0.42))
        panel.set_title(f"{unit}: {name}", fontsize=7.5)
        panel.set_axis_off()
        for leg in TRIPODS[unit // 2]:
            x, y, _ = _foot(model, leg)
            panel.text(
                x, y + np.sign(y) * 0.06, leg.replace("_", " "), ha="center", va="center", fontsize=6, color=FAINT
            )
    return figure


def _foot(model: Any, leg: str) -> Any:
    data = mujoco.MjData(model)
    data.qpos[:] = model.key(0).qpos
    mujoco.mj_kinematics(model, data)
    return data.body(f"foot_{leg}").xpos
