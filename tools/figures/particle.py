"""Figures of the tasks on a particle: regions, fields, paths, and how they are learnt."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from motorgrad.policies import Policy
from motorgrad.tasks import FallingParticle, ParticleNavigation, ParticleOrbit, ParticleTask, Region, region_reward
from motorgrad.training import settings_for
from tools.figures._style import BLUE, COLOURS, FAINT, GREEN, ORANGE, RED, band, level, over, panels
from tools.figures._work import Work

SEEDS = 20
Units = Any  # of Gaussians


def layouts() -> Figure:
    """The three layouts with paths of the untrained policy, and its units in the first."""
    figure, axes = panels(3, height=2.9, sharey=True)
    for panel, name in zip(axes, ("R1", "R2", "R3"), strict=True):
        task = FallingParticle(layout=name)
        _regions(panel, task.places)
        policy = _first(task)
        _paths(panel, task, policy, 6, 40)
        if name == "R1":
            _ellipses(panel, task, policy)
        _box(panel, f'layout "{name}"')
    return figure


def falling_learning(work: Work) -> Figure:
    """Learning curves of three layouts, and a learnt policy."""
    figure, (curve, one, two) = panels(3, height=2.9, width_ratios=[1.25, 1, 1])
    learnt = {}
    for name, colour in zip(("R1", "R2", "R3"), COLOURS, strict=False):
        task = FallingParticle(layout=name)
        run = work.train(task, None, 49_000, SEEDS)
        decisions, rewards = run.curve()
        band(curve, decisions / 1000, rewards, colour, name)
        learnt[name] = task, run.policy(0)
    curve.set(xlabel="thousand decisions", ylabel="mean reward", ylim=(None, 0.4))
    curve.legend(loc="lower right", ncols=3)
    for panel, name in ((one, "R1"), (two, "R2")):
        task, policy = learnt[name]
        _regions(panel, task.places)
        _paths(panel, task, policy, 10, 40)
        _ellipses(panel, task, policy)
        _box(panel, f"{name}, learnt")
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
        _box(panel, title)
    return figure


def orbit_learning(work: Work) -> Figure:
    """The radius over time for both rewards, and one path of each learnt policy."""
    figure, (curve, wide, narrow) = panels(3, height=2.9, width_ratios=[1.25, 1, 1])
    for wanted, panel, colour in (("wide", wide, BLUE), ("narrow", narrow, RED)):
        task = ParticleOrbit(wanted=wanted)  # type: ignore[arg-type]
        run = work.train(task, None, 50_000, SEEDS)
        decisions, radius = run.curve("radius")
        band(curve, decisions / 1000, radius, colour, f'"{wanted}"')
        _paths(panel, task, run.policy(0), 1, 150, colour)
        _box(panel, f'"{wanted}", learnt')
    level(curve, ParticleOrbit().physics.orbit_radius, "without pushes")
    curve.set(xlabel="thousand decisions", ylabel="mean radius", ylim=(0, 0.55))
    curve.legend(loc="center right", bbox_to_anchor=(1, 0.8))
    return figure


def navigation() -> Figure:
    """The goal, the obstacle, and paths of the untrained policy."""
    task = ParticleNavigation()
    figure, axes = panels(2, height=3.2, sharey=True)
    for panel in axes:
        _regions(panel, task.obstacles)
        _goal(panel, task)
    start = task.start
    axes[0].axvspan(*start.x, ymin=start.y[0], ymax=start.y[1], color=BLUE, alpha=0.12)
    axes[0].text(np.mean(start.x), 0.5, "start", ha="center", color=BLUE)
    axes[0].text(task.goal[1], task.goal[2] + 0.12, "goal", ha="center", color=GREEN)
    _box(axes[0], "goal and obstacle")
    _paths(axes[1], task, _first(task), 4, 60)
    _box(axes[1], "paths of the untrained policy")
    return figure


def navigation_learning(work: Work) -> Figure:
    """Decisions to the goal, and the flow that was learnt."""
    task = ParticleNavigation()
    figure, (curve, flow) = panels(2, height=3.2)
    run = work.train(task, None, 100_000, SEEDS)
    decisions, arrival = run.curve("arrival")
    band(curve, decisions / 1000, np.nan_to_num(arrival, nan=float(task.time_limit)), BLUE, "")
    curve.set(xlabel="thousand decisions", ylabel="decisions to the goal", ylim=(0, None))
    _regions(flow, task.obstacles)
    policy = run.policy(0)
    points = np.meshgrid(np.linspace(0.03, 0.97, 15), np.linspace(0.03, 0.97, 15))
    push = over(policy.prob, *points) @ np.array(task.dynamics.forces)
    flow.quiver(*points, push[..., 0], push[..., 1], color=FAINT, width=0.005)
    _paths(flow, task, policy, 8, 60)
    _goal(flow, task)
    _box(flow, "mean push, and paths")
    return figure


def _first(task: ParticleTask) -> Policy:
    policy = settings_for(task).agent(task).policy
    assert isinstance(policy, Policy)
    return policy


def _paths(axes: Axes, task: ParticleTask, policy: Policy, count: int, decisions: int, colour: str = BLUE) -> None:
    """Paths from random starts, each until its episode ends."""
    world = task.dynamics
    keys = jax.random.split(jax.random.key(1), count)

    def decide(state: Any, key: jax.Array) -> Any:
        action = policy.sample(state.position, jax.random.uniform(key, (policy.uniforms,)))
        state = world.step(state, action, jnp.zeros(world.uniforms))
        ended = jnp.asarray(task.reward(task.init(jnp.zeros(0)), state, action)[2])
        return state, (state.position, ended)

    def one(key: jax.Array) -> Any:
        start, moves = jax.random.split(key)
        state = world.reset(jax.random.uniform(start, (world.reset_uniforms,)))
        _, (places, ended) = jax.lax.scan(decide, state, jax.random.split(moves, decisions))
        return jnp.concatenate([state.position[None], places]), ended

    tracks, ended = jax.jit(jax.vmap(one))(keys)
    for track, ends in zip(np.asarray(tracks), np.asarray(ended), strict=True):
        last = int(ends.argmax()) + 1 if ends.any() else decisions
        axes.plot(*track[: last + 1].T, ".-", color=colour, linewidth=0.8, markersize=2, alpha=0.8)


def _regions(axes: Axes, regions: tuple[Region, ...]) -> None:
    x, y = np.meshgrid(np.linspace(0, 1, 121), np.linspace(0, 1, 121))
    worth: Callable[[Any], Any] = lambda place: region_reward(regions, place)  # noqa: E731
    most = 1.05 * max(abs(region[0]) for region in regions)
    axes.contourf(x, y, over(worth, x, y), levels=np.linspace(-1, 1, 15) * most, cmap="RdYlGn", alpha=0.55)


def _ellipses(axes: Axes, task: ParticleTask, policy: Units) -> None:
    """The units, one deviation about each centre; the colour says whether they push to the left or to the right."""
    for place, width, force in zip(policy.centre, np.exp(policy.log_width), task.dynamics.forces, strict=True):
        colour = RED if force[0] < 0 else "black"
        axes.add_patch(
            Ellipse((float(place[0]), float(place[1])), *(2 * width), fill=False, color=colour, linewidth=0.9)
        )


def _goal(axes: Axes, task: ParticleNavigation) -> None:
    _, x, y, *widths = task.goal
    axes.add_patch(Ellipse((x, y), *(2 * np.array(widths)), color=GREEN, alpha=0.6))


def _box(axes: Axes, title: str) -> None:
    axes.set(title=title, xlim=(0, 1), ylim=(0, 1), aspect="equal", xticks=(0, 0.5, 1), yticks=(0, 0.5, 1))
    for spine in axes.spines.values():
        spine.set_visible(True)
