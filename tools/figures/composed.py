"""Figures of foreign bodies and composed tasks: arms, and one that learns to reach."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

import motorgrad as mg
from motorgrad.benchmarks._arm18 import arm18
from motorgrad.tasks import Composed, terms
from timsim import draw
from tools.figures._style import BLUE, FAINT, GREEN, band, panels
from tools.figures._work import Work

SEEDS = 8
STEPS = 60_000
SHOWN = 12  # movements


def reach() -> Composed:
    """The task of the page on bringing a body."""
    return mg.tasks.compose(
        "arm6",
        targets=[terms.Reach("hand", low=(0.0, 0.25, 0.0), high=(0.3, 0.45, 0.0))],
        observe=["joint-positions", "joint-velocities", "target", "target-error"],
        reward=[terms.Distance(), terms.Closeness(width=0.05), terms.Effort(weight=-0.05)],
        reset=[terms.RandomJoints(share=0.5)],
        metrics=["distance", terms.Within(tolerance=0.03, name="solved")],
        actions="binary",
        time_limit=2.0,
    )


def learning(work: Work) -> Figure:
    """The learning curve, and the hand on its way to fresh targets."""
    task = reach()
    run = work.train(task, None, STEPS, SEEDS, "composed-reach")
    decisions, solved = run.curve("solved")
    figure, (left, right) = panels(2, height=3.0, width_ratios=(1.25, 1))
    band(left, decisions / 1000, 100 * solved, BLUE, f"median and quartiles of {SEEDS} seeds")
    left.set(xlabel="thousand decisions (of 20 ms)", ylabel="decisions within 3 cm (%)", ylim=(0, 100))
    left.legend(loc="lower right")
    episode = int(task.episode_limit or 0)
    anatomy = mg.bodies.Anatomy(task.dynamics)
    name = anatomy.sensor("FRAMEPOS", "SITE", "hand")
    found: Any = mg.evaluate(run, SHOWN * episode, mode="mode")
    hand = found.sensors[name][0, :, :2].reshape(SHOWN, episode, 2)
    for way in hand:
        right.plot(*way.T, color=BLUE, linewidth=0.8)
        right.plot(*way[0], "o", color=FAINT, markersize=3)
        right.plot(*way[-1], "o", color=GREEN, markersize=4)
    right.plot([0.0, 0.3, 0.3, 0.0, 0.0], [0.25, 0.25, 0.45, 0.45, 0.25], color="0.6", linewidth=0.9, linestyle="--")
    right.plot(0, 0, "s", color="0.2", markersize=5)
    right.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title="12 movements of 2 s of the first seed")
    assert np.isfinite(hand).all()
    return figure


def forces(work: Work) -> Figure:
    """The muscle forces of an arm that has learned, over a reach, at every physics step."""
    run = work.train("composed", mg.presets.natural("composed", 20_000), 20_000, 1, "composed-graded")
    table = mg.rollout(run, seconds=1.0, mode="mode", every="step")
    figure, panel = panels(1, height=3.0)
    panel.plot(table["time"], table["muscle force"], label=table.names("muscle force"))
    panel.set(xlabel="time (s)", ylabel="muscle force (N)")
    panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def arm() -> Figure:
    """The arm of six muscles, from above, and one of 18, from the side."""
    figure, axes = panels(3, height=2.5)
    flat = mg.bodies.Mjcf("arm6").model
    large = arm18().model
    none = np.zeros(flat.nu)
    flexors = np.array([1.0, 0.0] * 3)
    for panel, pose, active, title in (
        (axes[0], (0.2, 0.4), none, "six muscles, at rest"),
        (axes[1], (1.2, 1.6), flexors, "its flexors active"),
    ):
        draw(panel, flat, np.array(pose), active, elevation=-90.0, linewidth=1.6, ground=False)
        panel.set_title(title)
    draw(axes[2], large, np.array((0.9, 0.3, 0.0, 1.2, 0.0)), np.eye(large.nu)[8], linewidth=1.2, ground=False)
    axes[2].set_title("18 muscles, made in Python")
    for panel in axes:
        panel.set_axis_off()
    return figure
