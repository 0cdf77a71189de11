"""The posterior over the transitions of a finite world: its moments, and the gradient that it gives."""

import numpy as np
import pytest

from motorgrad.policies import Softmax
from motorgrad.worlds import TransitionPosterior, oracle, three_state

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])


def experience(decisions, seed=0):
    """Decisions at random in the three-state world: states, actions, and the states that followed."""
    world = three_state()
    random = np.random.default_rng(seed)
    states, actions = random.integers(3, size=decisions), random.integers(2, size=decisions)
    after = [int(random.choice(3, p=world.transitions[a, s])) for s, a in zip(states, actions, strict=True)]
    return states, actions, np.array(after)


def test_counts_are_added_to_the_prior():
    belief = TransitionPosterior.of(three_state(), prior=1.5).updated([0, 0, 2], [1, 1, 0], [2, 2, 1])
    np.testing.assert_allclose(belief.parameters[1, 0], [0.5, 0.5, 2.5])
    np.testing.assert_allclose(belief.parameters[0, 2], [0.5, 1.5, 0.5])
    np.testing.assert_allclose(belief.parameters[0, 0], 0.5)
    np.testing.assert_allclose(belief.mean().transitions[1, 0], np.array([0.5, 0.5, 2.5]) / 3.5)


def test_samples_have_the_mean_and_the_variance_of_the_dirichlet_distribution():
    belief = TransitionPosterior.of(three_state()).updated(*experience(20))
    random = np.random.default_rng(0)
    drawn = np.array([belief.sample(random).transitions for _ in range(4000)])
    mean = belief.mean().transitions
    variance = mean * (1 - mean) / (belief.parameters.sum(-1, keepdims=True) + 1)
    np.testing.assert_allclose(drawn.mean(axis=0), mean, atol=0.03)
    np.testing.assert_allclose(drawn.var(axis=0), variance, atol=0.01)


def test_rewards_observations_and_start_are_those_of_the_world_and_transitions_are_not():
    world, belief = three_state(), TransitionPosterior.of(three_state())
    sampled = belief.sample(np.random.default_rng(0))
    np.testing.assert_array_equal(sampled.rewards, world.rewards)
    np.testing.assert_array_equal(sampled.observations, world.observations)
    np.testing.assert_allclose(belief.mean().transitions, 1 / 3)


def test_the_gradient_tends_to_the_exact_one_with_experience():
    exact = oracle.flat(oracle.gradient(three_state(), POINT))
    errors = []
    for decisions in (10, 20_000):
        belief = TransitionPosterior.of(three_state()).updated(*experience(decisions))
        found = oracle.flat(belief.gradient(POINT, np.random.default_rng(0), models=5))
        errors.append(np.linalg.norm(found - exact) / np.linalg.norm(exact))
    assert errors[1] < 0.05 < errors[0]


def test_the_gradient_is_the_mean_of_those_of_the_sampled_worlds():
    belief = TransitionPosterior.of(three_state()).updated(*experience(20))
    one, other = np.random.default_rng(3), np.random.default_rng(3)
    each = [oracle.flat(oracle.gradient(belief.sample(one), POINT)) for _ in range(3)]
    np.testing.assert_allclose(oracle.flat(belief.gradient(POINT, other, models=3)), np.mean(each, axis=0), rtol=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: TransitionPosterior.of(three_state(), prior=0.0), "prior = 0.0: must be a finite number above 0"),
        (lambda: TransitionPosterior(np.zeros((2, 3, 3)), three_state()), "least of parameters = 0.0: must be above 0"),
        (lambda: TransitionPosterior(np.ones((3, 3)), three_state()), "parameters.shape = "),
        (lambda: TransitionPosterior.of(three_state()).updated([0], [2], [0]), r"actions = \[2\]: must be from 0 to 1"),
        (
            lambda: TransitionPosterior.of(three_state()).updated([0.5], [1], [0]),
            r"states = \[0.5\]: must be a list",
        ),
        (lambda: TransitionPosterior.of(three_state()).updated([0, 1], [1], [0]), "must be as many of each"),
        (
            lambda: TransitionPosterior.of(three_state()).gradient(POINT, np.random.default_rng(0), 0),
            "models = 0: must be",
        ),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(call, message):
    with pytest.raises(ValueError, match=message):
        call()
