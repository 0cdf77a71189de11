"""OLGARB with local units on the falling particle, beside a hand-written compiled loop of it."""

import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from motorgrad.benchmarks._beside_loop import loop_row
from motorgrad.benchmarks._measure import Row
from motorgrad.benchmarks._particle_loop import particle_loop
from motorgrad.policies import LocalGaussians
from motorgrad.tasks import FallingParticle
from motorgrad.training import settings_for, stepper_of

EPISODE = 24.5  # decisions on average, of the learner as it begins


def particle_row(seeds: int, decisions: int, pairs: int = 5, wanted: str = "") -> Row:
    """Updates per second in total of eight local units, against the loop's on one core."""
    task = FallingParticle()
    name = f"particle with {task.units} local units, OLGARB"
    return loop_row(name, task, hand_written(task), seeds, decisions, pairs, wanted)


def hand_written(task: FallingParticle, seed: int = 1) -> Callable[[int], tuple[np.ndarray, np.ndarray, Any]]:
    """The compiled loop for the task as it stands, from the same first policy at the same rates."""
    settings = settings_for(task)
    units = settings.agent(task).policy
    assert isinstance(units, LocalGaussians)
    assert settings.rates is not None
    assert units.log_width_limits is not None
    centre, log_width = (np.array(part, np.float32) for part in (units.centre, units.log_width))
    forces = np.array(task.dynamics.forces, np.float32)[:, 0].copy()
    regions = np.array(task.places, np.float32)
    physics, single = task.physics, np.float32
    parts = (physics.timestep, physics.gravity[1], physics.drag, physics.walls.restitution, physics.walls.friction)
    numbers = tuple(single(part) for part in parts)
    decay, rates = single(settings.decay), (single(settings.rates["centre"]), single(settings.rates["log_width"]))
    limits = single(units.log_width_limits[0]), single(units.log_width_limits[1])
    return lambda steps: particle_loop(steps, seed, centre, log_width, forces, regions, numbers, decay, rates, limits)


def local_learning_row(seeds: int, episodes: int, wanted: str) -> Row:
    """Wall time of the learning behind figure 6.5, from nothing: compilation is counted."""
    jax.clear_caches()
    task = FallingParticle()
    start = time.perf_counter()
    learner = stepper_of(task, settings_for(task).agent(task), range(seeds))
    learner.advance(round(episodes * EPISODE))
    took = time.perf_counter() - start
    name = f"particle, {seeds} seeds × {episodes:,} episodes, with compilation"
    return Row(name, took, None, "s", None, None, wanted)
