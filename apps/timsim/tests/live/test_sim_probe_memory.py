"""TimSim's probe and the plane of a particle, with policies that remember."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.plane import trajectories
from motorgrad.policies import abilities, initial
from motorgrad.training import agent_for, stepper_for
from timsim.live._probe import probe


@pytest.mark.ci
def test_the_probability_shown_is_that_of_what_the_units_saw():
    task = mg.make("hopper")
    agent = agent_for(task, policy={"kind": "finite-state-controller", "states": 3, "strength": 9.0})
    stepper = stepper_for(task, agent, [0], "sample", threads=1)
    look = probe(stepper, [])
    for _ in range(5):
        stepper.advance(1)
        cycle = stepper.state["cycle"]
        policy = jax.tree.map(lambda leaf: leaf[0], cycle.agent.policy)
        seen = jnp.asarray(cycle.agent.decision.observation[0])
        np.testing.assert_allclose(look()["probability"][0], policy.prob(seen), rtol=1e-5)
        np.testing.assert_allclose(seen[:3], cycle.observation[0], rtol=1e-6)


@pytest.mark.ci
def test_the_probability_shown_in_a_world_is_that_of_the_observation_and_the_memory():
    task = mg.make("load-unload")
    stepper = stepper_for(task, agent_for(task), [0], "sample")
    look = probe(stepper, [])
    memories = []

    @jax.jit
    def probability(policies, memory, observation):
        policy = jax.tree.map(lambda leaf: leaf[0], policies)
        return policy.prob(abilities.observation_with_memory(policy, memory, observation))

    for _ in range(8):
        stepper.advance(1)
        shown = look()
        expected = probability(stepper.policies(), shown["memory"][0], shown["observation"][0])
        np.testing.assert_allclose(shown["probability"][0], expected, rtol=1e-5)
        np.testing.assert_array_equal(shown["memory"], stepper.state["cycle"].agent.memory)
        memories.append(int(np.argmax(shown["memory"])))
    assert len(set(memories)) > 1


@pytest.mark.ci
def test_episodes_of_a_particle_can_be_walked_with_a_memory():
    task = mg.make("particle")
    policy = jax.jit(initial("recurrent", task, hidden=2))(jax.random.key(0))
    tracks = trajectories(task, policy, episodes=2, decisions=5)
    assert len(tracks) == 2
    assert all(len(track) > 1 and np.isfinite(track).all() for track in tracks)
