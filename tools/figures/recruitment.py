"""Figures of motoneuron recruitment: the linear mapping, and how the arm's task is learned."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from motorgrad.tasks import ArmRecruitment, LinearRecruitment
from tools.figures._style import BLUE, COLOURS, FAINT, RED, band, panels
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
