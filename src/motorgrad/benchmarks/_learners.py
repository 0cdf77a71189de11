"""Learners of worlds beside hand-written compiled loops of the same learner."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np

from motorgrad.benchmarks._loops import particle_loop, recruitment_loop, three_state_loop
from motorgrad.benchmarks._measure import Figures, in_turn
from motorgrad.policies import LocalGaussians
from motorgrad.schema import numbers_of
from motorgrad.tasks import FallingParticle, LinearRecruitment, Task, ThreeState
from motorgrad.training import agent_for, stepper_for, training_stepper_for

LOOP_STEPS = 4_000_000


def beside_loop(task: Task, loop: Callable[[int], object], seeds: int, decisions: int, pairs: int) -> Figures:
    """Updates per second in total of the task's own learner, of so many `seeds` and `decisions` of each, against those
    of a `loop` on one core, which learns for a given number of decisions."""
    learner = stepper_for(task, agent_for(task), range(seeds))
    learner.advance(decisions)  # compiles
    loop(10)  # compiles
    works = (lambda: learner.advance(decisions), lambda: loop(LOOP_STEPS))
    return in_turn("updates/s", decisions * seeds, *works, LOOP_STEPS, pairs)


def three_states(seeds: int, decisions: int, pairs: int = 5) -> Figures:
    """OLGARB on the three-state MDP: updates per second in total, against the loop's on one core."""
    task = ThreeState()
    numbers = numbers_of(agent_for(task).hyperparameters)
    world = task.dynamics
    single = np.float32
    inputs = (
        world.observations.astype(single),
        world._cumulative.astype(single),
        world._successors,
        world.rewards.astype(single),
        numbers["estimator.trace.decay"],
        numbers["optimizer.learning_rate"],
    )
    return beside_loop(task, lambda steps: three_state_loop(steps, 1, *inputs), seeds, decisions, pairs)


def recruitment(seeds: int, decisions: int, pairs: int = 5) -> Figures:
    """OLGARB on linear recruitment: updates per second in total of pools of eight, against the loop's on one core."""
    task = LinearRecruitment(units=8)
    learning_rate = numbers_of(agent_for(task).hyperparameters)["optimizer.learning_rate"]
    numbers = (task.units, task.slope, task.intercept, learning_rate)
    return beside_loop(task, lambda steps: recruitment_loop(steps, 1, *numbers), seeds, decisions, pairs)


def natural_step(seeds: int, decisions: int, pairs: int = 5) -> Figures:
    """Updates per second in total of pools of sixteen: the natural step against the plain one."""
    task = LinearRecruitment(units=16)
    natural = agent_for(task, metric="fisher", damping={"threshold": 0.05}, learning_rate=1e-4)
    learners = [stepper_for(task, agent, range(seeds)) for agent in (natural, agent_for(task))]
    return _compare("updates/s", learners, seeds, decisions, pairs)


def sweep(settings: int, seeds: int, decisions: int, pairs: int = 5) -> Figures:
    """Updates per second in total of a sweep over learning rates of OLGARB, against as many seeds of one setting."""
    task = ThreeState()
    agent = agent_for(task)
    rates = np.repeat(np.geomspace(1e-4, 1e-1, settings), seeds)  # all seeds of the first setting, then of the second
    lanes = np.tile(np.arange(seeds), settings)
    swept = training_stepper_for(task, agent, lanes.tolist(), numbers={"optimizer.learning_rate": rates})
    single = training_stepper_for(task, agent, range(settings * seeds))
    return _compare("updates/s", (swept, single), settings * seeds, decisions, pairs)


EPISODE = 24.5  # decisions on average, for the initial policy


def particle(seeds: int, decisions: int, pairs: int = 5) -> Figures:
    """OLGARB on the falling particle: updates per second of eight local units, against a loop's on one core."""
    task = FallingParticle()
    return beside_loop(task, hand_written(task), seeds, decisions, pairs)


def hand_written(task: FallingParticle, seed: int = 1) -> Callable[[int], tuple[np.ndarray, np.ndarray, Any]]:
    """The compiled loop for the given task, with the same initial policy and step sizes."""
    agent = agent_for(task)
    units = agent.init(jax.random.key(0)).policy
    own = numbers_of(agent.hyperparameters)
    assert isinstance(units, LocalGaussians)
    assert units.log_width_limits is not None
    centre, log_width = (np.array(part, np.float32) for part in (units.centre, units.log_width))
    forces = np.array(task.dynamics.forces, np.float32)[:, 0].copy()
    regions = np.array(task.places, np.float32)
    physics, single = task.physics, np.float32
    parts = (physics.timestep, physics.gravity[1], physics.drag, physics.walls.restitution, physics.walls.friction)
    numbers = tuple(single(part) for part in parts)
    decay = single(own["estimator.trace.decay"])
    rates = single(own["optimizer.learning_rate.centre"]), single(own["optimizer.learning_rate.log_width"])
    limits = single(units.log_width_limits[0]), single(units.log_width_limits[1])
    return lambda steps: particle_loop(steps, seed, centre, log_width, forces, regions, numbers, decay, rates, limits)


def local_learning(seeds: int, episodes: int) -> Figures:
    """Seconds of the learning behind figure 6.5, including compilation."""
    jax.clear_caches()
    task = FallingParticle()

    def learn() -> None:
        stepper_for(task, agent_for(task), range(seeds)).advance(round(episodes * EPISODE))

    return in_turn("s", 1, learn, pairs=1)


WIDTH = 0.64  # in spacings, so that the number of units that can fire anywhere does not depend on their total number


def index(units: int, seeds: int, decisions: int, pairs: int = 5) -> Figures:
    """Decisions per second in total of a particle with thousands of local units, with and without the spatial index."""
    task = FallingParticle(units=units)
    width = WIDTH / (units / 2) ** 0.5
    policy = {"copies": 2, "width": width, "least_log_width": -8.0}
    rates = {"centre": 2e-4 * (width / 0.16) ** 2, "log_width": 8e-4}
    agents = [
        agent_for(task, {"policy": policy, "learning_rate": rates, "kind": kind})
        for kind in ("sparse", "policy-gradient")
    ]
    learners = [stepper_for(task, agent, range(seeds)) for agent in agents]
    return _compare("decisions/s", learners, seeds, decisions, pairs)


def _compare(unit: str, learners: Sequence[Any], seeds: int, decisions: int, pairs: int) -> Figures:
    """The rate of the first of two learners, against the second's."""
    for learner in learners:
        learner.advance(decisions)  # compiles
    ours, other = (lambda own=learner: own.advance(decisions) for learner in learners)
    return in_turn(unit, decisions * seeds, ours, other, pairs=pairs)
