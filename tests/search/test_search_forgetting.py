"""What a Gaussian process forgets: against dense relative entropies, against itself made anew, and in a search."""

import numpy as np
import pytest
from search_examples import SPACE, needs_tinygp, sphere

from motorgrad.search import BayesianOptimisation, Space, WithGradients, search

pytestmark = needs_tinygp
SETTINGS = np.log([0.3, 0.7, 1.3, 0.2])
SMALL = Space({name: SPACE.ranges[name] for name in "ab"})


def observations(gradients):
    """Seven places, one observed twice, one without one of its derivatives."""
    random = np.random.default_rng(1)
    places = random.random((7, 2))
    places[5] = places[2]
    slopes = random.standard_normal((7, 2))
    slopes[3, 0] = np.nan
    return places, random.standard_normal(7), slopes if gradients else np.full((7, 2), np.nan), np.full((7, 2), 0.1)


def posterior_of(rows, gradients):
    from motorgrad.search._gaussian_process import Data, Posterior

    return Posterior("matern", SETTINGS, Data.of(*(each[rows] for each in observations(gradients)), capacity=8))


def joint(posterior):
    """Mean and covariance of scores and derivatives at all seven places and two more, given a posterior's data."""
    import jax

    from motorgrad.search._gaussian_process import Functional

    places = np.concatenate([np.delete(observations(True)[0], 5, axis=0), [[0.1, 0.9], [0.8, 0.2]]])
    count = len(places)
    direction = np.concatenate([np.zeros((count, 2)), *[np.tile(unit, (count, 1)) for unit in np.eye(2)]])
    seen = Functional(np.tile(places, (3, 1)), np.repeat([1.0, 0.0, 0.0], count), direction)
    with jax.enable_x64(True):
        kernel = posterior.prior.kernel
        root = np.asarray(posterior.prior.solver.scale_tril)
        across = np.linalg.solve(root, np.asarray(kernel(posterior.prior.X, seen)))
        own = np.asarray(kernel(seen, seen))
    return across.T @ np.linalg.solve(root, posterior.data.values), own - across.T @ across


@pytest.mark.ci
@pytest.mark.parametrize("gradients", [False, True])
def test_the_information_of_a_candidate_is_the_relative_entropy_of_the_posteriors_with_and_without_it(gradients):
    from motorgrad.search._forgetting import information, parts_of

    whole = posterior_of(slice(None), gradients)
    mean, covariance = joint(whole)
    found = information(*(each[:7] for each in parts_of(whole)))
    for candidate in range(7):
        other_mean, other = joint(posterior_of(np.arange(7) != candidate, gradients))
        step = other_mean - mean
        ratio = np.linalg.solve(other, covariance)
        entropy = np.trace(ratio) - len(mean) + step @ np.linalg.solve(other, step) - np.linalg.slogdet(ratio)[1]
        assert found[candidate] == pytest.approx(0.5 * entropy, rel=1e-3)
    assert found.argmin() in (2, 5) or gradients  # observed twice


@pytest.mark.ci
def test_forgetting_several_is_forgetting_one_after_another():
    from motorgrad.search._forgetting import information, least_informative, parts_of

    left = list(range(7))
    for _ in range(4):
        posterior = posterior_of(left, True)
        losses = information(*(each[: len(left)] for each in parts_of(posterior)))
        losses[left.index(3)] = np.inf
        left.pop(int(losses.argmin()))
    assert sorted(least_informative(posterior_of(slice(None), True), 7, 4, kept=3)) == sorted(set(range(7)) - set(left))


def told(method, places, scores):
    state = method.begin(np.full(places.shape[1], 0.5))
    for batch in range(0, len(places), method.candidates):
        rows = slice(batch, batch + method.candidates)
        state = method.tell(state, places[rows], scores[rows])
    return state


@pytest.mark.ci
@pytest.mark.parametrize("forgets", ["oldest", "least-informative"])
def test_a_memory_keeps_so_many_and_the_greatest_score(forgets):
    places = np.random.default_rng(0).random((24, 2))
    scores = -((places - 0.4) ** 2).sum(axis=1)
    scores[2] = 1.0
    method = BayesianOptimisation(memory=12, forgets=forgets)
    state = method._remembered(told(method, places, scores))
    assert [len(state[name]) for name in ("places", "scores", "gradients", "variances")] == [12] * 4
    assert 1.0 in state["scores"]
    if forgets == "oldest":
        np.testing.assert_array_equal(state["scores"][1:], scores[-11:])


@pytest.mark.ci
def test_predictions_without_the_least_informative_are_close_to_those_of_all():
    """Thirty of 48 noisy scores: closer than those of the last thirty, as these come from one side."""
    random = np.random.default_rng(0)
    places = random.random((48, 2))
    places = places[np.argsort(places[:, 0])]
    scores = np.sin(4 * places[:, 0]) + places[:, 1] ** 2 + 0.05 * random.standard_normal(48)
    tested = random.random((100, 2))
    exact = BayesianOptimisation()
    truth = exact.posterior(told(exact, places, scores), tested)[0]
    errors = {}
    for forgets in ("oldest", "least-informative"):
        method = BayesianOptimisation(memory=30, forgets=forgets)
        state = method._remembered(told(method, places, scores))
        errors[forgets] = np.sqrt(np.mean((method.posterior(state, tested)[0] - truth) ** 2)) / truth.std()
    assert errors["least-informative"] < 0.05 < errors["oldest"]


@pytest.mark.ci
def test_a_memory_that_is_never_full_changes_nothing_and_a_full_one_still_finds_the_optimum():
    def score(candidates, random):
        numbers = np.array([list(each.values()) for each in candidates])
        return WithGradients(sphere(candidates, random), -2 * (numbers - 1), np.full(numbers.shape, 1e-2))

    def found(method):
        return search(score, SMALL, method, evaluations=16, progress=False)

    every = found(BayesianOptimisation(initial=4))
    same = found(BayesianOptimisation(initial=4, memory=16))
    np.testing.assert_array_equal(every.candidates, same.candidates)
    assert found(BayesianOptimisation(initial=4, memory=6)).curve[-1] > -0.1


def test_a_memory_too_small_to_begin_with_is_refused():
    with pytest.raises(ValueError, match="memory = 4: must be at least initial = 8"):
        BayesianOptimisation(memory=4)


def test_failures_beyond_the_memory_are_forgotten_before_the_greatest_score():
    method = BayesianOptimisation(initial=4, memory=4, forgets="oldest")
    scores = np.array([3.0, 1.0, 2.0, 0.0, np.nan, np.nan, np.nan, np.nan])
    state = method._remembered(told(method, np.random.default_rng(0).random((8, 1)), scores))
    assert state["scores"][0] == 3.0
    assert np.isnan(state["scores"][1:]).all()
