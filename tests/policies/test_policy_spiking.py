"""Spiking units: the potential in closed form, the score of whole spike trains, and the gradient that it estimates."""

import itertools
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from policy_examples import compiled

from motorgrad.policies import Hyperplanes, SpikingUnits, abilities, initial, split

STEPS = 40
KAPPA = 0.8


def example() -> SpikingUnits:
    rng = np.random.default_rng(0)
    return SpikingUnits(rng.normal(size=(3, 2)), rng.normal(size=3), KAPPA)


def seen_over(policy, observations, actions):
    """What the units see at every decision, given all spikes."""

    def step(memory, now):
        observation, action = now
        seen = policy.observation_with_memory(memory, observation)
        return policy.remember(seen, action), seen

    return jax.lax.scan(step, policy.initial_memory(), (observations, actions))[1]


def log_prob_by_definition(policy, observations, actions):
    """The log-probability of a spike train, from the sum over the inputs since the last spike."""
    total = 0.0
    for unit in range(policy.outputs):
        potential = 0.0
        for observation, action in zip(observations, actions, strict=True):
            potential = policy.decay * potential + policy.weights[unit] @ observation
            p = jax.nn.sigmoid(potential - policy.threshold[unit])
            total = total + jnp.where(action[unit] > 0, jnp.log(p), jnp.log(1 - p))
            potential = jnp.where(action[unit] > 0, 0.0, potential)
    return total


def summed_score(policy, observations, actions):
    """The sum of the scores of all decisions."""
    scores = jax.vmap(policy.score)(seen_over(policy, observations, actions), actions)
    return ravel_pytree(jax.tree.map(lambda x: x.sum(0), scores))[0]


def test_the_scores_of_a_spike_train_add_up_to_the_derivative_of_its_probability():
    with jax.enable_x64(True):
        rng = np.random.default_rng(1)
        observations = jnp.asarray(rng.normal(size=(8, 2)))
        actions = jnp.asarray(rng.integers(0, 2, size=(8, 3)), float)
        policy = example()
        theta, rest = split(policy)
        whole = compiled(jax.grad(lambda part: log_prob_by_definition(eqx.combine(part, rest), observations, actions)))
        expected = ravel_pytree(whole(theta))[0]
        found = compiled(summed_score)(policy, observations, actions)
    assert np.abs(expected).min() > 1e-3
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-13)


@compiled
def potentials(policy, observations, actions):
    return jax.vmap(policy.potential)(seen_over(policy, observations, actions))


def test_a_silent_unit_charges_exponentially_and_a_spike_sets_it_back():
    policy = SpikingUnits([[0.5]], [1.0], KAPPA)
    actions = np.zeros((STEPS, 1), np.float32)
    actions[9] = 1  # counted from 0: the tenth decision
    found = potentials(policy, jnp.ones((STEPS, 1)), actions)[:, 0] + 1.0
    charge = 0.5 * (1 - KAPPA ** np.arange(1, STEPS + 1)) / (1 - KAPPA)
    np.testing.assert_allclose(found[:10], charge[:10], rtol=1e-5)
    np.testing.assert_allclose(found[10:], charge[: STEPS - 10], rtol=1e-5)


def test_a_weight_learns_from_the_inputs_between_two_spikes_alone():
    """The score is Hebbian: an input counts by what is left of it at the spike, and not at all after it."""
    policy = SpikingUnits([[0.3, 0.3]], [1.0], KAPPA)
    pulses = np.zeros((7, 2), np.float32)
    pulses[0, 0] = 1  # before the first spike: forgotten
    pulses[4, 1] = 1  # two decisions before the second
    actions = np.zeros((7, 1), np.float32)
    actions[2] = actions[6] = 1
    seen = seen_over(policy, jnp.asarray(pulses), jnp.asarray(actions))
    p = policy.prob(seen[6])[0]
    np.testing.assert_allclose(policy.score(seen[6], [1.0]).weights[0], [0, (1 - p) * KAPPA**2], rtol=1e-5)
    np.testing.assert_allclose(policy.score(seen[6], [0.0]).weights[0], [0, -p * KAPPA**2], rtol=1e-5)
    np.testing.assert_allclose(policy.score(seen[6], [1.0]).threshold, [-(1 - p)], rtol=1e-5)


def test_units_that_forget_are_hyperplanes():
    policy = SpikingUnits([[0.3, -1.0]], [0.4], 0.0)
    plane = Hyperplanes([[0.3, -1.0]], [-0.4])
    observation = jnp.array([0.7, 0.2])
    seen = policy.observation_with_memory(jnp.array([5.0, 5.0]), observation)
    np.testing.assert_allclose(policy.prob(seen), plane.prob(observation), rtol=1e-6)


def test_scores_times_rewards_are_the_gradient_of_the_expected_reward():
    """Over all spike trains, against central differences: spikes change later potentials, and their score accounts for
    that."""
    length = 5
    trains = jnp.asarray(list(itertools.product((0.0, 1.0), repeat=length)))[:, :, None]
    with jax.enable_x64(True):
        observations = jnp.asarray(np.random.default_rng(2).random((length, 1)))
        worth = jnp.asarray((np.asarray(trains)[:, :, 0] @ [1.0, -2.0, 0.5, 3.0, 1.0] - 1) ** 2)

        def chance(policy, actions):
            return jnp.exp(jax.vmap(policy.log_prob)(seen_over(policy, observations, actions), actions).sum())

        @compiled
        def expected(policy):
            return jax.vmap(lambda actions: chance(policy, actions))(trains) @ worth

        @compiled
        def estimate(policy):
            scores = jax.vmap(lambda actions: summed_score(policy, observations, actions))(trains)
            return (jax.vmap(lambda actions: chance(policy, actions))(trains) * worth) @ scores

        def at(weight, threshold):
            return SpikingUnits(jnp.array([[weight]], float), jnp.array([threshold], float), jnp.array(KAPPA, float))

        step = 1e-5
        by_weight = (expected(at(1.5 + step, 2.0)) - expected(at(1.5 - step, 2.0))) / (2 * step)
        by_threshold = (expected(at(1.5, 2.0 + step)) - expected(at(1.5, 2.0 - step))) / (2 * step)
        np.testing.assert_allclose(estimate(at(1.5, 2.0)), [by_weight, by_threshold], rtol=1e-7)


def test_critics_see_the_observation_and_the_memory_starts_from_nothing():
    policy = example()
    assert (policy.observation_size, policy.inputs, policy.outputs, policy.uniforms) == (2, 8, 3, 3)
    np.testing.assert_array_equal(policy.initial_memory(), np.zeros(6))
    assert abilities.critic_observation(policy, jnp.arange(8.0)).tolist() == [0, 1]


def test_the_initial_policy_has_its_time_constant():
    policy = initial("spiking", 2, units=5, time_constant=4.0, weight=0.5, low=1.0, high=2.0)(jax.random.key(0))
    np.testing.assert_allclose(policy.decay, np.exp(-1 / 4), rtol=1e-6)
    np.testing.assert_array_equal(policy.weights, np.full((5, 2), 0.5))
    assert ((policy.threshold >= 1) & (policy.threshold < 2)).all()
    assert initial("spiking", 2, units=1, time_constant=0.0)(jax.random.key(0)).decay == 0


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: SpikingUnits([1.0], [0.0]), "weights = (1,)"),
        (lambda: SpikingUnits([[1.0]], [0.0, 0.0]), "threshold = (2,)"),
        (lambda: SpikingUnits([[1.0]], [0.0], 1.0), "decay = 1"),
        (lambda: SpikingUnits([[1.0]], [0.0], [0.5, 0.5]), "decay = (2,)"),
        (lambda: initial("spiking", 1, units=1, low=1.0, high=1.0), "low, high"),
    ],
)
def test_impossible_units_are_refused(build, names):
    with pytest.raises(ValueError, match=re.escape(names)):
        build()
