"""Continuous actions on a particle: they multiply the forces, and units of learned strength learn."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.policies import initial
from motorgrad.tasks import FallingParticle, make
from motorgrad.training import agent_for, train
from motorgrad.training.engines import validate
from motorgrad.worlds import ParticleState


def rest():
    return ParticleState(jnp.full(2, 0.5), jnp.zeros(2), jnp.zeros(4, bool))


def test_an_action_multiplies_its_force_and_turns_it_round():
    step = jax.jit(FallingParticle(units=2).dynamics.step)

    def moved(*action):
        return np.asarray(step(rest(), np.array(action, np.float32), np.zeros(0, np.float32)).velocity)

    np.testing.assert_allclose(moved(0, 0.5)[0], moved(0, 1)[0] / 2, rtol=1e-5)
    np.testing.assert_allclose(moved(0, -1), moved(1, 0), rtol=1e-5)
    assert moved(0, 1)[0] > 0


NAMES = ("particle", "particle-orbit", "particle-navigation")


@pytest.mark.parametrize("name", NAMES)
def test_policies_of_zeros_and_ones_and_of_real_numbers_are_let_act(name):
    task = make(name)
    assert task.accepted_actions == ("binary", "continuous")
    for kind in ("tiles", "graded-tiles"):
        validate(task, initial(kind, task, copies=2))


@pytest.mark.ci
@pytest.mark.parametrize("name", NAMES)
def test_every_particle_takes_zeros_and_ones_and_real_numbers(name):
    task = make(name)
    rates = {"centre": 1e-4, "log_width": 1e-4, "strength": 1e-3, "log_deviation": 1e-3}
    agent = agent_for(task, policy={"kind": "graded-tiles", "copies": 2}, learning_rate=rates)
    run = train(task, agent, 300, 2, progress=False)
    assert np.isfinite(run.curve()[1]).all()
    assert (run.policies.strength != 0).any()


@pytest.mark.slow
def test_a_mixture_learns_all_its_parts():
    task = FallingParticle(units=10)
    rates = {"centre": 2e-4, "log_width": 8e-4, "weights": 0.03, "bias": 0.03}
    agent = agent_for(task, policy={"kind": "mixture", "copies": 2}, learning_rate=rates)
    run = train(task, agent, 500, 2, progress=False)
    local, everywhere = run.policies.pools
    first = run.initial.pools
    assert (local.centre != first[0].centre).any()
    assert (everywhere.weights != first[1].weights).any()
    with pytest.raises(ValueError, match="discrete actions, but the task 'particle' takes binary or continuous"):
        mg.train(task, agent_for(task, policy="softmax", learning_rate=1e-3), 10, progress=False)
