"""Figures of the hopper's task: how a hop is paid, how hopping is learned, and what changes."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import motorgrad as mg
from motorgrad.bodies import BodyState, compile_model
from motorgrad.tasks import Hopper
from motorgrad.training import Evaluation, learning_curves
from motorgrad_thesis.chapter_5.figure_5_3 import behaviour_of, draw_behaviour
from timsim import draw
from tools.figures._style import BLUE, EXTENSOR, FLEXOR, ORANGE, band, panels
from tools.figures._work import Work

TASK = Hopper()
SEEDS = 12
STEPS = 120_000
SECONDS = 1.6


def practised(work: Work) -> mg.Run:
    """Hoppers that have practised for 1,200 simulated seconds with the learner that goes with the task."""
    return work.train(TASK, None, STEPS, SEEDS, keep="hopper")


def watched(work: Work, run: mg.Run, untrained: bool = False) -> Evaluation:
    """The frozen policies for ten simulated seconds."""
    return mg.evaluate(run, min(1000, work.most), untrained=untrained)


def middle(run: mg.Run, outcome: Evaluation) -> int:
    """The place of the seed in the middle, not the best: a figure should show what to expect."""
    order = np.argsort(np.nan_to_num(outcome.metrics["apex"]), kind="stable")
    return int(order[len(order) // 2])


def rewards(task: Hopper, sensors: dict[str, np.ndarray], firing: np.ndarray) -> np.ndarray:
    """What the task pays for one seed's recorded decisions."""

    def step(memory: Any, seen: tuple[dict[str, Any], Any]) -> tuple[Any, Any]:
        sensed, action = seen
        memory, reward, _ = task.reward(memory, BodyState(None, None, sensed), action)
        return memory, reward

    return np.asarray(jax.lax.scan(step, task.init(jnp.zeros(0)), (sensors, firing))[1])


def task(work: Work) -> Figure:
    """Two hops: the body, its foot's height, its muscles, and what both ways of paying give for them."""
    run = practised(work)
    outcome = watched(work, run)
    row = middle(run, outcome)
    part = outcome.time > outcome.time[-1] - SECONDS
    assert outcome.sensors is not None
    assert outcome.position is not None
    assert outcome.control is not None
    time = outcome.time[part] - outcome.time[part][0]
    sensors = {name: values[row] for name, values in outcome.sensors.items()}
    firing = outcome.control[row]

    figure, (body, height, paid) = panels(rows=3, height=5.4, sharex=True, height_ratios=[2, 1, 1])
    model = compile_model(TASK.body.spec())
    _sequence(body, model, outcome.position[row, part], firing[part], time)
    height.plot(time, sensors["foot_height"][part], color="0.25")
    for name, unit, colour in (("flexor", 0, FLEXOR), ("extensor", 1, EXTENSOR)):
        base = -0.12 - 0.12 * unit
        height.fill_between(time, base, base + 0.09 * firing[part, unit], step="mid", color=colour, linewidth=0)
        height.text(time[-1] * 1.005, base + 0.045, name, color=colour, va="center", fontsize=7)
    height.set(ylabel="foot height (m)")
    for name, colour, offset in (("landing", BLUE, -0.004), ("apex", ORANGE, 0.004)):
        got = rewards(dataclasses.replace(TASK, reward_type=name), sensors, firing)[part]
        paid.vlines(time + offset, 0, got, color=colour, label=f'reward_type="{name}"')
    paid.set(xlabel="time (s)", ylabel="reward", xlim=(0, time[-1]))
    paid.legend(loc="upper left", ncols=2)
    paid.set_ylim(top=1.25 * paid.get_ylim()[1])
    return figure


def _sequence(axes: Any, model: Any, position: np.ndarray, firing: np.ndarray, time: np.ndarray) -> None:
    """The body at eight instants, from left to right."""
    shown = np.linspace(0, len(time) - 1, 8).astype(int)
    axes.set_axis_off()
    groups = [0, 1] * (model.nu // 2)  # flexor and extensor of the left knee, then of the right
    for place in shown:
        share = time[place] / time[-1]
        inset = axes.inset_axes((share * 0.88, 0, 0.12, 1))
        draw(inset, model, position[place], firing[place, groups], linewidth=1.3)
        inset.set_aspect("equal", adjustable="box")
        inset.set(xlim=(-0.3, 0.3), ylim=(-0.1, 1.8))
        inset.set_axis_off()


def learning(work: Work) -> Figure:
    """The height of hops during practice."""
    run = practised(work)
    smooth = max(20.0, 2 * run.config["run"]["window"] * TASK.period)
    (curve,) = learning_curves([run], "apex", smooth=smooth).curves
    figure, axes = panels(height=3.2)
    axes.plot(curve.x, curve.values.T, color=BLUE, alpha=0.2, linewidth=0.5)
    band(axes, curve.x, np.nan_to_num(curve.values), BLUE, f"median and quartiles of {SEEDS} seeds")
    axes.set(xlabel="simulated time (s)", ylabel=f"height of hops (m), mean over {smooth:g} s", ylim=(0, None))
    axes.legend(loc="lower right")
    return figure


def behaviour(work: Work) -> Figure:
    """Knee, foot and muscles before and after."""
    run = practised(work)
    before = watched(work, run, untrained=True)
    after = watched(work, run)
    return draw_behaviour(behaviour_of(run, before, after, run.seeds[middle(run, after)]))
