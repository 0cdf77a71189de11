"""What the methods find, where the best is known; and the Boltzmann distribution itself."""

import importlib.util

import numpy as np
import pytest
from search_examples import METHODS, SPACE, ellipsoid, needs_evosax, noisy_sphere, sphere

from motorgrad.search import (
    Annealing,
    BayesianOptimisation,
    Boltzmann,
    CmaEs,
    EvolutionStrategy,
    Genetic,
    Pulled,
    Range,
    Space,
    Uniform,
    search,
)

ONES = dict.fromkeys(SPACE.names, 1.0)


def found(method, score=sphere, evaluations=640, seed=0):
    return search(score, SPACE, method, evaluations=evaluations, seed=seed, progress=False)


@needs_evosax
@pytest.mark.parametrize("score", [pytest.param(sphere, marks=pytest.mark.ci), ellipsoid])
def test_cma_es_finds_the_optimum_to_many_digits(score):
    best = found(CmaEs(), score, evaluations=1600)
    assert best.best == pytest.approx(ONES, abs=1e-2)
    assert best.curve[-1] > -1e-3


@pytest.mark.ci
@needs_evosax
@pytest.mark.parametrize("score", [sphere, noisy_sphere, ellipsoid])
def test_cma_es_beats_random_search_with_as_many_evaluations(score):
    def truth(method, seed):  # how good the best three are without noise, on average
        best = [numbers for numbers, _ in found(method, score, 480, seed).ranked(3)]
        return np.mean((sphere if score is noisy_sphere else score)(best, None))

    methods = (CmaEs(), Boltzmann(), Uniform())
    cma, boltzmann, uniform = (np.mean([truth(method, seed) for seed in range(4)]) for method in methods)
    assert cma > 0.5 * boltzmann
    assert cma > 0.5 * uniform


@needs_evosax
def test_cma_es_finds_an_optimum_at_a_bound():
    bounded = {"a": Range(0.0, 2.0), "b": Range(0.1, 10.0, log=True)}
    space = Space({**SPACE.ranges, **bounded})  # of as many numbers as elsewhere: the same programs
    best = search(
        lambda batch, random: [
            each["a"] - each["b"] - each["c"] ** 2 - each["d"] ** 2 - each["e"] ** 2 for each in batch
        ],
        space,
        evaluations=800,
        progress=False,
    )
    assert best.best == pytest.approx({"a": 2.0, "b": 0.1, "c": 0.0, "d": 0.0, "e": 0.0}, abs=0.02)


@needs_evosax
def test_of_scores_only_their_order_counts_for_cma_es():
    plain = found(CmaEs(), evaluations=160)
    bent = found(CmaEs(), lambda batch, random: -np.exp(-sphere(batch, random) / 50.0), evaluations=160)
    np.testing.assert_array_equal(plain.candidates, bent.candidates)


@pytest.mark.ci
@needs_evosax
def test_cma_es_takes_equal_scores_as_they_come():
    flat = found(CmaEs(), lambda batch, random: np.zeros(len(batch)), evaluations=800)
    places = SPACE.places(flat.candidates[-80:])
    assert 0.02 < places.std() < 0.4  # it neither collapses nor runs away to the bounds


@pytest.mark.ci
def test_boltzmann_search_climbs_beyond_random_sampling():
    gains = [found(Boltzmann(), seed=seed).curve[-1] - found(Uniform(), seed=seed).curve[-1] for seed in range(5)]
    assert np.median(gains) > 0


def test_samples_are_selected_by_a_boltzmann_distribution_over_their_average_scores():
    method = Boltzmann(temperature=0.7)
    state = method.begin(np.array([0.5]))
    places = np.array([[0.1], [0.2], [0.3], [0.1], [0.4]])
    state = method.tell(state, places, np.array([1.0, 2.0, 4.0, 3.0, np.nan]))
    averages = np.array([2.0, 2.0, 4.0])  # of 0.1, which was tried twice, 0.2 and 0.3
    weights = np.exp(averages / (0.7 * averages.std()))
    wanted = dict(zip([0.1, 0.2, 0.3], weights / weights.sum(), strict=True))
    found = dict(zip(state["samples"][:, 0].tolist(), method.probabilities(state).tolist(), strict=True))
    assert found == pytest.approx({0.5: 0.0, **wanted})
    # and so they are drawn: with noise too small to tell them apart
    drawn, _ = Boltzmann(candidates=20_000, temperature=0.7, width=1e-9).ask(state, np.random.default_rng(1))
    counts = [np.isclose(drawn, place, atol=1e-6).mean() for place in (0.1, 0.2, 0.3)]
    np.testing.assert_allclose(counts, list(wanted.values()), atol=0.015)


def test_a_few_numbers_are_moved_by_gaussian_noise():
    method = Boltzmann(candidates=4_000, changed=2, width=0.05)
    state = method.tell(method.begin(np.full(6, 0.5)), np.full((1, 6), 0.5), np.array([1.0]))
    moved = method.ask(state, np.random.default_rng(0))[0] - 0.5
    assert (np.count_nonzero(moved, axis=1) == 2).all()
    np.testing.assert_allclose((moved != 0).mean(axis=0), 1 / 3, atol=0.04)  # each as often as any other
    np.testing.assert_allclose(moved[moved != 0].std(), 0.05, rtol=0.05)
    np.testing.assert_allclose(moved[moved != 0].mean(), 0.0, atol=0.002)


def test_samples_can_be_tried_again():
    method = Boltzmann(candidates=4_000, again=0.25)
    state = method.tell(method.begin(np.full(3, 0.5)), np.full((1, 3), 0.5), np.array([1.0]))
    same = (method.ask(state, np.random.default_rng(0))[0] == 0.5).all(axis=1)
    np.testing.assert_allclose(same.mean(), 0.25, atol=0.03)


def test_equal_scores_make_samples_equally_likely():
    method = Boltzmann()
    state = method.tell(method.begin(np.zeros(1)), np.array([[0.1], [0.2]]), np.ones(2))
    np.testing.assert_allclose(sorted(method.probabilities(state)), [0.0, 0.5, 0.5])


def test_walkers_are_moved_by_noise_and_sometimes_pulled_towards_the_best():
    method = Pulled(candidates=20_000, width=0.01, chance=0.25, pull=0.5)
    state = method.begin(np.full(2, 0.2))
    first, state = method.ask(state, np.random.default_rng(0))
    np.testing.assert_allclose(first[0], 0.2)  # the start itself
    scores = np.full(len(first), -1.0)
    scores[7], scores[9] = 3.0, np.nan
    best = np.array([0.8, 0.6])
    first[7], state["walkers"] = best, np.full_like(first, 0.2)
    state = method.tell(state, first, scores)
    np.testing.assert_array_equal(state["best"], best)
    moved, after = method.ask(state, np.random.default_rng(1))
    pulled = moved[:, 0] > 0.35
    np.testing.assert_allclose(pulled.mean(), 0.25, atol=0.015)
    np.testing.assert_allclose(moved[pulled].mean(axis=0), [0.5, 0.4], atol=0.001)
    np.testing.assert_allclose(moved[~pulled].mean(axis=0), [0.2, 0.2], atol=0.001)
    np.testing.assert_allclose(moved[~pulled].std(axis=0), 0.01, rtol=0.03)
    np.testing.assert_array_equal(after["walkers"], moved)  # whatever the score
    assert method.tell(after, moved, np.full(len(moved), 2.9))["score"] == 3.0
    assert method.tell(after, moved, np.full(len(moved), np.nan))["score"] == 3.0


@pytest.mark.ci
def test_a_pull_climbs_beyond_random_sampling():
    gains = [found(Pulled(), seed=seed).curve[-1] - found(Uniform(), seed=seed).curve[-1] for seed in range(5)]
    assert np.median(gains) > 0


def test_chains_accept_by_the_rule_of_metropolis_at_a_falling_temperature():
    method = Annealing(candidates=40_000, temperature=0.5, cooling=0.5, width=0.05)
    first, state = method.ask(method.begin(np.full(2, 0.2)), np.random.default_rng(0))
    np.testing.assert_array_equal(first[0], 0.2)  # the start itself
    np.testing.assert_allclose(first[1:].mean(axis=0), 0.5, atol=0.01)  # and uniform samples
    np.testing.assert_allclose(first[1:].std(axis=0), 12**-0.5, atol=0.01)
    even = np.arange(len(first)) % 2 == 0
    state = method.tell(state, first, np.where(even, 10.0, 14.0))  # a standard deviation of 2
    np.testing.assert_array_equal(state["places"], first)
    for temperature in (0.5 * 0.5, 0.5 * 0.25):
        moved, asked = method.ask(state, np.random.default_rng(1))
        after = method.tell(asked, moved, state["scores"] - np.where(even, 1.0, -1.0))
        taken = (after["places"] == moved).all(axis=1)
        assert taken[~even].all()  # what is better
        np.testing.assert_allclose(taken[even].mean(), np.exp(-1.0 / (2.0 * temperature)), atol=0.01)
        np.testing.assert_array_equal(after["scores"][even & ~taken], 10.0)
        state = {**state, "rounds": after["rounds"]}
    inside = (abs(first - 0.5) < 0.25).all(axis=1)
    np.testing.assert_allclose((moved - first)[inside].std(), 0.05, rtol=0.02)
    failed = method.tell(asked, moved, np.full(len(moved), np.nan))
    np.testing.assert_array_equal(failed["places"], state["places"])


def test_children_have_the_numbers_of_winners_of_tournaments_and_some_noise():
    method = Genetic(candidates=4_000, tournament=2, crossover=0.5, mutation=0.0)
    state = method.begin(np.full(2, 0.2))
    first, _ = method.ask(state, np.random.default_rng(0))
    np.testing.assert_array_equal(first[0], 0.2)
    np.testing.assert_allclose(first.mean(axis=0), 0.5, atol=0.02)
    state["population"], state["scores"] = np.array([[0.1, 0.1], [0.3, 0.3], [0.9, 0.9]]), np.array([0.0, 2.0, -np.inf])
    children, _ = method.ask(state, np.random.default_rng(1))
    shares = [np.isclose(children[:, 0], place).mean() for place in (0.3, 0.1, 0.9)]
    np.testing.assert_allclose(shares, [5 / 9, 3 / 9, 1 / 9], atol=0.03)  # the best of two of three
    mixed = ~np.isclose(children[:, 0], children[:, 1])
    both = 1 - (25 + 9 + 1) / 81  # of two parents that differ, every number from either
    np.testing.assert_allclose(mixed.mean(), 0.5 * both / 2, atol=0.02)
    noisy = Genetic(candidates=4_000, tournament=2, crossover=0.0, mutation=0.25, width=0.01)
    moved, _ = noisy.ask({**state, "scores": np.array([-np.inf, 0.0, -np.inf])}, np.random.default_rng(2))
    moved = moved[abs(moved[:, 0] - 0.3) < 0.1] - 0.3
    noise = moved[abs(moved) > 1e-9]
    np.testing.assert_allclose(noise.size / moved.size, 0.25, atol=0.03)
    np.testing.assert_allclose(noise.std(), 0.01, rtol=0.05)


def test_the_best_of_a_generation_stay_and_failed_ones_rank_last():
    method = Genetic(candidates=3, elite=1)
    state = method.begin(np.zeros(1))
    state = method.tell(state, np.array([[0.1], [0.2], [0.3]]), np.array([1.0, 5.0, 2.0]))
    state = method.tell(state, np.array([[0.4], [0.5], [0.6]]), np.array([np.nan, 3.0, 4.0]))
    np.testing.assert_array_equal(state["population"][:, 0], [0.2, 0.6, 0.5])
    np.testing.assert_array_equal(state["scores"], [5.0, 4.0, 3.0])
    none = Genetic(candidates=3, elite=0).tell(state, np.array([[0.4], [0.5], [0.6]]), np.full(3, np.nan))
    np.testing.assert_array_equal(none["population"][:, 0], [0.4, 0.5, 0.6])


@pytest.mark.parametrize("method", [Annealing(), Genetic()])
def test_annealing_and_genes_climb_beyond_random_sampling(method):
    gains = [found(method, seed=seed).curve[-1] - found(Uniform(), seed=seed).curve[-1] for seed in range(5)]
    assert np.median(gains) > 0


@needs_evosax
def test_an_evolution_strategy_climbs_the_gradient_of_the_ranks():
    """Its first step is Adam's, by the learning rate along the sign of Σ u ε; pairs mirror each other."""
    method = EvolutionStrategy(population=8, width=0.05, learning_rate=0.02)
    state = method.begin(np.full(3, 0.5))
    asked, state = method.ask(state, np.random.default_rng(0))
    noise = (asked - 0.5) / 0.05
    np.testing.assert_allclose(noise[:4], -noise[4:], atol=1e-5)
    scores = np.array([3.0, 1.0, 1.0, 0.0, 5.0, -2.0, np.nan, 4.0])
    ranks = np.array([4.0, 2.5, 2.5, 1.0, 6.0, 0.0 + 0, -1.0, 5.0]) + 1  # failed ones are the lowest
    utility = ranks / 7 - 0.5
    after = method.tell(state, asked, scores)
    np.testing.assert_allclose(after["mean"] - 0.5, 0.02 * np.sign(utility @ noise), rtol=1e-3)
    flat = method.tell(state, asked, np.ones(8))
    np.testing.assert_allclose(flat["mean"], 0.5, atol=1e-6)  # equal scores say nothing
    failed = method.tell(state, asked, np.full(8, np.nan))
    np.testing.assert_array_equal(failed["mean"], state["mean"])


@needs_evosax
def test_an_evolution_strategy_finds_the_optimum():
    assert found(EvolutionStrategy(population=16), evaluations=1600).curve[-1] > -0.5


@pytest.mark.parametrize("kind", METHODS)
def test_ask_and_tell_change_nothing_that_they_are_given(kind):
    method = kind()
    state = method.begin(SPACE.start)
    asked, after = method.ask(state, np.random.default_rng(0))
    kept = {name: value.copy() for name, value in after.items()}
    again, _ = method.ask(state, np.random.default_rng(0))
    method.tell(after, asked, np.arange(len(asked), dtype=float))
    np.testing.assert_array_equal(asked, again)
    assert asked.shape == (method.batch(SPACE.size), SPACE.size)
    assert ((asked >= 0) & (asked <= 1)).all()
    for name, value in kept.items():
        np.testing.assert_array_equal(after[name], value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Uniform(candidates=0), r"candidates = 0: must be an integer of at least 1"),
        (lambda: Boltzmann(candidates=1.5), r"candidates = 1.5: must be an integer"),  # type: ignore[arg-type]
        (lambda: Boltzmann(temperature=0.0), r"temperature = 0.0: must be a finite number above 0"),
        (lambda: Boltzmann(changed=0), r"changed = 0: must be an integer of at least 1"),
        (lambda: Boltzmann(width=-1.0), r"width = -1.0: must be a finite number above 0"),
        (lambda: Annealing(candidates=1), r"candidates = 1: must be an integer of at least 2"),
        (lambda: Annealing(cooling=0.0), r"cooling = 0.0: must be in \(0, 1\]"),
        (lambda: Genetic(elite=12), r"elite = 12: must be less than the 12 candidates"),
        (lambda: Boltzmann(again=1.0), r"again = 1.0: must be in \[0, 1\)"),
        (lambda: Pulled(candidates=0), r"candidates = 0: must be an integer of at least 1"),
        (lambda: Pulled(width=0.0), r"width = 0.0: must be a finite number above 0"),
        (lambda: Pulled(chance=1.1), r"chance = 1.1: must be in \[0, 1\]"),
        (lambda: Pulled(pull=-0.1), r"pull = -0.1: must be in \[0, 1\]"),
        (lambda: EvolutionStrategy(population=5), r"population = 5: must be an even number"),
        (lambda: EvolutionStrategy(learning_rate=0.0), r"learning_rate = 0.0: must be a finite"),
        (lambda: BayesianOptimisation(candidates=0), r"candidates = 0: must be an integer of at least 1"),
        (lambda: BayesianOptimisation(initial=1), r"initial = 1: must be an integer of at least 2"),
        (lambda: BayesianOptimisation(kernel="matern-32"), r"unknown kernel 'matern-32': did you"),
        (lambda: BayesianOptimisation(acquisition="ei"), r"unknown acquisition 'ei': known are"),
        (lambda: BayesianOptimisation(exploration=-1.0), r"exploration = -1.0: must be a finite"),
        (lambda: BayesianOptimisation(lengths=(0.0, 1.0)), r"lengths\[0\] = 0.0: must be a finite number above 0"),
        (
            lambda: BayesianOptimisation(noise=(0.2, 0.1)),
            r"noise = \(0.2, 0.1\): must be two numbers, the lower first",
        ),
        pytest.param(lambda: CmaEs(population=3), r"population = 3: must be an integer of at least 4"),
        pytest.param(lambda: CmaEs(width=0.0), r"width = 0.0: must be a finite number above 0"),
    ],
)
def test_impossible_settings_are_refused_by_name(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (CmaEs, "CMA-ES needs the package evosax"),
        (BayesianOptimisation, "Bayesian optimisation needs the package tinygp"),
    ],
)
def test_where_a_package_is_missing_the_extra_is_named(monkeypatch, make, message):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(RuntimeError, match=rf"{message}: pip install 'motorgrad\[search\]'"):
        make()
