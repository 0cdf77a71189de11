"""What the methods find, where the best is known; and the Boltzmann distribution itself."""

import importlib.util

import numpy as np
import pytest
from search_examples import METHODS, SPACE, ellipsoid, needs_evosax, noisy_sphere, sphere

from motorgrad.search import Boltzmann, CmaEs, Range, Space, Uniform, search

ONES = dict.fromkeys(SPACE.names, 1.0)


def found(method, score=sphere, evaluations=640, seed=0):
    return search(score, SPACE, method, evaluations=evaluations, seed=seed, progress=False)


@needs_evosax
@pytest.mark.parametrize("score", [sphere, ellipsoid])
def test_cma_es_finds_the_optimum_to_many_digits(score):
    best = found(CmaEs(), score, evaluations=1600)
    assert best.best == pytest.approx(ONES, abs=1e-2)
    assert best.curve[-1] > -1e-3


@pytest.mark.representatives("sphere")
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
    space = Space({"a": Range(0.0, 2.0), "b": Range(0.1, 10.0, log=True)})
    best = search(
        lambda batch, random: [each["a"] - each["b"] for each in batch],
        space,
        evaluations=360,
        progress=False,
    )
    assert best.best == pytest.approx({"a": 2.0, "b": 0.1}, abs=0.02)


@needs_evosax
def test_of_scores_only_their_order_counts_for_cma_es():
    plain = found(CmaEs(), evaluations=160)
    bent = found(CmaEs(), lambda batch, random: -np.exp(-sphere(batch, random) / 50.0), evaluations=160)
    np.testing.assert_array_equal(plain.candidates, bent.candidates)


@needs_evosax
def test_cma_es_takes_equal_scores_as_they_come():
    flat = found(CmaEs(), lambda batch, random: np.zeros(len(batch)), evaluations=800)
    places = SPACE.places(flat.candidates[-80:])
    assert 0.02 < places.std() < 0.4  # it neither collapses nor runs away to the bounds


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
        (lambda: Uniform(candidates=0), r"Uniform.candidates = 0: must be an integer >= 1"),
        (lambda: Boltzmann(candidates=1.5), r"Boltzmann.candidates = 1.5: must be an integer >= 1"),  # type: ignore[arg-type]
        (lambda: Boltzmann(temperature=0.0), r"Boltzmann.temperature = 0.0: must be a finite number above 0"),
        (lambda: Boltzmann(changed=0), r"Boltzmann.changed = 0: must be an integer >= 1"),
        (lambda: Boltzmann(width=-1.0), r"Boltzmann.width = -1.0: must be a finite number above 0"),
        (lambda: Boltzmann(again=1.0), r"Boltzmann.again = 1.0: must be in \[0, 1\)"),
        pytest.param(lambda: CmaEs(population=3), r"CmaEs.population = 3: must be an integer >= 4"),
        pytest.param(lambda: CmaEs(width=0.0), r"CmaEs.width = 0.0: must be a finite number above 0"),
    ],
)
def test_impossible_settings_are_refused_by_name(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_where_evosax_is_missing_the_extra_is_named(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(RuntimeError, match=r"CMA-ES needs the package evosax: pip install 'motorgrad\[search\]'"):
        CmaEs()
