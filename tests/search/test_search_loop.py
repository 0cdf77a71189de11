"""The loop of a search: its record, what failed, what is stored and gone on with."""

import hashlib
import json

import numpy as np
import pytest
from search_examples import METHODS, SPACE, noisy_sphere, sphere

from motorgrad._files import read_arrays, write_arrays
from motorgrad.search import BayesianOptimisation, Boltzmann, Found, Range, Space, Uniform, search


def run(method, score=noisy_sphere, evaluations=72, **more):
    return search(score, SPACE, method, evaluations=evaluations, progress=False, **more)


@pytest.mark.representatives("uniform")
@pytest.mark.parametrize("kind", METHODS)
def test_the_same_seed_finds_the_same_and_another_seed_another(kind):
    one, same, other = (run(kind(), seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.candidates, same.candidates)
    np.testing.assert_array_equal(one.scores, same.scores)
    assert not np.array_equal(one.candidates[-1], other.candidates[-1])


@pytest.mark.ci
@pytest.mark.representatives("boltzmann", "cma-es")
@pytest.mark.parametrize("kind", METHODS)
def test_a_stopped_search_goes_on_bit_for_bit(kind, tmp_path):
    calls = []

    def stops(candidates, random):
        calls.append(len(candidates))
        if len(calls) == 4:
            raise KeyboardInterrupt
        return noisy_sphere(candidates, random)

    with pytest.raises(KeyboardInterrupt):
        run(kind(), stops, out=tmp_path / "deep" / "search.npz")
    done = sum(calls[:-1])
    resumed = run(kind(), stops, out=tmp_path / "deep" / "search.npz")
    whole = run(kind())
    np.testing.assert_array_equal(resumed.candidates, whole.candidates)
    np.testing.assert_array_equal(resumed.scores, whole.scores)
    assert sum(calls[4:]) == len(whole.scores) - done  # what was scored is not scored again


def test_a_finished_search_can_be_made_longer_or_read_shorter(tmp_path):
    file = tmp_path / "search.npz"
    run(Boltzmann(), evaluations=36, out=file)
    longer = run(Boltzmann(), evaluations=72, out=file)
    np.testing.assert_array_equal(longer.scores, run(Boltzmann(), evaluations=72).scores)
    np.testing.assert_array_equal(run(Boltzmann(), evaluations=36, out=file).scores, longer.scores[:36])


def test_a_search_that_was_stored_with_bounds_of_numpy_continues(tmp_path):
    file = tmp_path / "search.npz"
    run(Boltzmann(), evaluations=36, out=file)
    bounds = "Range(low=np.float64(-5.0), high=np.float64(5.0), start=np.float64(3.0), log=False)"
    space = "{" + ", ".join(f"{name!r}: {bounds}" for name in SPACE.names) + "}"
    asked = json.dumps({"space": space, "method": repr(Boltzmann()), "seed": 0})
    write_arrays(file, read_arrays(file) | {"mark": np.array(hashlib.sha256(asked.encode()).hexdigest()[:16])})
    longer = run(Boltzmann(), evaluations=72, out=file)
    np.testing.assert_array_equal(longer.scores, run(Boltzmann(), evaluations=72).scores)


@pytest.mark.parametrize(
    "other",
    [
        lambda file: run(Boltzmann(changed=3), out=file),
        lambda file: run(Boltzmann(), seed=1, out=file),
        lambda file: search(sphere, Space({"a": Range(0, 1)}), Boltzmann(), evaluations=12, out=file, progress=False),
    ],
)
def test_the_file_of_another_search_is_refused(other, tmp_path):
    file = tmp_path / "search.npz"
    run(Boltzmann(), evaluations=12, out=file)
    with pytest.raises(ValueError, match=r"search.npz'?: must be new, or of a search with this space, method and seed"):
        other(file)


@pytest.mark.representatives("boltzmann", "cma-es", "evolution-strategy")
@pytest.mark.parametrize("kind", METHODS)
def test_what_fails_is_recorded_and_avoided(kind):
    """Half of the space fails, as bodies do that cannot be built."""

    def fails(candidates, random):
        scores = sphere(candidates, random)
        return np.where([each["a"] > 2.0 for each in candidates], [np.nan, np.inf][len(scores) % 2], scores)

    evaluations = 120 if isinstance(kind(), BayesianOptimisation) else 360
    found = run(kind(), fails, evaluations=evaluations)
    failed = found.candidates[:, 0] > 2.0
    np.testing.assert_array_equal(np.isnan(found.scores), failed)
    assert failed.any()
    assert found.best["a"] <= 2.0
    assert np.isnan(found.curve[0]) == failed[0]
    assert np.isfinite(found.curve[-1])
    if kind is not Uniform:
        assert failed[-evaluations // 3 :].mean() < 0.3


@pytest.mark.parametrize("kind", METHODS)
def test_a_search_in_which_all_fail_says_so(kind):
    found = run(kind(), lambda candidates, random: [np.nan] * len(candidates))
    assert np.isnan(found.curve).all()
    assert found.ranked() == []
    assert "72 failed" in repr(run(Uniform(), lambda candidates, random: [np.nan] * len(candidates)))
    with pytest.raises(ValueError, match="candidates that did not fail = 0: must be at least one"):
        _ = found.best


def test_candidates_tried_again_count_by_their_mean():
    rows, scores = np.array([[1.0], [2.0], [1.0], [3.0]]), np.array([5.0, 4.0, 1.0, np.nan])
    found = Found(Space({"a": Range(0, 4)}), rows, scores, batch=1)
    assert found.ranked() == [({"a": 2.0}, 4.0), ({"a": 1.0}, 3.0)]
    assert found.best == {"a": 2.0}
    np.testing.assert_array_equal(found.curve, [5, 5, 5, 5])
    assert repr(found) == "Found(4 evaluations of 1 numbers, 1 failed, best score 4)"


def test_only_whole_rounds_are_made():
    assert len(run(Uniform(candidates=10), evaluations=39).scores) == 30


def test_progress_is_told(capsys):
    search(sphere, SPACE, Uniform(), evaluations=48)
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith("search by Uniform: 48/48 evaluations · best -")
    search(sphere, SPACE, Uniform(), evaluations=48, progress=False)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"evaluations": 11}, r"evaluations = 11: must be an integer >= 12"),
        ({"seed": -1}, r"seed = -1: must be an integer >= 0"),
        (
            {"score": lambda candidates, random: [1.0]},
            r"scores.shape = \(1,\): must be \(12,\), one for each candidate",
        ),
        ({"out": "."}, r"out = '.': cannot be written: it is a folder"),
    ],
)
def test_bad_arguments_are_refused_by_name(change, message):
    with pytest.raises(ValueError, match=message):
        search(**{"score": sphere, "space": SPACE, "method": Uniform(), "evaluations": 24, "progress": False, **change})
