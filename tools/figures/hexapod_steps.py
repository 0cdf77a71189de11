"""Figures of the hexapod's clock and of its steps: what a task on slopes shows, and what a primitive does."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from motorgrad.bodies import LEGS, TRIPODS, read_hexapod
from motorgrad.policies import GradedHyperplanes, Hyperplanes, Primitives
from motorgrad.tasks import HexapodPrimitive, HexapodStride
from tools.figures._style import BLUE, FAINT, ORANGE, RED, panels

PARTS = ("levator", "retractor")  # which muscles tell swing and stance
SECONDS = 6.0


def stride() -> Figure:
    """The ground, what is felt of it, the clock and the speed, while the frequency is raised."""
    task = HexapodStride(stretch=1.5)
    random = np.random.default_rng(3)
    decisions = round(SECONDS / task.period)
    frequency = np.repeat(np.linspace(0.0, 0.9, 4), decisions // 4)
    records = _lived(task, frequency[:, None], random.random(decisions + 1), 0.0)
    figure, (ground, clock, speed) = panels(rows=3, height=4.4, sharex=True)
    time = task.period * np.arange(1, decisions + 1)
    ground.plot(time, np.degrees(records["slope"]), color=FAINT, label="slope, degrees")
    ground.plot(time, task.pitch_scale * records["seen"][:, 0], color=BLUE, label="smoothed pitch, degrees")
    _feet(clock, time, records, task.body.groups)
    speed.plot(time, records["speed"], color="0.25", linewidth=0.8, label="speed, m/s")
    speed.plot(time, 10 * records["period"], color=ORANGE, label="period, tenths of a second")
    speed.set(xlabel="time (s)", xlim=(0, SECONDS))
    for axes in (ground, speed):
        axes.legend(loc="upper right", ncols=2)
        axes.set_ylim(top=axes.get_ylim()[1] + 0.35 * np.ptp(axes.get_ylim()))
    return figure


def primitive() -> Figure:
    """Steps of both tripods that begin at random, and last as long as is drawn; and the lateral angles meanwhile."""
    task = HexapodPrimitive()
    random = np.random.default_rng(1)
    decisions = 150
    actions = np.concatenate([random.random((decisions, 2)) < 0.15, random.normal(0, 0.4, (decisions, 4))], axis=1)
    records = _lived(task, actions * 1.0, np.zeros((decisions + 1, 0)), None)
    figure, (steps, angles) = panels(rows=2, height=3.4, sharex=True)
    time = task.period * np.arange(1, decisions + 1)
    _feet(steps, time, records, task.body.groups)
    for tripod, colour in zip(TRIPODS, (BLUE, RED), strict=True):
        members = [2 + LEGS.index(leg) for leg in tripod]
        angles.plot(time, 30.0 * records["seen"][:, members].mean(1), color=colour)
    angles.set(xlabel="time (s)", ylabel="mean lateral\nangle, degrees", xlim=(0, time[-1]))
    return figure


def primitives_policy() -> Figure:
    """When a primitive begins over one input, and how long its part lasts, for a unit each."""
    y = np.linspace(-1, 1, 201)
    movement = GradedHyperplanes(weights=[[0.4]], bias=[-0.2], log_deviation=np.log([0.2]))
    policy = Primitives(Hyperplanes(weights=[[-5.0]], bias=[-1.0]), movement)
    figure, (begins, moves) = panels(2)
    for ready, colour, label in ((1.0, BLUE, "can begin"), (0.0, FAINT, "cannot, such as while under way")):
        seen = jnp.stack([jnp.full(len(y), ready), jnp.asarray(y)], axis=1)
        begins.plot(y, jax.vmap(policy.prob)(seen)[:, 0], color=colour, label=label)
    begins.set(title="probability that it begins", xlabel="input $y$", ylim=(-0.03, 1.2))
    begins.legend(loc="upper right")
    uniforms = jnp.asarray(np.random.default_rng(0).random((400, policy.uniforms)))
    where = jnp.asarray(np.random.default_rng(1).uniform(-1, 1, 400))
    drawn = jax.vmap(policy.sample)(jnp.stack([jnp.ones(400), where], axis=1), uniforms)
    begun = np.asarray(drawn[:, 0]) > 0
    spread = float(policy.movement.deviation[0])
    mean = 0.4 * y - 0.2
    moves.fill_between(y, mean - spread, mean + spread, color=ORANGE, alpha=0.2, linewidth=0)
    moves.plot(y, mean, color=ORANGE, label="mean, and one deviation")
    moves.plot(where[begun], drawn[begun, 1], ".", color=BLUE, markersize=3, label="where it began")
    moves.set(title="its movement parameter", xlabel="input $y$")
    moves.legend(loc="lower right")
    return figure


def _lived(task: Any, actions: np.ndarray, numbers: np.ndarray, start: float | None) -> dict[str, np.ndarray]:
    """What one body remembers, observes and does under these actions."""
    batch = task.batch([0], 1)
    state = jax.tree.map(lambda part: jnp.array(part[0]), batch.unpack(batch.packed.copy()))
    memory, _ = task.observe(
        task.init(jnp.zeros(0) if start is None else jnp.array([start])), state, jnp.atleast_1d(numbers[0])
    )
    records: dict[str, list[Any]] = {name: [] for name in ("fires", "speed", "seen", "slope", "period")}
    for action, number in zip(jnp.asarray(actions), numbers[1:], strict=True):
        control = np.asarray(task.control(action, memory))
        batch.step(control[None])
        state = jax.tree.map(lambda part: jnp.array(part[0]), batch.unpack(batch.packed.copy()))
        memory, *_ = task.reward(memory, state, action)
        memory, seen = task.observe(memory, state, jnp.atleast_1d(number))
        records["fires"].append(control)
        records["seen"].append(np.asarray(seen))
        records["speed"].append(float(read_hexapod(state).speed))
        for name in ("slope", "period"):
            records[name].append(float(getattr(memory, name, 0.0)))
    return {name: np.array(values) for name, values in records.items()}


def _feet(axes: Any, time: np.ndarray, records: dict[str, np.ndarray], groups: Any) -> None:
    """When each tripod swings (above) and stands on its way back (below)."""
    for tripod, colour in zip(range(2), (BLUE, RED), strict=True):
        for row, muscle in enumerate(PARTS):
            fires = records["fires"][:, list(groups).index(f"{muscle}_{TRIPODS[tripod][0]}")]
            place = 2 * tripod + row
            axes.fill_between(time, place, place + 0.8 * fires, step="pre", color=colour, linewidth=0)
    axes.set(ylim=(4, -0.2), yticks=np.arange(4) + 0.4)
    axes.set_yticklabels([f"{which} {part}" for which in ("first", "second") for part in ("swings", "pushes")])
