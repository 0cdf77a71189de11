"""The learning curves of the streaming table, from its stored runs."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tools.figures._style import BLUE, GREEN, ORANGE, PINK, RED, SKY, level, panels
from tools.streaming import OURS, PEERS, POINTS, TASKS, stored

LINE_STYLES = {
    "own": (SKY, "-"),
    "olgarb": (SKY, "-"),
    "olgarb-normalized": (SKY, ":"),
    "olgarb-natural": (BLUE, "-"),
    "actor-critic": (BLUE, ":"),
    "natural": (GREEN, "-"),
    "stream-ac": (ORANGE, "-"),
    "intentional-ac": (PINK, "-"),
    "avg": (RED, "-"),
    "ppo": ("0.2", "-"),
    "a2c": ("0.2", "--"),
    "sac": ("0.2", ":"),
    "mushroom": ("0.2", "-."),
}
"""Colour and line of every learner; peers are grey."""
BODIES = ("hopper", "hexapod-synergy", "hexapod")


def bodies() -> Figure:
    """The hopper and both hexapods."""
    return _figure(BODIES, 1, 3)


def gymnasium() -> Figure:
    """Gymnasium's tasks."""
    return _figure([task for task in TASKS if task not in BODIES], 2, 3)


def _figure(tasks: tuple[str, ...] | list[str], rows: int, columns: int) -> Figure:
    """Tasks side by side, with one key for all."""
    figure, axes = panels(columns, 0.4 + 2.5 * rows, rows, squeeze=False)
    for panel, task in zip(axes.flat, tasks, strict=False):
        _curves(panel, task)
    named = {label: line for panel in axes.flat for line, label in zip(*panel.get_legend_handles_labels(), strict=True)}
    names = [name for name in (*OURS, *PEERS) if name in named]
    spare = axes.flat[len(tasks) :]
    for panel in spare:
        panel.set_axis_off()
    where: dict[str, Any] = {"loc": "center"} if len(spare) else {"loc": "outside upper center", "ncols": 6}
    (spare[0] if len(spare) else figure).legend([named[name] for name in names], names, **where)
    return figure


def _curves(axes: Axes, name: str) -> None:
    """Every learner on a task: median of the seeds and quartiles, or the one seed."""
    task = TASKS[name]
    x = (np.arange(POINTS) + 0.5) * task.steps / POINTS / 1000
    for run in stored(name):
        # no apex is no hop, of 0 m
        values = np.array(run["curve"], float)
        values = np.nan_to_num(values) if task.reading == "apex" else values
        colour, line = LINE_STYLES[run["learner"]]
        with np.errstate(all="ignore"):
            low, middle, high = np.nanpercentile(values, [25, 50, 75], axis=0)
        axes.fill_between(x, low, high, color=colour, alpha=0.12, linewidth=0)
        axes.plot(x, middle, line, color=colour, linewidth=1.3, label=run["learner"])
    if task.goal is not None:
        level(axes, task.goal, "")
    if name == "inverted-double-pendulum":  # returns of two orders of magnitude
        axes.set_yscale("log")
    axes.set(title=task.env_id.removeprefix("motorgrad/"), xlabel="thousand decisions", ylabel=task.label)
