"""Runs, hardly trained, of tasks that scale what they show in different ways."""

import functools

import equinox as eqx
import jax
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.tasks import compose, from_gymnasium, terms

REACH = {
    "targets": [terms.Reach("hand")],
    "observe": ["joint-positions", "joint-velocities", "target-error"],
    "reward": ["distance"],
    "reset": ["random-joints"],
    "metrics": ["distance"],
}
TASKS = {
    "Pendulum": lambda: from_gymnasium("Pendulum-v1"),
    "CartPole": lambda: from_gymnasium("CartPole-v1"),
    "HalfCheetah": lambda: from_gymnasium("HalfCheetah-v5"),
    "arm": lambda: compose("arm6", **REACH, time_limit=1.0),
    "hopper": lambda: mg.make("hopper"),
    "elbow": lambda: from_gymnasium("myosuite:myoElbowPose1D6MRandom-v0"),
}
CASES = [*sorted(set(TASKS) - {"elbow"}), pytest.param("elbow", marks=pytest.mark.needs("motorgrad[myosuite]"))]
POLICIES = {
    "discrete": mg.policies.softmax,
    "binary": mg.policies.hyperplanes,
    "continuous": mg.policies.graded_hyperplanes,
}


@functools.cache
def task_of(name):
    return TASKS[name]()


@functools.cache
def agent_of(name):
    """A learner whose first policy responds to what it sees."""
    rng, start = np.random.default_rng(6), POLICIES[task_of(name).actions](task_of(name))
    policy = jax.tree.map(lambda leaf: leaf + rng.normal(scale=0.3, size=leaf.shape), mg.policies.trainable(start))
    return mg.Agent(eqx.combine(policy, start), mg.learning.olgarb(decay=0.9), mg.learning.SGD(1e-3))


@functools.cache
def learned(name):
    return trained(name, steps=12)


def trained(name, *, task=None, **options):
    """A run of two seeds."""
    more = {"agent": agent_of(name), "seeds": [3, 5], "window": 12, "progress": False, "threads": 1}
    return mg.train(task_of(name) if task is None else task, **more | options)
