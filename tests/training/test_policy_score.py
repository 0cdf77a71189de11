"""Policies as candidates of a search: their parameters as numbers, and scores on fixed random streams."""

import dataclasses

import numpy as np
import pytest

import motorgrad as mg
from motorgrad.learning import MeanReward, gpomdp, olgarb
from motorgrad.policies import Softmax, softmax
from motorgrad.search import Pulled, search
from motorgrad.training import PolicyScore
from motorgrad.worlds import oracle

TASK = mg.make("three-state")
POLICY = Softmax(np.array([[0.5, -0.5], [0.2, 1.0]]))
SCORE = PolicyScore(TASK, POLICY, steps=40, streams=3)
RNG = np.random.default_rng


def candidates(count, seed=0):
    space = SCORE.space()
    return [space.named(row) for row in RNG(seed).uniform(0, 1, (count, space.size))]


def test_a_number_stands_for_each_parameter_and_starts_where_the_policy_is():
    space = SCORE.space(reach=2.0)
    assert space.names == ("weights.0.0", "weights.0.1", "weights.1.0", "weights.1.1")
    np.testing.assert_allclose(space.numbers(space.start), [0.5, -0.5, 0.2, 1.0])
    assert (space.ranges["weights.1.0"].low, space.ranges["weights.1.0"].high) == pytest.approx((-1.8, 2.2))
    chosen = candidates(1)[0]
    for each in (chosen, dict(sorted(chosen.items(), reverse=True))):  # by name, in any order
        np.testing.assert_allclose(SCORE.policy_of(each).weights.ravel(), list(chosen.values()), rtol=1e-6)
    with pytest.raises(ValueError, match=r"candidate = \['weights.0.0'\]: must be a number for each name of the space"):
        SCORE.policy_of({"weights.0.0": 1.0})


def test_with_fixed_streams_a_score_is_a_function_of_the_parameters():
    """Whatever the round and its generator; other streams, and new ones in each round, give others."""
    several = candidates(4)
    first, again = SCORE(several, RNG(0)), SCORE(several, RNG(1))
    np.testing.assert_array_equal(first, again)
    swapped = SCORE(several[::-1], RNG(2))
    np.testing.assert_array_equal(swapped[::-1], first)
    assert len(set(first)) > 1
    assert not np.array_equal(dataclasses.replace(SCORE, seed=100)(several, RNG(0)), first)
    fresh = dataclasses.replace(SCORE, fixed=False)
    np.testing.assert_array_equal(fresh(several, RNG(0)), fresh(several, RNG(0)))
    assert not np.array_equal(fresh(several, RNG(0)), fresh(several, RNG(1)))


def test_candidates_of_a_round_meet_the_same_random_numbers():
    same = candidates(1) * 4
    for score in (SCORE, dataclasses.replace(SCORE, fixed=False)):
        assert len(set(score(same, RNG(5)))) == 1


def test_gradients_come_from_the_decisions_that_are_scored():
    """The scores are the same; the gradients lie within their errors, by name in whatever order."""
    long = dataclasses.replace(SCORE, steps=400, streams=8)
    told = dataclasses.replace(long, gradient=gpomdp(0.9, MeanReward()))
    several = candidates(2)
    found = told(several, RNG(0))
    np.testing.assert_array_equal(found.scores, long(several, RNG(0)))
    exact = [oracle.flat(oracle.gradient(TASK.dynamics, long.policy_of(each))) for each in several]
    assert (np.abs(found.gradients - exact) < 4 * np.sqrt(found.variances) + 0.01).all()
    assert (np.sqrt(found.variances) < 0.5 * np.abs(exact)).mean() > 0.5  # so that this says something
    turned = told([dict(reversed(each.items())) for each in several], RNG(0))
    np.testing.assert_array_equal(turned.gradients, found.gradients[:, ::-1])
    np.testing.assert_array_equal(turned.variances, found.variances[:, ::-1])


@pytest.mark.slow
@pytest.mark.ci
def test_long_streams_earn_the_average_reward():
    long = dataclasses.replace(SCORE, steps=4000, streams=16)
    several = candidates(4)
    exact = [oracle.average_reward(TASK.dynamics, long.policy_of(each)) for each in several]
    np.testing.assert_allclose(long(several, RNG(0)), exact, atol=0.01)


@pytest.mark.slow
def test_a_search_finds_a_good_policy():
    task = mg.make("three-state")
    score = PolicyScore(task, softmax(task), steps=100, streams=8)
    found = search(score, score.space(), Pulled(width=0.1), evaluations=360, progress=False)
    best = oracle.optimal_policy(task.dynamics)[1]
    assert oracle.average_reward(task.dynamics, score.policy_of(found.best)) > 0.85 * best


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"steps": 0}, "steps = 0"),
        ({"streams": 0}, "streams = 0"),
        ({"of": "retrun"}, "unknown of 'retrun'"),
        ({"gradient": olgarb()}, 'gradient.update_every = 1: must be "never"'),
        ({"gradient": gpomdp(), "streams": 1}, "streams = 1: must be at least 2 where a gradient is estimated"),
        ({"policy": 3}, "policy = 3: must be a policy, or a function from a key to one"),
        ({"policy": softmax(3, 2)}, "inputs = 3, but the task 'three-state' has 2"),
    ],
)
def test_impossible_settings_are_refused_by_name(changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(SCORE, **changes)
