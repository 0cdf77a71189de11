"""Figures of the tasks on a particle: regions, fields, paths, and how they are learned."""

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from motorgrad.plane import draw_paths, draw_regions, draw_reward, draw_units, trajectories
from motorgrad.policies import Policy
from motorgrad.tasks import FallingParticle, ParticleNavigation, ParticleOrbit, ParticleTask
from motorgrad.training import agent_for
from timsim import course_of
from tools.figures._style import BLUE, COLOURS, FAINT, GREEN, ORANGE, RED, band, level, over, panels
from tools.figures._work import Work

SEEDS = 20


def layouts() -> Figure:
    """The three layouts with paths of the untrained policy, and its units in the first."""
    figure, axes = panels(3, height=2.9, sharey=True)
    for panel, name in zip(axes, ("R1", "R2", "R3"), strict=True):
        task = FallingParticle(layout=name)
        draw_reward(panel, task)
        policy = _first(task)
        if name == "R1":
            draw_units(panel, policy, task.dynamics.forces)
        _paths(panel, task, policy, 6)
        panel.set_title(f'layout "{name}"')
    return figure


def falling_learning(work: Work) -> Figure:
    """Learning curves of three layouts, and a learned policy."""
    figure, (curve, one, two) = panels(3, height=2.9, width_ratios=[1.25, 1, 1])
    learned = {}
    for name, colour in zip(("R1", "R2", "R3"), COLOURS, strict=False):
        task = FallingParticle(layout=name)
        run = work.train(task, None, 49_000, SEEDS)
        decisions, rewards = run.curve()
        band(curve, decisions / 1000, rewards, colour, name)
        learned[name] = task, run.policy(0)
    curve.set(xlabel="thousand decisions", ylabel="mean reward", ylim=(None, 0.4))
    curve.legend(loc="lower right", ncols=3)
    for panel, name in ((one, "R1"), (two, "R2")):
        task, policy = learned[name]
        draw_reward(panel, task)
        draw_units(panel, policy, task.dynamics.forces)
        _paths(panel, task, policy, 10)
        panel.set_title(f"{name}, learned")
    return figure


def film(work: Work) -> Figure:
    """Four moments of the film of a learner."""
    task = FallingParticle()
    course = course_of(work.train(task, None, 49_000, SEEDS))
    figure, axes = panels(4, height=2.2)
    last = len(course.decision) - 1
    for panel, moment in zip(axes, (0, min(last, 3), last // 4, last), strict=True):
        policy = course.policy(moment)
        draw_reward(panel, task)
        draw_units(panel, policy, task.dynamics.forces)
        _paths(panel, task, policy, 8)
        panel.set_title(f"decision {course.decision[moment]:,}")
    return figure


def orbit() -> Figure:
    """The field, the unforced orbit, and paths into it from rest."""
    task = ParticleOrbit()
    figure, axes = panels(2, height=3.2, sharey=True)
    points = np.meshgrid(np.linspace(0.04, 0.96, 14), np.linspace(0.04, 0.96, 14))
    force = over(lambda place: jnp.stack(task.physics.field.force(*place)), *points)
    axes[0].quiver(*points, force[..., 0], force[..., 1], color=FAINT, width=0.005)
    still = ParticleOrbit(forces=((0.0, 0.0),))
    _paths(axes[1], still, _first(still), 5, 60)
    _paths(axes[1], task, _first(task), 1, 100, ORANGE)
    for panel, title in zip(axes, ("the field of force", "paths without pushes, and one with (orange)"), strict=True):
        for radius, line in ((task.physics.field.radius, ":"), (task.physics.orbit_radius, "--")):
            turn = np.linspace(0, 2 * np.pi, 100)
            panel.plot(0.5 + radius * np.cos(turn), 0.5 + radius * np.sin(turn), line, color=RED, linewidth=1.2)
        draw_regions(panel, (), task.physics.walls)
        panel.set_title(title)
    return figure


def orbit_learning(work: Work) -> Figure:
    """The radius over time for both rewards, and one path of each learned policy."""
    figure, (curve, wide, narrow) = panels(3, height=2.9, width_ratios=[1.25, 1, 1])
    for wanted, panel, colour in (("wide", wide, BLUE), ("narrow", narrow, RED)):
        task = ParticleOrbit(wanted=wanted)  # type: ignore[arg-type]
        run = work.train(task, None, 50_000, SEEDS)
        decisions, radius = run.curve("radius")
        band(curve, decisions / 1000, radius, colour, f'"{wanted}"')
        _paths(panel, task, run.policy(0), 1, 150, colour)
        draw_regions(panel, (), task.physics.walls)
        panel.set_title(f'"{wanted}", learned')
    level(curve, ParticleOrbit().physics.orbit_radius, "without pushes")
    curve.set(xlabel="thousand decisions", ylabel="mean radius", ylim=(0, 0.55))
    curve.legend(loc="center right", bbox_to_anchor=(1, 0.8))
    return figure


def navigation() -> Figure:
    """The goal, the obstacle, and paths of the untrained policy."""
    task = ParticleNavigation()
    figure, axes = panels(2, height=3.2, sharey=True)
    for panel in axes:
        draw_reward(panel, task)
    start = task.start
    axes[0].axvspan(*start.x, ymin=start.y[0], ymax=start.y[1], color=BLUE, alpha=0.12)
    axes[0].text(np.mean(start.x), 0.5, "start", ha="center", color=BLUE)
    axes[0].text(task.goal_region[1], task.goal_region[2] + 0.12, "goal", ha="center", color=GREEN)
    axes[0].set_title("goal and obstacle")
    _paths(axes[1], task, _first(task), 4, 60)
    axes[1].set_title("paths of the untrained policy")
    return figure


def navigation_learning(work: Work) -> Figure:
    """Decisions to the goal, and the flow that was learned."""
    task = ParticleNavigation()
    figure, (curve, flow) = panels(2, height=3.2)
    run = work.train(task, None, 100_000, SEEDS)
    decisions, arrival = run.curve("arrival")
    band(curve, decisions / 1000, np.nan_to_num(arrival, nan=float(task.time_limit)), BLUE, "")
    curve.set(xlabel="thousand decisions", ylabel="decisions to the goal", ylim=(0, None))
    draw_reward(flow, task)
    policy = run.policy(0)
    points = np.meshgrid(np.linspace(0.03, 0.97, 15), np.linspace(0.03, 0.97, 15))
    push = over(policy.prob, *points) @ np.array(task.dynamics.forces)
    flow.quiver(*points, push[..., 0], push[..., 1], color=FAINT, width=0.005)
    _paths(flow, task, policy, 8, 60)
    flow.set_title("mean push, and paths")
    return figure


def _first(task: ParticleTask) -> Policy:
    """The policy before learning."""
    policy = agent_for(task).policy
    return policy if isinstance(policy, Policy) else policy(jax.random.key(0))


def _paths(
    axes: Axes, task: ParticleTask, policy: Policy, count: int, decisions: int = 200, colour: str = "#26292e"
) -> None:
    draw_paths(axes, trajectories(task, policy, count, decisions=decisions), colour)
