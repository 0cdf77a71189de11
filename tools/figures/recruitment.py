"""Figures of motoneuron recruitment: the mapping, the arm, its lift, and how both tasks are learnt."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from typing import Any

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from motorgrad.bodies import Arm, compile_model
from motorgrad.sim import draw
from motorgrad.tasks import ArmRecruitment, LinearRecruitment
from tools.figures._style import BLUE, COLOURS, FAINT, GREEN, ORANGE, RED, band, level, panels
from tools.figures._work import Work

SEEDS = 16


def mapping() -> Figure:
    """The wanted force, and what pools with ideal thresholds make of it."""
    figure, axes = panels(2, height=2.9, sharey=True)
    loads = np.linspace(0, 1, 1001)
    pools = (
        (LinearRecruitment(units=4, output="ratio"), "four equal units"),
        (
            LinearRecruitment(units=4, output="ratio", size_ratio=8.0),
            "four units, the largest eight times the smallest",
        ),
    )
    for panel, (task, title) in zip(axes, pools, strict=True):
        thresholds = task.ideal_thresholds()
        force = (task.sizes * (loads[:, None] > thresholds)).sum(1)
        panel.plot(loads, task.target(loads), color=FAINT, linestyle="--", label="wanted, $1.2 x - 0.1$")
        panel.plot(loads, force, color=BLUE, label="pool with ideal thresholds")
        panel.plot(thresholds, np.zeros(task.units), "^", color=RED, clip_on=False, label="thresholds", zorder=3)
        panel.set(title=title, xlabel="load $x$", xlim=(0, 1), ylim=(-0.12, 1.12))
    axes[0].set_ylabel("force, of the whole pool's")
    axes[0].legend(loc="upper left")
    return figure


def arm() -> Figure:
    """The arm at three angles, and what its muscle and its weight can do at each."""
    body = Arm(load=8.0)
    figure, axes = panels(2, height=4.6, rows=2, height_ratios=[1.5, 1])
    for each in axes[0]:
        each.remove()
    model = compile_model(body)
    for place, share in enumerate((0.0, 0.5, 1.0)):
        panel = figure.add_subplot(axes[0, 0].get_gridspec()[0, :])
        panel.set_axis_off()
        inset = panel.inset_axes((place / 3, 0, 0.33, 0.92))
        flexion = share * body.most_flexion
        draw(inset, model, np.array([flexion]), np.array([float(place > 0)]), linewidth=3, ground=False)
        inset.set_aspect("equal", adjustable="box")
        inset.set(xlim=(-0.52, 0.2), ylim=(0.18, 0.72), title=f"interior angle {90 - np.rad2deg(flexion):.0f}°")
        inset.set_axis_off()
        if place == 0:
            for words, at, side in (
                ("harness", (-0.33, 0.6), "right"), ("flexor", (-0.14, 0.46), "center"), ("load", (0.1, 0.3), "left"),
            ):  # fmt: skip
                inset.text(*at, words, ha=side, fontsize=8, color="0.2")
    angle = np.linspace(0.0, body.most_flexion, 200)
    interior = 90 - np.rad2deg(angle)
    arms, force = axes[1]
    arms.plot(interior, 100 * np.asarray(body.moment_arm(angle)), color=BLUE, label="of the muscle")
    arms.plot(interior, 100 * body.bone_length * np.sin(angle), color=RED, label="of the load")
    arms.set(xlabel="interior angle (°)", ylabel="moment arm (cm)", ylim=(0, 31))
    for name, law, colour in (
        ("holds it there", body.balance, ORANGE),
        ("throws it there from rest", body.throw, GREEN),
    ):
        force.plot(interior[1:], np.asarray(law(angle[1:])), color=colour, label=name)
    level(force, body.strength, "full activation")
    force.set(xlabel="interior angle (°)", ylabel="force (N)", ylim=(0, 195), title="for a load of 8 kg", xlim=(90, 20))
    arms.set_xlim(90, 20)
    for panel in (arms, force):
        panel.legend(loc="lower right" if panel is force else "upper left", fontsize=7)
    return figure


def height() -> Figure:
    """The height function, the reward, and the best activation."""
    task = ArmRecruitment()
    loads, active = np.linspace(0.01, 14, 281), np.linspace(0, 1, 301)
    ratio = jnp.asarray(active)[:, None]
    lifted = task.effect(jnp.asarray(loads)[None], ratio)
    paid = np.asarray(task.pay(jnp.asarray(loads)[None], ratio, lifted))
    best = active[paid.argmax(0)]
    figure, axes = panels(2, height=3.1, sharey=True)
    shown: Any = None
    for panel, values, title in zip(axes, (np.asarray(lifted), paid), ("height $H$", "reward $H - C$"), strict=True):
        shown = panel.contourf(loads, active, values, levels=np.arange(-4.0, 10.1, 1.0), cmap="viridis")
        panel.plot(loads, best, color="white", linewidth=2.5)
        panel.plot(loads, best, color=RED, linewidth=1.2, label="best activation")
        panel.set(title=title, xlabel="load (kg)")
    axes[0].set_ylabel("activation")
    axes[1].legend(loc="upper left", labelcolor="white")
    figure.colorbar(shown, ax=axes)
    return figure


def linear_learning(work: Work) -> Figure:
    """Pools of two and of four, by count; the ratio form beside the smaller one."""
    figure, axes = panels(height=3.0)
    four, two, slow = LinearRecruitment(), LinearRecruitment(units=2), LinearRecruitment(units=2, output="ratio")
    for task, colour in zip((two, four, slow), COLOURS, strict=False):
        decisions, error = work.train(task, None, 6_000_000, SEEDS).curve("error")
        band(axes, decisions / 1e6, error, colour, f"{task.units} units, {task.output}")
    for task in (two, four):
        level(axes, _least_error(task), f"{task.units} ideal units")
    axes.set(xlabel="million decisions", ylabel="mean error of the force, of the pool's", ylim=(0, None))
    axes.legend(loc="upper right", bbox_to_anchor=(1, 0.9))
    return figure


def _least_error(task: LinearRecruitment) -> float:
    loads = np.linspace(0, 1, 10_001)
    force = (task.sizes * (loads[:, None] > task.ideal_thresholds())).sum(1)
    return float(np.abs(force - task.target(loads)).mean())


def arm_learning(work: Work) -> Figure:
    """Pools of two to four on the arm, and the best that each can earn."""
    figure, axes = panels(height=3.0)
    for units, colour in zip((2, 3, 4), COLOURS, strict=False):
        task = ArmRecruitment(units=units)
        decisions, reward = work.train(task, None, 400_000, SEEDS).curve()
        band(axes, decisions / 1000, reward, colour, f"{units} units")
        axes.axhline(_best_reward(task), color=colour, linewidth=0.9, linestyle=(0, (5, 3)))
    axes.set(xlabel="thousand decisions", ylabel="mean reward", xlim=(0, None), ylim=(3.5, 6.8))
    axes.legend(loc="lower right")
    return figure


def _best_reward(task: ArmRecruitment) -> float:
    """What the best number of units at each load earns, over the loads of a sweep."""
    loads: Any = jnp.arange(task.low, task.high, 0.01)[None]
    ratio = jnp.linspace(0, 1, task.units + 1)[:, None]
    return float(np.asarray(task.pay(loads, ratio, task.effect(loads, ratio))).max(0).mean())
